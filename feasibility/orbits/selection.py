"""Which bodies of a table are wanted: expressions such as ``a > 2.2 and e < 0.2 and H < 16``.

An expression is read with Python's own grammar and evaluated by hand: names of columns, numbers,
``+ - * / **``, comparisons (also chained, ``2.2 < a < 2.5``), ``in (1, 4, 10)``, ``and``, ``or``,
``not``, ``abs`` and ``sqrt``. Nothing else is understood, so that nothing else can happen. A
comparison with an unknown value (NaN) is false.
"""

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, MJD2000_MJD
from feasibility.errors import InputError
from feasibility.orbits.catalogue import Catalogue
from feasibility.orbits.readers.bodies import BodyTable
from feasibility.orbits.readers.columns import UnitError, column_of

_MAX_LETTERS: Final = 2000

_Columns = Mapping[str, NDArray[Any]]
_Binary = Callable[[Any, Any], Any]

_ARITHMETIC: Final[dict[type[ast.operator], _Binary]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_COMPARISONS: Final[dict[type[ast.cmpop], _Binary]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_FUNCTIONS: Final[dict[str, Callable[[Any], Any]]] = {"abs": np.abs, "sqrt": np.sqrt}


def selected(expression: str, columns: _Columns, source: str) -> NDArray[np.bool_]:
    """Return which rows an expression selects.

    Parameters
    ----------
    expression : str
        A condition on columns.
    columns : mapping of str to array
        (n,) numbers each, by name; other names of orbital elements (``inc``, ``om``) stand for
        them too.
    source : str
        The table, for messages.

    Returns
    -------
    NDArray
        (n,) bool.

    Raises
    ------
    InputError
        The expression cannot be understood, or selects nothing.
    """
    try:
        _check_length(expression)
        tree = ast.parse(expression.strip(), mode="eval")
        with np.errstate(all="ignore"):
            answer = _Evaluation(columns).condition(tree.body)
    except _SelectionError as error:
        raise InputError(f"{source}: select {expression[:80]!r}: {error}") from None
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(
            f"{source}: select {expression[:80]!r} is no condition; expected one such as "
            f"'a > 2.2 and e < 0.2' of the columns {_listed(columns)}"
        ) from None
    n = len(next(iter(columns.values())))
    rows: NDArray[np.bool_] = np.broadcast_to(answer, (n,)).astype(bool)
    if not rows.any():
        raise InputError(f"{source}: select {expression[:80]!r} leaves none of {n} bodies")
    return rows


def selected_bodies(bodies: BodyTable, expression: str, source: str) -> BodyTable:
    """Return the bodies of a table that an expression selects.

    Raises
    ------
    InputError
        As `selected`.
    """
    return bodies.take(np.flatnonzero(selected(expression, bodies.columns(), source)))


def selected_rows(catalogue: Catalogue, expression: str) -> Catalogue:
    """Return the bodies of a catalogue that an expression selects; a in AU, angles in degrees.

    Raises
    ------
    InputError
        As `selected`.
    """
    a, e, *angles = catalogue.elements.T
    columns = {
        "id": catalogue.ids,
        "epoch": catalogue.epoch_mjd2000 + MJD2000_MJD,
        "a": a / AU,
        "e": e,
        **dict(zip(("i", "node", "argp", "M"), map(np.degrees, angles), strict=True)),
        "q": a * (1.0 - e) / AU,
        "Q": a * (1.0 + e) / AU,
        **catalogue.extra,
    }
    return catalogue.select(selected(expression, columns, catalogue.source))


def _check_length(expression: str) -> None:
    if len(expression) > _MAX_LETTERS:
        raise _SelectionError(f"{len(expression)} letters, expected {_MAX_LETTERS} at most")


def _listed(columns: _Columns) -> str:
    return ", ".join(columns)


@final
class _SelectionError(Exception):
    """What is wrong with an expression; the caller knows which it is."""


@final
class _Evaluation:
    """Evaluates the parts of an expression on columns."""

    def __init__(self, columns: _Columns) -> None:
        self._columns = columns

    def condition(self, node: ast.expr) -> Any:
        """Return (n,) bool, or one bool for all."""
        match node:
            case ast.BoolOp(op=op, values=values):
                parts = [self.condition(value) for value in values]
                combine = np.logical_and if isinstance(op, ast.And) else np.logical_or
                answer = parts[0]
                for part in parts[1:]:
                    answer = combine(answer, part)
                return answer
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return np.logical_not(self.condition(operand))
            case ast.Compare(left=left, ops=ops, comparators=others):
                return self._comparison([left, *others], ops)
            case ast.Constant(value=bool(value)):
                return value
            case ast.Name():
                # A flag, such as neo.
                column = self.number(node)
                return (column != 0) & ~np.isnan(column)
        raise _SelectionError(
            f"{ast.unparse(node)[:60]!r} is no condition; expected a comparison such as a > 2.2"
        )

    def _comparison(self, sides: list[ast.expr], ops: list[ast.cmpop]) -> Any:
        answer: Any = True
        for left, op, right in zip(sides[:-1], ops, sides[1:], strict=True):
            if isinstance(op, ast.In | ast.NotIn):
                answer = np.logical_and(answer, self._membership(left, op, right))
                continue
            compare = _COMPARISONS.get(type(op))
            if compare is None:
                raise _SelectionError("'is' is not understood; expected <, <=, >, >=, == or !=")
            one, two = self.number(left), self.number(right)
            known = ~(np.isnan(one) | np.isnan(two))
            answer = np.logical_and(answer, compare(one, two) & known)
        return answer

    def _membership(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> Any:
        if not isinstance(right, ast.Tuple | ast.List | ast.Set) or not right.elts:
            raise _SelectionError(
                "'in' needs a list of numbers; expected one such as id in (1, 4)"
            )
        value = self.number(left)
        found: Any = False
        for part in right.elts:
            found = np.logical_or(found, value == self.number(part))
        found = np.logical_not(found) if isinstance(op, ast.NotIn) else found
        return found & ~np.isnan(value)

    def number(self, node: ast.expr) -> Any:
        """Return (n,) numbers, or one number for all."""
        match node:
            case ast.Constant(value=bool(value)):
                raise _SelectionError(f"{value} is no number")
            case ast.Constant(value=int(value) | float(value)):
                try:
                    return np.float64(value)
                except OverflowError:
                    raise _SelectionError("a number is too large") from None
            case ast.Name(id=name):
                return self._column(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self.number(operand)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.number(operand)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
                return _ARITHMETIC[type(op)](self.number(left), self.number(right))
            case ast.Call(func=ast.Name(id=name), args=[part], keywords=[]) if name in _FUNCTIONS:
                return _FUNCTIONS[name](self.number(part))
        raise _SelectionError(
            f"{ast.unparse(node)[:60]!r} is not understood; expected numbers, columns "
            f"({_listed(self._columns)}), + - * / **, abs and sqrt"
        )

    def _column(self, name: str) -> NDArray[Any]:
        if name in self._columns:
            return self._columns[name]
        try:
            meaning = column_of(name, None).meaning
        except UnitError:
            meaning = None
        if meaning is not None and meaning in self._columns:
            return self._columns[meaning]
        raise _SelectionError(f"no column {name!r}; columns are {_listed(self._columns)}")

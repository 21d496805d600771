"""`Asked`: a problem, which may be anybody's, whose answers are checked before they are used."""

import copy
import dataclasses
import operator
import pickle
from collections.abc import Iterator
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem


@final
class ProblemContractError(AssertionError):
    """A problem breaks the contract; the message is one line that says how."""


@final
class Asked:
    """Asks a problem twice and its pickled copy once, and insists on one answer.

    Parameters
    ----------
    problem : Problem
        Whom it asks.

    Raises
    ------
    ProblemContractError
        The problem cannot be pickled.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._kind = type(problem).__name__
        try:
            self._twin = pickle.loads(pickle.dumps(problem))
        except Exception as error:
            raise ProblemContractError(
                f"{self._kind}: not picklable, so it cannot travel to worker processes "
                f"({type(error).__name__}: {one_line(error)})"
            ) from error

    def breach(self, member: str, how: str) -> ProblemContractError:
        """Return the error that says how a member breaks the contract."""
        return ProblemContractError(f"{self._kind}.{member}: {how}")

    def value(self, member: str) -> Any:
        """Return an attribute.

        Raises
        ------
        ProblemContractError
            It raised, or that of the pickled copy differs.
        """
        try:
            value = operator.attrgetter(member)(self.problem)
            restored = operator.attrgetter(member)(self._twin)
        except Exception as error:
            raise self.breach(
                member, f"raised {type(error).__name__}: {one_line(error)}"
            ) from error
        if not dataclasses.is_dataclass(value) and not same(value, restored):
            raise self.breach(member, "a pickled and restored copy has another one")
        return value

    def ask(self, member: str, *arguments: Any) -> Any:
        """Return a copy of what a method answers; of an iterator, the list.

        Parameters
        ----------
        member : str
            Name of the method, such as ``"hops"`` or ``"custom_moves.starts"``.
        *arguments : object
            Its arguments. Arrays, nodes and random generators are copied for each call.

        Raises
        ------
        ProblemContractError
            It raised, changed its arguments, or gave two answers.
        """
        first = self._call(self.problem, member, arguments)
        if not same(self._call(self.problem, member, arguments), first):
            raise self.breach(member, "not pure: two calls with the same arguments differ")
        if not same(self._call(self._twin, member, arguments), first):
            raise self.breach(member, "a pickled and restored copy answers differently")
        return first

    def _call(self, problem: Problem, member: str, arguments: tuple[Any, ...]) -> Any:
        handed = [_copy(argument) for argument in arguments]
        try:
            answer = operator.attrgetter(member)(problem)(*handed)
            answer = list(answer) if isinstance(answer, Iterator) else copy.deepcopy(answer)
        except Exception as error:
            nodes = next((len(part) for part in arguments if isinstance(part, Nodes)), None)
            what = "" if nodes is None else f" on {nodes} nodes"
            raise self.breach(
                member, f"raised {type(error).__name__}{what}: {one_line(error)}"
            ) from error
        for mine, theirs in zip(arguments, handed, strict=True):
            if isinstance(mine, np.ndarray | Nodes) and not same(mine, theirs):
                raise self.breach(member, "not pure: it changed its arguments")
        return answer

    def array(self, member: str, answer: Any, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """Return an answer that is an array of a shape and dtype.

        Raises
        ------
        ProblemContractError
            It is not.
        """
        if not isinstance(answer, np.ndarray):
            raise self.breach(
                member, f"returned {type(answer).__name__}, expected an array of shape {shape}"
            )
        if answer.shape != shape:
            raise self.breach(member, f"returned shape {answer.shape}, expected {shape}")
        if answer.dtype != dtype:
            raise self.breach(
                member, f"returned dtype {answer.dtype}, expected {np.dtype(dtype).name}"
            )
        return answer


def same(one: Any, other: Any, tolerance: float = 0.0) -> bool:
    """Tell whether two answers are the same, arrays of floats within a relative tolerance."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        if one.shape != other.shape or one.dtype != other.dtype:
            return False
        if not tolerance or one.dtype.kind != "f":
            return bool(np.array_equal(one, other, equal_nan=one.dtype.kind == "f"))
        scale = np.abs(one[np.isfinite(one)]).max(initial=0.0)
        return bool(np.allclose(one, other, tolerance, tolerance * scale, equal_nan=True))
    if dataclasses.is_dataclass(one):
        return all(
            same(getattr(one, field.name), getattr(other, field.name), tolerance)
            for field in dataclasses.fields(one)
        )
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other, [tolerance] * len(one)))
    return bool(one == other)


def one_line(error: Exception) -> str:
    """Return the message of an error without line breaks."""
    return " ".join(str(error).split())


def _copy(argument: Any) -> Any:
    copied = isinstance(argument, np.ndarray | Nodes | np.random.Generator)
    return copy.deepcopy(argument) if copied else argument

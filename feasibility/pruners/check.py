"""Does a pruner honour the contract of `Pruner`? `check_pruner` in full, `quick_check` at once."""

import pickle
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.legs import Legs
from feasibility.orbits.varied_legs import regroupings, varied_legs
from feasibility.pruners.all_of import AllOf
from feasibility.pruners.asking import PrunerContractError, answer
from feasibility.pruners.classifier import ClassifierPruner
from feasibility.pruners.keep_all import KeepAll
from feasibility.pruners.lambert import LambertPruner
from feasibility.pruners.mima import Mima2Pruner, MimaPruner
from feasibility.pruners.protocol import Pruner

_OURS: Final = (ClassifierPruner, KeepAll, LambertPruner, Mima2Pruner, MimaPruner)
_FEW: Final = 6


def quick_check(pruner: Pruner) -> None:
    """Test cheaply, before a search, that a pruner of somebody's own honours the contract.

    It is called five times on up to six legs: enough to find a wrong shape or dtype, answers that
    depend on other rows or on the call, and changed legs, in most cases. The
    pruners of this package, which `check_pruner` tests, are not asked; of `AllOf` each member is.

    Raises
    ------
    PrunerContractError
        The answer has the wrong shape or dtype, depends on other rows, or changes from call
        to call; `keep` changes the legs, or raises.
    """
    if isinstance(pruner, AllOf):
        for member in pruner.pruners:
            quick_check(member)
        return
    if isinstance(pruner, _OURS):
        return
    legs = varied_legs(np.random.default_rng(0)).take(np.arange(_FEW))
    label = f"{type(pruner).__name__}.keep"
    mask = _pure_answer(pruner, legs, label)
    every = np.arange(_FEW)
    for what, rows in (
        ("the legs are reversed", every[::-1]),
        ("some legs are asked without the others", every[1::2]),
        (f"leg {_FEW - 1} is asked alone", every[-1:]),
    ):
        _check_same(pruner, legs, rows, mask, label, what)


def check_pruner(
    pruner: Pruner, legs: Legs | None = None, *, rng: np.random.Generator | None = None
) -> None:
    """Test that `pruner` honours the contract of `Pruner`.

    To be called from the tests of whoever writes a pruner. What a pruner keeps
    is its own affair: keeping all and dropping all are both legal.

    Parameters
    ----------
    pruner : Pruner
        Pickled and called some ten times.
    legs : Legs, optional
        Legs to ask about; a varied batch of 64 is drawn where not given.
    rng : numpy.random.Generator, optional
        Draws the batch and the permutation; `default_rng(0)` where not given.

    Raises
    ------
    PrunerContractError
        The answer has the wrong shape or dtype, depends on other rows or on the
        order, changes from call to call, or changes the legs; `keep` raises, be
        it on no legs; the pruner cannot be pickled or comes back different.
    """
    generator = np.random.default_rng(0) if rng is None else rng
    batch = varied_legs(generator) if legs is None else legs
    label = f"{type(pruner).__name__}.keep"
    mask = _pure_answer(pruner, batch, label)
    answer(pruner, batch.take(np.arange(0)))
    for what, rows in regroupings(len(batch), generator):
        _check_same(pruner, batch, rows, mask, label, what)
    try:
        twin = pickle.loads(pickle.dumps(pruner))
    except Exception as error:
        raise PrunerContractError(
            f"{type(pruner).__name__}: not picklable, so it cannot travel to worker processes "
            f"({type(error).__name__}: {error})"
        ) from error
    if not np.array_equal(answer(twin, batch), mask):
        raise PrunerContractError(f"{label}: a pickled and restored copy answers differently")


def _pure_answer(pruner: Pruner, legs: Legs, label: str) -> NDArray[np.bool_]:
    """Return the answer, of the right form, of two calls that agree and leave the legs alone."""
    before = pickle.dumps(legs)
    mask = answer(pruner, legs)
    if pickle.dumps(legs) != before:
        raise PrunerContractError(f"{label}: not pure: it changed the legs")
    if not np.array_equal(answer(pruner, legs), mask):
        raise PrunerContractError(f"{label}: not pure: two calls with the same legs differ")
    return mask


def _check_same(
    pruner: Pruner,
    legs: Legs,
    rows: NDArray[np.intp],
    mask: NDArray[np.bool_],
    label: str,
    what: str,
) -> None:
    """Raise PrunerContractError where the given rows get other answers than in the whole batch."""
    if not np.array_equal(answer(pruner, legs.take(rows)), mask[rows]):
        raise PrunerContractError(f"{label}: not row-wise: a leg gets another answer when {what}")

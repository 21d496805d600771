"""`check_pruner`: tests that a pruner honours the contract of `Pruner`."""

import pickle

import numpy as np
from numpy.typing import NDArray

from feasibility.legs import Legs
from feasibility.orbits.varied_legs import regroupings, varied_legs
from feasibility.pruners.asking import PrunerContractError, ask
from feasibility.pruners.protocol import Pruner


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
    before = pickle.dumps(batch)
    mask = ask(pruner, batch)
    if pickle.dumps(batch) != before:
        raise PrunerContractError(f"{label}: not pure: it changed the legs")
    if not np.array_equal(ask(pruner, batch), mask):
        raise PrunerContractError(f"{label}: not pure: two calls with the same legs differ")
    ask(pruner, batch.take(np.arange(0)))
    _check_row_wise(pruner, batch, mask, label, generator)
    try:
        twin = pickle.loads(pickle.dumps(pruner))
    except Exception as error:
        raise PrunerContractError(
            f"{type(pruner).__name__}: not picklable, so it cannot travel to worker processes "
            f"({type(error).__name__}: {error})"
        ) from error
    if not np.array_equal(ask(twin, batch), mask):
        raise PrunerContractError(f"{label}: a pickled and restored copy answers differently")


def _check_row_wise(
    pruner: Pruner,
    legs: Legs,
    mask: NDArray[np.bool_],
    label: str,
    rng: np.random.Generator,
) -> None:
    for what, rows in regroupings(len(legs), rng):
        answer = ask(pruner, legs.take(rows))
        if not np.array_equal(answer, mask[rows]):
            raise PrunerContractError(
                f"{label}: not row-wise: a leg gets another answer when {what}"
            )

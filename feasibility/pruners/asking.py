"""`ask`: the answer of a pruner, which may be anybody's, checked before it is used."""

from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.legs import Legs
from feasibility.pruners.protocol import Pruner


@final
class PrunerContractError(AssertionError):
    """A pruner breaks the contract; the message is one line that says how."""


def ask(pruner: Pruner, legs: Legs) -> NDArray[np.bool_]:
    """Return (n,) what a pruner keeps of n legs; it is not called where there are none.

    Many models of others, scikit-learn's among them, refuse a batch without rows.

    Raises
    ------
    PrunerContractError
        As for `answer`.
    """
    return answer(pruner, legs) if len(legs) else np.zeros(0, dtype=np.bool_)


def answer(pruner: Pruner, legs: Legs) -> NDArray[np.bool_]:
    """Return (n,) what a pruner keeps of n legs, be there none.

    Raises
    ------
    PrunerContractError
        `keep` raised, or returned something else than (n,) bool.
    """
    label = f"{type(pruner).__name__}.keep"
    what = f"{len(legs)} legs" if len(legs) else "no legs"
    try:
        mask = pruner.keep(legs)
    except PrunerContractError:
        raise
    except Exception as error:
        message = " ".join(str(error).split())
        raise PrunerContractError(
            f"{label}: raised {type(error).__name__} on {what}: {message}"
        ) from error
    if not isinstance(mask, np.ndarray):
        raise PrunerContractError(
            f"{label}: returned {type(mask).__name__} on {what}, expected a numpy array"
        )
    if mask.shape != (len(legs),):
        raise PrunerContractError(
            f"{label}: returned shape {mask.shape} on {what}, expected ({len(legs)},)"
        )
    if mask.dtype != np.bool_:
        raise PrunerContractError(f"{label}: returned dtype {mask.dtype} on {what}, expected bool")
    # A view of an array that the pruner keeps could change under our feet.
    return mask.copy()

"""`check_predictor`: tests that a predictor honours the contract of `LegPredictor`."""

import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor, QuickPredictor
from feasibility.legs import Legs
from feasibility.orbits.varied_legs import regroupings, varied_legs

_Array = NDArray[np.float64]

_THREADS: Final = 4
"""Threads that ask at once."""


@final
class PredictorContractError(AssertionError):
    """A predictor breaks the contract; the message is one line that says how."""


def check_predictor(
    predictor: LegPredictor, legs: Legs | None = None, *, rng: np.random.Generator | None = None
) -> None:
    """Test that `predictor` honours the contract of `LegPredictor`.

    To be called from the tests of whoever writes a predictor. How good its answers are is
    its own affair: to know nothing about any leg is legal.

    Parameters
    ----------
    predictor : LegPredictor
        Pickled, and each of its methods called some twenty times; `quick_margin` is tested
        where there is one.
    legs : Legs, optional
        Legs to ask about; a varied batch of 64 is drawn where not given.
    rng : numpy.random.Generator, optional
        Draws the batch and the permutation; `default_rng(0)` where not given.

    Raises
    ------
    PredictorContractError
        A method is missing or raises, be it on no legs; an answer has the wrong shape or dtype
        or is out of range, depends on other rows or on the order, changes from call to call,
        or changes the legs; the predictor cannot be pickled or comes back different.
    """
    generator = np.random.default_rng(0) if rng is None else rng
    batch = varied_legs(generator) if legs is None else legs
    kind = type(predictor).__name__
    for name in ("margin", "final_mass"):
        if not callable(getattr(predictor, name, None)):
            raise PredictorContractError(f"{kind}: has no method {name}(legs)")
    names = ["margin", "final_mass"]
    names += ["quick_margin"] if isinstance(predictor, QuickPredictor) else []
    answers = {name: _check_method(predictor, name, batch, generator) for name in names}
    try:
        twin = pickle.loads(pickle.dumps(predictor))
    except Exception as error:
        raise PredictorContractError(
            f"{kind}: not picklable, so it cannot travel to worker processes "
            f"({type(error).__name__}: {_one_line(error)})"
        ) from error
    for name, answer in answers.items():
        if not _same(_ask(twin, name, batch), answer):
            raise PredictorContractError(
                f"{kind}.{name}: a pickled and restored copy answers differently"
            )


def _check_method(
    predictor: LegPredictor, name: str, legs: Legs, rng: np.random.Generator
) -> _Array:
    """Return the answers of one method about the legs, which have been found to be legal."""
    label = f"{type(predictor).__name__}.{name}"
    before = pickle.dumps(legs)
    answer = _ask(predictor, name, legs)
    if pickle.dumps(legs) != before:
        raise PredictorContractError(f"{label}: not pure: it changed the legs")
    if not _same(_ask(predictor, name, legs), answer):
        raise PredictorContractError(f"{label}: not pure: two calls with the same legs differ")
    _ask(predictor, name, legs.take(np.arange(0)))
    _check_range(label, name, answer, legs)
    for what, rows in regroupings(len(legs), rng):
        if not _same(_ask(predictor, name, legs.take(rows)), answer[rows]):
            raise PredictorContractError(
                f"{label}: not row-wise: a leg gets another answer when {what}"
            )
    with ThreadPoolExecutor(_THREADS) as pool:
        at_once = list(pool.map(lambda _: _ask(predictor, name, legs), range(2 * _THREADS)))
    if not all(_same(one, answer) for one in at_once):
        raise PredictorContractError(
            f"{label}: not pure: the answers change where {_THREADS} threads ask at once"
        )
    return answer


def _check_range(label: str, name: str, answer: _Array, legs: Legs) -> None:
    """Raise PredictorContractError where an answer is neither NaN nor possible."""
    if name == "final_mass":
        wrong = (answer < 0.0) | (answer > legs.m0)
        expected = "0 to the initial mass"
    else:
        wrong = (answer <= 0.0) | np.isinf(answer)
        expected = "a finite number above 0"
    if wrong.any():
        row = int(np.argmax(wrong))
        mass = f" of {legs.m0[row]:g} kg" if name == "final_mass" else ""
        raise PredictorContractError(
            f"{label}: returned {answer[row]:g} for leg {row}{mass}, expected {expected}, or NaN "
            "where nothing is known"
        )


def _ask(predictor: Any, name: str, legs: Legs) -> _Array:
    """Return (n,) a copy of an answer of the right form."""
    label = f"{type(predictor).__name__}.{name}"
    what = f"{len(legs)} legs" if len(legs) else "no legs"
    method: Callable[[Legs], Any] = getattr(predictor, name)
    try:
        answer = method(legs)
    except Exception as error:
        raise PredictorContractError(
            f"{label}: raised {type(error).__name__} on {what}: {_one_line(error)}"
        ) from error
    if not isinstance(answer, np.ndarray):
        raise PredictorContractError(
            f"{label}: returned {type(answer).__name__} on {what}, expected a numpy array"
        )
    if answer.shape != (len(legs),):
        raise PredictorContractError(
            f"{label}: returned shape {answer.shape} on {what}, expected ({len(legs)},)"
        )
    if answer.dtype != np.float64:
        raise PredictorContractError(
            f"{label}: returned dtype {answer.dtype} on {what}, expected float64"
        )
    # A view of an array that the predictor keeps could change under our feet.
    return answer.copy()


def _same(one: _Array, other: _Array) -> bool:
    return np.array_equal(one, other, equal_nan=True)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())

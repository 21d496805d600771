"""What a model is compared with: closed forms, and a public network where it is installed.

Each gives a score, (n,) float64: a leg is called feasible where it is 0 or more. The scores
are logarithms of how many times the thing asked for could be had. Of free ends they know as much
as the pruners do: Lambert's arcs with the excess velocities cut to their bounds.
"""

import importlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.evaluation.metrics import Confusion, auc, has_both_classes
from feasibility.legs import Legs
from feasibility.orbits.lambert import lambert_delta_v, with_lambert_excess
from feasibility.orbits.mima import mima, mima2
from feasibility.orbits.transfer_plane import in_line, levelled_targets

_Array = NDArray[np.float64]

MAX_REVS: Final = 2
"""Closed forms take their best Lambert branch of up to this many revolutions."""

NEURAL: Final = "neural_lowthrust"
"""Name of the package of Zhang et al. 2026 on PyPI, a net for any spacecraft."""

NEAR: Final = (0.15, 0.05)
"""Legs within these shares of the boundary, by abs(m*/m0 - 1), are judged on their own."""


@final
@dataclass(frozen=True, eq=False)
class Peer:
    """One that answers the same question.

    Attributes
    ----------
    name : str
        For tables.
    score : callable
        Legs to (n,) scores.
    """

    name: str
    score: Callable[[Legs], _Array]


@final
@dataclass(frozen=True, eq=False)
class PeerOutcome:
    """How a peer did on n legs.

    Attributes
    ----------
    name : str
        Name of the peer.
    score : (n,) float64
        Its scores.
    metrics : dict of str to float
        Equations 11 to 14, AUC, balanced accuracy, ``accuracy_within_15_percent`` and so on where
        margins are known, and ``us_per_leg``, processor time.
    """

    name: str
    score: _Array
    metrics: dict[str, float]


def known_peers() -> tuple[list[Peer], str | None]:
    """Return the peers that can be asked, and why one is missing if it is."""
    peers = [
        Peer("Lambert", lambert_score),
        Peer("MIMA", lambda legs: _heavy(mima, legs)),
        Peer("MIMA2", lambda legs: _heavy(mima2, legs)),
    ]
    try:
        package = importlib.import_module(NEURAL)
    except ImportError as error:
        return peers, f"{NEURAL} is left out: {error}; pip install {NEURAL}"
    return [*peers, Peer(NEURAL, lambda legs: _neural_score(package, legs))], None


def ask(peer: Peer, legs: Legs, y: NDArray[np.bool_], log_margin: _Array) -> PeerOutcome:
    """Judge a peer.

    Parameters
    ----------
    peer : Peer
        The one that answers.
    legs : Legs
        n legs.
    y : (n,) bool
        Whether each is feasible.
    log_margin : (n,) float64
        log(m*/m0), NaN where it is not known.
    """
    peer.score(legs.take(np.arange(min(len(legs), 1))))  # compiles what there is to compile
    began = time.process_time()
    # A NaN is no answer; what cannot be computed is not flown.
    score = np.nan_to_num(peer.score(legs), nan=-np.inf, posinf=np.inf, neginf=-np.inf)
    seconds = time.process_time() - began
    answers = score >= 0.0
    counts = Confusion.of(y, answers)
    two_sided = (
        {"auc": auc(y, score), "balanced_accuracy": counts.balanced_accuracy}
        if has_both_classes(y)
        else {}
    )
    metrics = {
        "accuracy": counts.accuracy,
        "precision": counts.precision,
        "recall": counts.recall,
        "f1": counts.f_score(1.0),
        "f10": counts.f_score(10.0),
        **two_sided,
        **near_boundary(answers == y, log_margin),
        "us_per_leg": 1e6 * seconds / len(legs),
    }
    return PeerOutcome(peer.name, score, metrics)


def near_boundary(right: NDArray[np.bool_], log_margin: _Array) -> dict[str, float]:
    """Return the shares of right answers within `NEAR`, of those widths that have legs."""
    distance = np.abs(np.expm1(log_margin))
    return {
        f"accuracy_within_{100 * width:.0f}_percent": float(right[distance <= width].mean())
        for width in NEAR
        if (distance <= width).any()
    }


def lambert_score(legs: Legs) -> _Array:
    """Return the score of the rule of `LambertPruner`.

    The initial mass that the engine, at full thrust all the time, gives the delta-v of the
    cheapest Lambert arc (Tsiolkovsky's equation), or the mass that is left against the dry
    mass, whichever is the tighter.
    """
    exhaust = legs.exhaust_velocity
    needed = lambert_delta_v(
        *(legs.rv_dep, _targets(legs), legs.tof_s, MAX_REVS),
        vinf_dep=legs.vinf_dep,
        vinf_arr=legs.vinf_arr,
    )
    with np.errstate(divide="ignore"):
        heaviest = legs.thrust * legs.tof_s / (exhaust * -np.expm1(-needed / exhaust))
        room = np.log(legs.m0 / legs.m_dry) - needed / exhaust
    score: _Array = np.minimum(np.log(heaviest / legs.m0), room)
    return _kept_in_line(legs, np.where(np.isfinite(needed), score, -np.inf))


def _heavy(estimate: Callable[..., _Array], legs: Legs) -> _Array:
    rv_dep, rv_arr, thrustless = _ends(legs)
    mass = estimate(rv_dep, rv_arr, legs.tof_s, legs.thrust, legs.exhaust_velocity, MAX_REVS)
    with np.errstate(divide="ignore", invalid="ignore"):
        score = np.asarray(np.log(mass / legs.m0))
    return _kept_in_line(legs, np.where(thrustless, np.inf, score))


def _ends(legs: Legs) -> tuple[_Array, _Array, NDArray[np.bool_]]:
    """Return end states as those who know no free ends are asked, and which legs need no thrust.

    Free ends have the excess velocity of the Lambert arc of which least is left, cut to its bound.
    """
    rv_dep, rv_arr = legs.rv_dep, _targets(legs)
    thrustless = np.zeros(len(legs), dtype=np.bool_)
    free = np.flatnonzero(legs.free_ends)
    if len(free):
        rv_dep, rv_arr = rv_dep.copy(), rv_arr.copy()
        some = legs.take(free)
        rv_dep[free], rv_arr[free], rest = with_lambert_excess(
            *(some.rv_dep, rv_arr[free], some.tof_s, some.vinf_dep, some.vinf_arr),
            max_revs=MAX_REVS,
        )
        thrustless[free] = rest == 0.0
    return rv_dep, rv_arr, thrustless


def _targets(legs: Legs) -> _Array:
    """Return the arrival states as the pruners of closed forms take them."""
    return levelled_targets(legs.rv_dep, legs.rv_arr, legs.tof_s, MU_SUN)


def _kept_in_line(legs: Legs, score: _Array) -> _Array:
    """Return scores that are infinite where the pruners keep a leg that they cannot judge."""
    return np.where(in_line(legs.rv_dep, legs.rv_arr), np.inf, score)


def _neural_score(package: Any, legs: Legs) -> _Array:
    """Return log(time of flight / its estimate of the shortest one).

    Its inputs are states, time, mass, thrust and mu in one system of units, here SI, and the
    specific impulse in s: with the exhaust velocity in its place its answers are far off.
    """
    folder = Path(package.__file__).parent / "models" / "eigen_model_tmin_large"
    predictor = package.EigenFastPredictor(str(folder))
    free = legs.free_ends.any()
    rv_dep, rv_arr = _ends(legs)[:2] if free else (legs.rv_dep, legs.rv_arr)
    rows = np.column_stack(
        [
            *(rv_dep, rv_arr, legs.tof_s, legs.m0, legs.thrust, legs.isp),
            np.full(len(legs), MU_SUN),
        ]
    )
    shortest = [
        predictor.fast_predict_vector_tmin(package.nn_input_1_rotate_lambert(row))
        for row in rows.tolist()
    ]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log(legs.tof_s / np.array(shortest)))

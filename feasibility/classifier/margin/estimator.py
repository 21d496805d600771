"""`MarginEstimator`: a trained margin model, asked about legs; needs no torch."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.features import FEATURE_SET, FEATURES
from feasibility.classifier.margin.prediction import LegPrediction
from feasibility.classifier.margin.view_nets import UNKNOWN, ViewNets
from feasibility.classifier.margin.views import FREE_ENDS, RENDEZVOUS
from feasibility.errors import InputError
from feasibility.legs import Legs

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

_SETTLED_AT_A_TIME: Final = 2048
"""Legs of which the quick net settles most; the work of one thread at a time."""

_LOOKED_AT_A_TIME: Final = 256
"""Legs for the large net, twenty times as much work each: a thread must not be left with a large
block at the end while the others have nothing to do. As many as the nets multiply at a time."""


@final
class MarginEstimator:
    """Estimates log(m* / m0) of legs and how likely it is to be 0 or more.

    Two nets: the quick one settles legs far from the boundary, the other one looks at the
    rest. The settled ones get the probabilities at the ends of the scale, so that a heavier
    spacecraft is never more feasible. Legs with free ends have such nets of their own.

    Parameters
    ----------
    artefact : Artefact
        A model of kind "margin". One without nets for free ends knows nothing of such legs.

    Raises
    ------
    InputError
        The artefact has other features than this version, or an array is missing.
    """

    def __init__(self, artefact: Artefact) -> None:
        if artefact.feature_set != FEATURE_SET or artefact.features != FEATURES:
            raise InputError(
                f"model with features {artefact.feature_set!r}: unknown, expected {FEATURE_SET!r}"
            )
        try:
            self._rendezvous = ViewNets(artefact, RENDEZVOUS)
            free = artefact.section(FREE_ENDS.section("model"))
            self._free = ViewNets(artefact, FREE_ENDS) if free else None
        except KeyError as error:
            raise InputError(f"model: array {error} is missing") from None

    @property
    def knows_free_ends(self) -> bool:
        """Whether there are nets for legs with free ends."""
        return self._free is not None

    def assess(self, legs: Legs, threads: int = 1) -> tuple[_Array, NDArray[np.bool_]]:
        """Return (n,) the probabilities of feasibility and whether the legs are in the domain.

        The answers are the same, bit by bit, for any number of threads.
        """
        n = len(legs)
        probability = np.full(n, UNKNOWN)
        inside = np.zeros(n, dtype=np.bool_)
        known = np.zeros(n, dtype=np.bool_)
        open_ = np.zeros(n, dtype=np.bool_)

        def ask(nets: ViewNets, asked: _Rows) -> None:
            def settle(rows: _Rows) -> None:
                part = _neighbours(rows)
                probability[part], inside[part], known[part], open_[part] = nets.settle(
                    legs.take(part)
                )

            def look(rows: _Rows) -> None:
                probability[rows], near = nets.look(legs.take(rows))
                # By the quick features wherever they exist, as the mass must not decide which.
                inside[rows] = np.where(known[rows], inside[rows], near)

            _in_blocks(settle, asked, _SETTLED_AT_A_TIME, threads)
            _in_blocks(look, asked[open_[asked]], _LOOKED_AT_A_TIME, threads)

        for nets, rows in self._asked(legs):
            ask(nets, rows)
        return probability, inside

    def estimate(self, legs: Legs) -> tuple[_Array, _Array, NDArray[np.bool_]]:
        """Return (n,) log(m* / m0), its expected error, and whether the legs are in the domain.

        NaN where no features exist.
        """
        asked = self._asked(legs)
        if len(asked) == 1:
            return asked[0][0].estimate(legs)
        log_margin, doubt = np.empty(len(legs)), np.empty(len(legs))
        inside = np.empty(len(legs), dtype=np.bool_)
        for nets, rows in asked:
            log_margin[rows], doubt[rows], inside[rows] = nets.estimate(legs.take(rows))
        return log_margin, doubt, inside

    def quick_log_margin(self, legs: Legs) -> _Array:
        """Return (n,) log(m* / m0) by the quick net; NaN without features or out of the domain."""
        asked = self._asked(legs)
        if len(asked) == 1:
            return asked[0][0].quick_log_margin(legs)
        log_margin = np.empty(len(legs))
        for nets, rows in asked:
            log_margin[rows] = nets.quick_log_margin(legs.take(rows))
        return log_margin

    def predict(self, legs: Legs) -> LegPrediction:
        """Return all answers for n legs from one computation of their features."""
        asked = self._asked(legs)
        if len(asked) == 1:
            return asked[0][0].predict(legs)
        parts = [(nets.predict(legs.take(rows)), rows) for nets, rows in asked]
        columns = {}
        for field in fields(LegPrediction):
            values = [(getattr(part, field.name), rows) for part, rows in parts]
            columns[field.name] = np.empty(len(legs), dtype=values[0][0].dtype)
            for value, rows in values:
                columns[field.name][rows] = value
        return LegPrediction(**columns)

    def _asked(self, legs: Legs) -> list[tuple[ViewNets, _Rows]]:
        """Return which nets are asked about which rows; those for free ends only if needed."""
        free = legs.free_ends
        if self._free is None or not free.any():
            return [(self._rendezvous, np.arange(len(legs)))]
        if free.all():
            return [(self._free, np.arange(len(legs)))]
        return [(self._rendezvous, np.flatnonzero(~free)), (self._free, np.flatnonzero(free))]


def _neighbours(rows: _Rows) -> slice | _Rows:
    """Return ascending rows as a slice where none is left out: nothing has to be copied then."""
    first, last = int(rows[0]), int(rows[-1])
    return slice(first, last + 1) if last - first + 1 == len(rows) else rows


def _in_blocks(work: Callable[[_Rows], None], rows: _Rows, size: int, threads: int) -> None:
    """Do the work on blocks of rows; numpy and the kernels let other threads run meanwhile."""
    blocks = [rows[first : first + size] for first in range(0, len(rows), size)]
    if threads == 1 or len(blocks) < 2:
        for block in blocks:
            work(block)
        return
    with ThreadPoolExecutor(min(threads, len(blocks))) as pool:
        for _ in pool.map(work, blocks):
            pass

"""`HardExamples`: of the legs that another sampler draws, those that a model is unsure of."""

import functools
from pathlib import Path
from typing import Any, final

import msgspec
import numpy as np
from numpy.random import Generator

from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.dataset.protocol import Protocol
from feasibility.dataset.samplers.draws import Draw
from feasibility.dataset.samplers.impulsive import ImpulsiveGrid
from feasibility.legs import Spacecraft
from feasibility.orbits import Catalogue

_RELEVANT = 0.6


@final
class HardExamples(
    msgspec.Struct, frozen=True, kw_only=True, tag_field="kind", tag="hard-examples"
):
    """Draws several times as many legs as wanted and keeps the most doubtful ones.

    Doubtful is a leg whose m* the model expects to be wrong by much, relative to its size. Legs
    whose m* is far from every initial mass of the protocol do not count. It
    takes the place of a protocol's sampler, see `harder`, so that the dataset is generated,
    resumed and read as any other.

    Parameters
    ----------
    base : sampler
        What draws.
    model : str
        File of the margin model to ask, or "default".
    factor : int
        How many legs are drawn for one that is kept.
    """

    base: Any
    model: str
    factor: int = 5

    @property
    def m0_kg(self) -> tuple[float, float]:
        """Range of initial masses of the base."""
        low, high = self.base.m0_kg
        return float(low), float(high)

    @property
    def draws_spacecraft(self) -> bool:
        """Whether the base draws its own."""
        return bool(self.base.draws_spacecraft)

    def draw(
        self,
        n: int,
        rng: Generator,
        catalogue: Catalogue,
        spacecraft: Spacecraft | None,
        grid: ImpulsiveGrid,
    ) -> Draw:
        """Draw `n` legs; errors are those of the base and of loading the model."""
        draw: Draw = self.base.draw(n * self.factor, rng, catalogue, spacecraft, grid)
        prediction = _load(self.model).predict(draw.legs)
        m_star = prediction.margin * draw.legs.m0
        with np.errstate(invalid="ignore"):
            relevant = (m_star > draw.m0_min * np.exp(-_RELEVANT)) & (
                m_star < draw.m0_max * np.exp(_RELEVANT)
            )
        doubt = np.where(relevant, np.nan_to_num(prediction.margin_error), 0.0)
        rows = np.sort(np.argsort(-doubt, kind="stable")[:n])
        return Draw(
            draw.legs.take(rows), draw.dt_imp_days[rows], draw.m0_min[rows], draw.m0_max[rows]
        )


def harder(protocol: Protocol, model: Path, factor: int) -> Protocol:
    """Return the protocol with only those legs that the model is most unsure of."""
    sampler = HardExamples(base=protocol.sampler, model=str(model), factor=factor)
    hard: Protocol = msgspec.structs.replace(
        protocol, name=f"{protocol.name}, hard", sampler=sampler
    )
    return hard


@functools.lru_cache(maxsize=1)
def _load(model: str) -> FeasibilityClassifier:
    return FeasibilityClassifier.load(model)

"""`Gtoc2Problem`: GTOC2 as the search sees it."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs, Spacecraft
from feasibility.classifier.predictor import LegPredictor
from feasibility.orbits import Catalogue, earth
from seqsearch.beam.forecast import in_threads
from seqsearch.core.candidates import Candidates
from seqsearch.core.custom_moves import Proposal
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Hops
from seqsearch.core.tree import FlownLeg
from seqsearch.problems.gtoc2.forecast import Gtoc2Forecast
from seqsearch.problems.gtoc2.outlook import Outlook
from seqsearch.problems.gtoc2.rules import Gtoc2Rules
from seqsearch.problems.rendezvous import Problem
from seqsearch.settings import SearchSettings

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Gtoc2Problem:
    base: Problem
    rules: Gtoc2Rules

    @property
    def name(self) -> str:
        return self.base.name

    @property
    def spacecraft(self) -> Spacecraft:
        return self.base.spacecraft

    @property
    def m0(self) -> float:
        return self.base.m0

    @property
    def first_departure_mjd2000(self) -> tuple[float, float]:
        return self.base.first_departure_mjd2000

    @property
    def max_duration_days(self) -> float:
        return self.base.max_duration_days

    @property
    def min_stay_days(self) -> float:
        return self.base.min_stay_days

    @property
    def start_ids(self) -> tuple[int, ...]:
        return (0,)

    @cached_property
    def catalogue(self) -> Catalogue:
        planet, asteroids = earth(), self.base.catalogue
        return Catalogue(
            ids=np.concatenate([planet.ids, asteroids.ids]),
            names=[*planet.names, *asteroids.names],
            epoch_mjd2000=np.concatenate([planet.epoch_mjd2000, asteroids.epoch_mjd2000]),
            elements=np.concatenate([planet.elements, asteroids.elements]),
            source=asteroids.source,
        )

    @cached_property
    def outlook(self) -> Outlook:
        _, group = np.unique(self.base.catalogue.extra[self.rules.group_column], return_inverse=True)
        return Outlook(self.catalogue, np.concatenate([[-1], group]), self.spacecraft, self.min_stay_days)

    def start_rows(self) -> _Rows:
        return np.zeros(1, dtype=np.intp)

    def start_nodes(self, rows: _Rows, t_mjd2000: _Array, /) -> Nodes:
        return Nodes.at_start(rows, t_mjd2000, np.full(len(rows), self.m0))

    def starts(self, settings: SearchSettings, rng: np.random.Generator, /) -> Nodes:
        n = settings.start_epochs
        earliest, latest = self.first_departure_mjd2000
        epochs = earliest + (np.arange(n) + rng.random(n)) / n * (latest - earliest)
        return self.start_nodes(np.zeros(n, dtype=np.intp), epochs)

    def moves(
        self, nodes: Nodes, settings: SearchSettings, predictor: LegPredictor, threads: int, /
    ) -> Iterator[Proposal]:
        left = self.outlook.left(nodes.visited)

        def propose(k: int) -> Proposal | None:
            return self._proposal(nodes, k, int(left[k]), settings, predictor)

        for proposal in in_threads(propose, np.flatnonzero(left).tolist(), threads):
            if proposal is not None:
                yield proposal

    def _proposal(self, nodes, k, left, settings, predictor) -> Proposal | None:
        forecast = Gtoc2Forecast(self, self.outlook, predictor, settings)
        row, t, mass = int(nodes.row[k]), float(nodes.t_ready_mjd2000[k]), float(nodes.mass[k])
        elapsed = t - float(nodes.t_first_mjd2000[k])
        ways = forecast.ways(row, t, mass, elapsed, left)
        if ways is None:
            return None
        ok = (ways.m_final >= self.spacecraft.m_dry) & (elapsed + ways.legs.tof_days <= self.max_duration_days)
        if not ok.any():
            return None
        hops = Hops((ways.legs,), (np.zeros(len(ways.target)),))
        return Proposal(
            Candidates(np.full(len(ways.target), k), ways.target, hops).take(ok), ways.m_final[ok], forecast.questions
        )

    def node_value(self, nodes: Nodes) -> _Array:
        left = self.outlook.left(nodes.visited)
        return self.outlook.value(nodes.row, left, nodes.t_arr_mjd2000 - nodes.t_first_mjd2000, nodes.mass)

    def legs(self, row, t, velocity, target, tof_days, mass) -> Legs:
        n = len(target)
        rows, epochs = np.full(n, row), np.full(n, t)
        rv_dep = self.catalogue.states_at(rows, epochs)
        if velocity is not None:
            rv_dep[:, 3:] += velocity
        return Legs(
            rv_dep=rv_dep, rv_arr=self.catalogue.states_at(target, epochs + tof_days), tof_days=tof_days,
            m0=np.full(n, mass), thrust=self.spacecraft.thrust, isp=self.spacecraft.isp, m_dry=self.spacecraft.m_dry,
            t_dep_mjd2000=epochs, dep_id=self.catalogue.ids[rows], arr_id=self.catalogue.ids[target],
        )

    def hops(self, nodes, parent, target, t_dep_mjd2000, tof_days, /) -> Hops:
        raise NotImplementedError

    def closing(self, row: int, t_mjd2000: float, mass: float, /) -> tuple[FlownLeg, ...]:
        return ()

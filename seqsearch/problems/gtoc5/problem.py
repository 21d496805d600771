"""`Gtoc5Problem`: GTOC5 as the search sees it."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final, final

import msgspec
import numpy as np
from numpy.typing import NDArray

from feasibility import InputError, optimise
from feasibility.classifier.predictor import LegPredictor
from feasibility.orbits import Catalogue
from feasibility.runtime.workers import in_threads
from feasibility.sims_flanagan import solve_max_initial_mass
from seqsearch.core.custom_moves import CustomCandidates, CustomMoves
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.core.recording import tour_body
from seqsearch.core.tree import FlownLeg
from seqsearch.problems.gtoc5.element_distance import phase_free_points
from seqsearch.problems.gtoc5.forecast import FLY_BY_STRETCH, Gtoc5Forecast
from seqsearch.problems.gtoc5.leg_maker import LegMaker
from seqsearch.problems.gtoc5.rules import Gtoc5Rules
from seqsearch.problems.gtoc5.self_fly_by import shortest_self_fly_by_days
from seqsearch.problems.gtoc5.transfer_plans import TransferPlans
from seqsearch.problems.moves.directions import even_directions
from seqsearch.problems.moves.earth_first import earth_first
from seqsearch.problems.moves.freed_launch import freed_launch
from seqsearch.problems.moves.lambert_departure import lambert_departure
from seqsearch.problems.moves.launch_epochs import launch_epochs
from seqsearch.problems.variant import RendezvousVariant
from seqsearch.settings import SearchSettings
from seqsearch.tours.tour import TourRules

_Array = NDArray[np.float64]

_CLOSING_STRETCH: Final = 1.05
"""Time kept for the last self-fly-by, over the closed form's."""

_CLOSING_DIRECTIONS: Final = 12


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Gtoc5Problem(RendezvousVariant):
    """Launch from the Earth, then asteroids, each met at rest and in a fly-by.

    A node is at rest at an asteroid, after the package was left there. The hop
    to the next is a self-fly-by with the penetrator and a transfer; the first
    hop is a launch. Time and propellant for a last self-fly-by are kept in
    reserve, so that every visit scores in full.

    Parameters
    ----------
    base : RendezvousProblem
        Name, spacecraft, masses, window and duration; its catalogue are the
        asteroids. Its stays and starts play no part.
    rules : Gtoc5Rules
        Everything else.

    Raises
    ------
    InputError
        The catalogue has a body with the id of the Earth, 0, or the wet mass
        is below what a single visit needs.
    """

    rules: Gtoc5Rules

    def __post_init__(self) -> None:
        least = self.maker.least_mass_at_rendezvous
        if self.m0 <= least:
            raise InputError(
                f"problem {self.name}: wet mass {self.m0:g} kg, expected more than the "
                f"{least:g} kg of a single visit"
            )

    @property
    def min_stay_days(self) -> float:
        """Zero: the package is left at once."""
        return 0.0

    @property
    def start_ids(self) -> tuple[int, ...]:
        """The id of the Earth."""
        return (0,)

    @cached_property
    def catalogue(self) -> Catalogue:
        """The Earth, row 0, and the asteroids."""
        return earth_first(self.base.catalogue)

    @cached_property
    def maker(self) -> LegMaker:
        """What makes the legs."""
        return LegMaker(self.catalogue, self.spacecraft, self.rules)

    @cached_property
    def _points(self) -> _Array:
        return phase_free_points(self.catalogue)

    @property
    def custom_moves(self) -> CustomMoves:
        """The problem itself: it launches, and shapes its fly-bys before they are proposed."""
        return self

    def start_rows(self) -> NDArray[np.intp]:
        """Return the catalogue row of the Earth."""
        return np.zeros(1, dtype=np.intp)

    def starts(self, settings: SearchSettings, rng: np.random.Generator, /) -> Nodes:
        """Return ``settings.start_epochs`` launches all over the window."""
        n = settings.start_epochs
        epochs = launch_epochs(self.first_departure_mjd2000, n, rng)
        return self.start_nodes(np.zeros(n, dtype=np.intp), epochs)

    def candidates(
        self, nodes: Nodes, settings: SearchSettings, predictor: LegPredictor, threads: int, /
    ) -> Iterator[CustomCandidates]:
        """Propose launches or hops from each node, at several flight times for each target."""

        def propose(k: int) -> CustomCandidates | None:
            return self._from_node(nodes, k, settings, predictor)

        for found in in_threads(propose, range(len(nodes)), threads):
            if found is not None:
                yield found

    def _from_node(
        self, nodes: Nodes, k: int, settings: SearchSettings, predictor: LegPredictor
    ) -> CustomCandidates | None:
        """Return the candidates from one node; None for none."""
        forecast = Gtoc5Forecast(self.maker, self._points, predictor, settings)
        row, t, mass = int(nodes.row[k]), float(nodes.t_ready_mjd2000[k]), float(nodes.mass[k])
        launch = bool(nodes.depth[k] == 0)
        if launch:
            plans = forecast.launches(row, t, mass)
        else:
            plans = forecast.hops(row, t, mass, nodes.visited[k, : nodes.depth[k] + 1])
        if plans is None:
            return None
        parent = np.full(len(plans), k)
        hops = self._chains(nodes, parent, np.full(len(plans), t), plans, launch=launch)
        m_final = predictor.final_mass(hops.legs[-1])
        known = np.isfinite(m_final)
        first = t if launch else float(nodes.t_first_mjd2000[k])
        within = known & self._leaves_room(hops.t_arr_mjd2000 - first, m_final)
        if not within.any():
            return None
        if launch:
            # Plans have Lambert's direction. The solver finds a better one.
            hops = freed_launch(hops, self.catalogue, self.rules.launch_speed_max_m_s)
        return CustomCandidates(
            parent[within],
            plans.target[within],
            hops.take(within),
            m_final[within],
            forecast.questions + len(hops),
        )

    def hops(
        self,
        nodes: Nodes,
        parent: NDArray[np.intp],
        target: NDArray[np.intp],
        t_dep_mjd2000: _Array,
        tof_days: _Array,
        /,
    ) -> Hops:
        """Return the (k,) hops with velocities along Lambert's arcs; see `Problem.hops`.

        A self-fly-by takes a fixed multiple of the closed form's time, at most half of the hop.
        """
        n, rules = len(parent), self.rules
        row, mass = nodes.row[parent], nodes.mass[parent]
        speed = self.maker.fly_by_speed_m_s
        launch = bool((nodes.depth == 0).any())
        shortest = shortest_self_fly_by_days(mass, speed, self.spacecraft.thrust)
        wait = np.zeros(n) if launch else np.minimum(FLY_BY_STRETCH * shortest, 0.5 * tof_days)
        velocity = lambert_departure(
            self.catalogue,
            row,
            t_dep_mjd2000 + wait,
            target,
            tof_days - wait,
            least_m_s=0.0 if launch else speed,
            most_m_s=rules.launch_speed_max_m_s if launch else speed,
        )
        plans = TransferPlans(target, wait, velocity, tof_days - wait)
        return self._chains(nodes, parent, t_dep_mjd2000, plans, launch=launch)

    def closing(self, row: int, t_mjd2000: float, mass: float, /) -> tuple[FlownLeg, ...]:
        """Return the last self-fly-by, in the direction that leaves most mass; none at the Earth.

        None either where no direction can be flown in the time that is kept in reserve.
        """
        if row == 0:
            return ()
        speed = self.maker.fly_by_speed_m_s
        velocity = speed * even_directions(_CLOSING_DIRECTIONS)
        n = len(velocity)
        tof = _CLOSING_STRETCH * float(
            shortest_self_fly_by_days(mass, speed, self.spacecraft.thrust)
        )
        legs = self.maker.self_fly_bys(
            np.full(n, row), np.full(n, t_mjd2000), velocity, np.full(n, tof), np.full(n, mass)
        )
        heaviest = solve_max_initial_mass(legs)
        solved = optimise(legs, guess=heaviest)
        if not solved.converged.any():
            return ()
        best = int(np.where(solved.converged, solved.m_final, -np.inf).argmax())
        return (
            FlownLeg(
                dep_row=row,
                arr_row=row,
                rv_dep=legs.rv_dep[best],
                rv_arr=legs.rv_arr[best],
                t_dep_mjd2000=t_mjd2000,
                tof_days=tof,
                m0=float(solved.m0[best]),
                m_final=float(solved.m_final[best]),
                m_star=float(heaviest.m0[best]),
                dropped=self.rules.penetrator_kg,
                throttles=solved.throttles[best],
                mismatch=float(solved.mismatch[best]),
            ),
        )

    def tour_rules(self) -> TourRules:
        """Return the numbers of the problem, with launch, fly-bys, drops and points."""
        return msgspec.structs.replace(
            self.base.tour_rules(),
            min_stay_days=self.min_stay_days,
            start_ids=self.start_ids,
            events=self.rules.events(tour_body(self.catalogue, 0)),
            start_counts=False,
            score=self.rules.points(),
        )

    def _chains(
        self,
        nodes: Nodes,
        parent: NDArray[np.intp],
        t_dep_mjd2000: _Array,
        plans: TransferPlans,
        *,
        launch: bool,
    ) -> Hops:
        """Return the legs of hops from nodes: a launch, or a self-fly-by and a transfer."""
        n, make, rules = len(plans), self.maker, self.rules
        row, mass = nodes.row[parent], nodes.mass[parent]
        package = np.full(n, rules.package_kg)
        left = mass if launch else make.mass_after_fly_by(mass, FLY_BY_STRETCH)
        transfers = make.transfers(
            row,
            t_dep_mjd2000 + plans.fly_by_days,
            plans.velocity,
            plans.target,
            plans.tof_days,
            left,
        )
        if launch:
            return Hops((transfers,), (package,))
        fly_bys = make.self_fly_bys(row, t_dep_mjd2000, plans.velocity, plans.fly_by_days, mass)
        return Hops((fly_bys, transfers), (np.full(n, rules.penetrator_kg), package))

    def _leaves_room(self, elapsed_days: _Array, m_final: _Array) -> NDArray[np.bool_]:
        """Return (n,) whether time and mass suffice for one more self-fly-by."""
        rest = m_final - self.rules.package_kg
        closing = _CLOSING_STRETCH * shortest_self_fly_by_days(
            rest, self.maker.fly_by_speed_m_s, self.spacecraft.thrust
        )
        enough = m_final >= self.maker.least_mass_at_rendezvous
        result: NDArray[np.bool_] = enough & (elapsed_days + closing <= self.max_duration_days)
        return result

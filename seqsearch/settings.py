"""`SearchSettings`: how the search goes about it; the ``[search]`` table of a problem file."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, final

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from feasibility import InputError

_Positive = Annotated[float, Meta(gt=0)]
_Count = Annotated[int, Meta(ge=1)]


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A TOML table in which every key is known."""


@final
class FrontierSettings(_Table, frozen=True, kw_only=True):
    """Which nodes compete with each other, and how many alike are kept.

    Parameters
    ----------
    kind : str
        Nodes compete with those of equal ``"depth"``, or of equal elapsed time: ``"time"``.
    max_per_parent : int
        Most children of one node that are kept.
    max_per_cell : int
        Most nodes kept at one rank at one asteroid within the same `cell_days`.
    cell_days : float
        Width of the epoch cells of `max_per_cell`.
    max_start_share : float
        Most nodes kept at one rank that started at the same body, as a share of the beam
        width; 1 for no limit.
    slice_days : float
        Width of the slices of elapsed time, for the kind ``"time"``.
    nominal_visits : int
        Visits of a good tour, by which the kind ``"time"`` values one more.
    """

    kind: Literal["depth", "time"] = "depth"
    max_per_parent: _Count = 10
    max_per_cell: _Count = 3
    cell_days: _Positive = 20.0
    max_start_share: Annotated[float, Meta(gt=0, le=1)] = 0.1
    slice_days: _Positive = 40.0
    nominal_visits: _Count = 14


@final
class ScoutSettings(_Table, frozen=True, kw_only=True):
    """Beams of predicted legs that look for itineraries before a pass.

    They need a predictor, and ``ranking`` ``"weighted"`` or ``"balanced"`` with the frontier
    ``"depth"``. Their own ranking is ``"balanced"``.

    Parameters
    ----------
    generations : int
        Where there is no time limit, how often four scouts are sent out before each pass,
        which then keeps to the best itineraries that they found; 0 for no scouts.
    share : float
        Under a time limit, the share of each pass that is spent on scouting.
    width : int
        Beam width of a scout.
    """

    generations: Annotated[int, Meta(ge=0)] = 0
    share: Annotated[float, Meta(ge=0, lt=1)] = 0.75
    width: _Count = 300


@final
class AuditSettings(_Table, frozen=True, kw_only=True):
    """How much is spent on learning what pruning costs.

    Parameters
    ----------
    per_rank : int
        Pruned candidates of each rank that are optimised all the same, and half as many
        kept ones; 0 for no audit.
    """

    per_rank: Annotated[int, Meta(ge=0)] = 100


@final
class SearchSettings(_Table, frozen=True, kw_only=True):
    """Settings of the beam search, all with defaults.

    Parameters
    ----------
    beam_width : int
        Nodes kept at each rank, where there is no time limit.
    max_beam_width : int
        Most nodes kept at one rank under a time limit, where passes are as wide as the
        time allows.
    passes : int
        Beams run one after another, each with starts of its own.
    starts : int
        Start nodes of a pass: the asteroid-epoch pairs with the densest neighbourhoods.
    start_epochs : int
        Departure epochs at which neighbourhoods are looked at, spread over the window.
    screen_legs : int
        Legs that a predictor is asked about to find good starts; under a time limit about
        one second in twenty is spent on it, if that is more.
    neighbours : int
        Targets proposed for each node: the nearest in the orbital metric.
    reference_tof_days : float
        Transfer time in the orbital metric.
    tof_days_min, tof_days_max, tof_days_step : float
        Grid of flight times.
    coarse_flight_times : int
        Flight times at which a predictor is asked to find a target's shortest one.
    flight_time_stretches : tuple of float
        Flight times proposed for each target, in units of the shortest that a predictor
        thinks flyable; longer ones save propellant.
    margin_reserve : float
        By how much predicted margins of proposed hops exceed 1.
    departure_delays_days : tuple of float
        Waits beyond the shortest stay that are tried.
    pruner : str
        Pruners with an optional parameter, asked in turn: ``"default:0.99"``, the classifier
        that comes with the package at this recall, or others, such as
        ``"lambert:1.3,mima2:0.97"``; ``"none"`` keeps all.
    solver : str
        Leg solver for the full optimisation: ``"fast"``, ``"reference"``, ``"best"`` (the better
        of both) or ``"auto"`` (the reference where the fast one has no solution or may be wrong).
    solves_per_rank : int
        Most hops that are optimised at one rank, the most promising first.
    flyable_per_target : int
        Flight times wanted for each node and target, shortest first.
    time_weight, propellant_weight : float
        Weights of the used shares of time and propellant in the ranking.
    ranking : str
        Which nodes are better: ``"weighted"`` time and propellant, ``"balanced"``, where what
        is scarcer counts more, ``"pareto"`` fronts of both, or ``"potential"``, weighted with a
        penalty where few targets can be reached (needs a classifier).
    potential_weight : float
        Penalty of a node from which no target can be reached, for the ranking ``"potential"``.
    frontier : FrontierSettings
        The table ``[search.frontier]``.
    scouts : ScoutSettings
        The table ``[search.scouts]``.
    audit : AuditSettings
        The table ``[search.audit]``.
    """

    beam_width: _Count = 200
    max_beam_width: _Count = 6000
    passes: _Count = 1
    starts: _Count = 300
    start_epochs: _Count = 40
    screen_legs: _Count = 150_000
    neighbours: _Count = 60
    reference_tof_days: _Positive = 180.0
    tof_days_min: _Positive = 60.0
    tof_days_max: _Positive = 300.0
    tof_days_step: _Positive = 15.0
    coarse_flight_times: Annotated[int, Meta(ge=4)] = 9
    flight_time_stretches: tuple[Annotated[float, Meta(ge=1)], ...] = (1.0, 1.06, 1.14, 1.25, 1.4)
    margin_reserve: Annotated[float, Meta(ge=0)] = 0.002
    departure_delays_days: tuple[Annotated[float, Meta(ge=0)], ...] = (0.0,)
    pruner: str = "default:0.99"
    solver: Literal["fast", "reference", "best", "auto"] = "fast"
    solves_per_rank: _Count = 8000
    flyable_per_target: _Count = 2
    time_weight: Annotated[float, Meta(ge=0)] = 1.0
    propellant_weight: Annotated[float, Meta(ge=0)] = 0.6
    ranking: Literal["weighted", "balanced", "pareto", "potential"] = "weighted"
    potential_weight: Annotated[float, Meta(ge=0)] = 0.1
    frontier: FrontierSettings = msgspec.field(default_factory=FrontierSettings)
    scouts: ScoutSettings = msgspec.field(default_factory=ScoutSettings)
    audit: AuditSettings = msgspec.field(default_factory=AuditSettings)

    def __post_init__(self) -> None:
        if self.tof_days_max < self.tof_days_min:
            raise ValueError(
                f"tof_days_max = {self.tof_days_max:g} is below "
                f"tof_days_min = {self.tof_days_min:g}"
            )
        if not self.departure_delays_days:
            raise ValueError("departure_delays_days is empty, expected at least one delay")
        if self.time_weight + self.propellant_weight <= 0:
            raise ValueError("time_weight and propellant_weight are both zero")
        if self.frontier.kind == "time" and self.ranking == "pareto":
            raise ValueError(
                'a frontier of kind "time" cannot weigh a visit more in ranking = "pareto", '
                'expected "weighted" or "potential"'
            )

    def with_(self, **changes: object) -> "SearchSettings":
        """Return the settings with some values replaced, validated.

        Values of tables are given as dictionaries, of which the other keys stay:
        ``settings.with_(beam_width=40, frontier={"max_per_cell": 1})``.

        Raises
        ------
        InputError
            An unknown name or a value out of range.
        """
        try:
            merged = _merged(msgspec.to_builtins(self), changes)
            return msgspec.convert(merged, type=SearchSettings)
        except msgspec.ValidationError as error:
            raise InputError(f"search settings: {error}") from None

    def tof_days(self) -> NDArray[np.float64]:
        """Return the grid of flight times in days, both ends included."""
        steps = round((self.tof_days_max - self.tof_days_min) / self.tof_days_step)
        if steps > 10_000:
            raise InputError(f"search: {steps} flight times per target, expected at most 10000")
        return self.tof_days_min + self.tof_days_step * np.arange(steps + 1, dtype=np.float64)


def _merged(values: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with changes, those of nested tables key by key."""
    return values | {
        key: _merged(values[key], change) if isinstance(change, Mapping) else change
        for key, change in changes.items()
    }

"""`ChartedHoming`: beams over a `LegChart` that start at one orbit and end at another."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from seqsearch.carriers.chart_kernels import choose, expand
from seqsearch.carriers.homing import Homecoming
from seqsearch.carriers.leg_chart import STEP_DAYS, TOF_DAYS, LegChart
from seqsearch.polish.itinerary import Itinerary
from seqsearch.problems.rendezvous import RendezvousProblem

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]

_STRETCHES: Final = np.log([1.0, 1.03, 1.07, 1.12, 1.18, 1.25, 1.4])
_CELL_DAYS: Final = 20.0
_PER_PARENT: Final = 10
_PER_CELL: Final = 3
_DISTANCE: Final = 5000.0
_FARTHEST: Final = 3.0
_HOMEWARD_SHARE: Final = 0.5
_MOST_CHILDREN: Final = 24 * 7
_RESERVE: Final = 0.005


@final
@dataclass(frozen=True, eq=False)
class Ways:
    """Legs to one body, as `ChartMaker.home` returns them."""

    end: int
    first: int
    index: NDArray[np.int32]
    log_m_star: NDArray[np.float32]
    delta_v: NDArray[np.float32]
    log_tof: NDArray[np.float64]


NO_WAYS: Final = Ways(
    -1,
    0,
    np.zeros((0, 1), np.int32),
    np.zeros((1, 2, 2), np.float32),
    np.zeros((1, 2, 2), np.float32),
    np.zeros(2),
)


@final
class ChartedHoming:
    """Runs beams over a chart."""

    def __init__(self, chart: LegChart, problem: RendezvousProblem, overtime_days: float) -> None:
        self.chart = chart
        craft = problem.spacecraft
        self._limits = np.array(
            [
                problem.max_duration_days + overtime_days,
                problem.min_stay_days,
                240.0,
                craft.m_dry,
                problem.m0,
                craft.thrust,
                craft.exhaust_velocity,
                _RESERVE,
                _HOMEWARD_SHARE,
            ]
        )
        keys = np.random.default_rng(0).integers(1, 2**63, len(chart.rows), dtype=np.int64)
        self._keys = keys.astype(np.uint64)

    def run(
        self,
        start: int,
        epochs_mjd2000: _Array,
        ways: Ways,
        closed: NDArray[np.bool_],
        *,
        width: int,
        propellant_weight: float,
        distance_weight: float,
        results: int,
    ) -> list[Homecoming]:
        chart, limits = self.chart, self._limits
        n_starts = len(epochs_mjd2000)
        row = np.full(n_starts, start, dtype=np.int32)
        ready, first = epochs_mjd2000.copy(), epochs_mjd2000.copy()
        mass = np.full(n_starts, limits[4])
        begun = np.arange(n_starts, dtype=np.int32)
        visited = row[:, None].copy()
        sets = np.zeros(n_starts, dtype=np.uint64)
        log_tof = np.log(TOF_DAYS)
        home = ways.end >= 0
        if home:
            k0 = int((epochs_mjd2000[0] + limits[0] - chart.t0_mjd2000) // STEP_DAYS)
            k1 = int((epochs_mjd2000[-1] + limits[0] - chart.t0_mjd2000) // STEP_DAYS) + 2
            k1 = min(k1, len(chart.points))
            k0 = min(k0, k1 - 1)
            points = chart.points[k0:k1]
            distance = np.sqrt(((points - points[:, ways.end][:, None]) ** 2).sum(axis=2))
            distance = np.minimum(distance / _DISTANCE, _FARTHEST)
        else:
            k0 = 0
            distance = np.zeros((1, len(chart.rows)), np.float32)
        ranks: list[tuple[_Index, _Array, _Index, _Array]] = []
        rows0 = row
        found: list[Homecoming] = []
        depth = 0
        parents: list[NDArray[np.int64]] = []
        history_row, history_arr, history_ready = [row], [ready], [ready]
        weights = np.array([propellant_weight, distance_weight if home else 0.0])
        caps = np.array(
            [width, _PER_PARENT, _PER_CELL, max(1, int(np.ceil(width * max(0.1, 2.0 / n_starts))))]
        )
        log_home = ways.log_tof
        while True:
            room = len(row) * _MOST_CHILDREN
            out_row, out_parent = np.empty(room, np.int32), np.empty(room, np.int32)
            out_arr, out_mass, out_score, out_home = (np.empty(room) for _ in range(4))
            count = expand(
                row, ready, first, mass, visited, depth, closed,
                chart.offsets, chart.target, chart.log_m_star, chart.delta_v, log_tof,
                chart.t0_mjd2000, STEP_DAYS, chart.intervals,
                ways.first, ways.index, ways.log_m_star, ways.delta_v, log_home,
                distance, k0, _STRETCHES, limits, weights,
                out_row, out_parent, out_arr, out_mass, out_score, out_home,
            )
            if count == 0:
                break
            score = out_score[:count]
            order = np.argsort(score, kind="stable")
            taken = np.empty(width, dtype=np.int64)
            kept = choose(
                order, out_row[:count], out_parent[:count], out_arr[:count], sets, self._keys,
                begun, caps, len(chart.rows), _CELL_DAYS, taken,
            )
            # those that are best at home are results, whether or not they go on
            if home:
                total = out_home[:count]
                best = np.argsort(total, kind="stable")[: 50]
                seen = set()
                got = 0
                for c in best:
                    if total[c] > limits[0] or got == results:
                        break
                    kind = ((int(sets[out_parent[c]]) + int(self._keys[out_row[c]])) % 2**64, int(out_row[c]))
                    if kind in seen:
                        continue
                    seen.add(kind)
                    got += 1
                    found.append(
                        self._traced(
                            history_row, history_arr, history_ready, parents, int(out_parent[c]),
                            int(out_row[c]), float(out_arr[c]), ways.end,
                            float(total[c]), first,
                        )
                    )
            taken = taken[:kept]
            parent = out_parent[taken]
            parents.append(parent.astype(np.int64))
            row = out_row[taken]
            arrival = out_arr[taken]
            first = first[parent]
            mass = out_mass[taken]
            begun = begun[parent]
            sets = sets[parent] + self._keys[row]
            visited = np.column_stack([visited[parent], row]).astype(np.int32)
            ready = arrival + limits[1]
            depth += 1
            history_row.append(row)
            history_arr.append(arrival)
            history_ready.append(ready)
        self.deepest = depth, (history_arr[-1] - first).min() if depth else 0.0
        return sorted(found, key=lambda tour: (-tour.visits, tour.duration_days))

    def _traced(self, rows, arrivals, readies, parents, at, last_row, last_arr, end, total, first):
        depth = len(rows) - 1
        first_epoch = float(first[at])
        ids = [end, last_row]
        ready = last_arr + self._limits[1]
        deps = [ready]
        tofs = [first_epoch + total - ready]
        arr = last_arr
        for d in range(depth, -1, -1):
            dep = float(readies[d][at])
            deps.append(dep)
            tofs.append(arr - dep)
            ids.append(int(rows[d][at]))
            arr = float(arrivals[d][at])
            if d:
                at = int(parents[d - 1][at])
        itinerary = Itinerary(
            self.chart.rows[np.array(ids[::-1])], np.array(deps[::-1]), np.array(tofs[::-1])
        )
        return Homecoming(itinerary, depth + 1, total)

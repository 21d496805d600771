"""Drawings of a carrier and its craft as SVG: the map of all paths, and times."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, MJD2000_MJD, MU_SUN
from seqsearch.report.sections import text
from seqsearch.tours.carrier.path import coasted
from seqsearch.tours.carrier.reading import CarrierFiles
from seqsearch.tours.dates import date_of, mjd_of
from seqsearch.tours.trajectory import Phase

_Array = NDArray[np.float64]

COLOURS: Final = ("blue", "orange", "green", "red", "purple")
"""Classes of the style sheet, one for each craft in turn."""

_SIZE: Final = 640
_STEP_DAYS: Final = 6.0
_POINTS_A_PHASE: Final = 60
_ROW: Final = 34
_LEFT: Final = 70
_WIDTH: Final = 900


def carrier_map(files: CarrierFiles) -> str:
    """Return the paths of the carrier and its craft in the ecliptic, as one SVG."""
    carrier = [
        coasted(
            np.repeat(
                before.state[None], len(days := _days(after.t_mjd2000 - before.t_mjd2000)), 0
            ),
            days,
            MU_SUN,
        )
        for before, after in pairwise(files.log)
    ]
    paths = [state[:, :2] for state in carrier]
    crafts = {
        number: [_thinned(phase) for phase in phases] for number, phases in files.craft.items()
    }
    everything = [*paths, *(line for lines in crafts.values() for line in lines)]
    reach = max((float(np.abs(line).max()) for line in everything), default=AU) * 1.06
    scale = _SIZE / (2.0 * reach)
    parts = [_rings(reach, scale)]
    parts += [_line(line, scale, "quiet", dashed=True) for line in paths]
    for colour, lines in zip(_colours(crafts), crafts.values(), strict=True):
        parts += [_line(line, scale, colour) for line in lines]
        parts += [
            _line(np.stack([before[-1], after[0]]), scale, colour)
            for before, after in pairwise(lines)
        ]
    parts += [_mark(row.state[:2], scale, f"{row}, {date_of(row.t_mjd2000)}") for row in files.log]
    half = _SIZE // 2
    return (
        f'<div class="drawing"><svg viewBox="{-half} {-half} {_SIZE} {_SIZE}" role="img" '
        'aria-label="The paths of the carrier and its craft in the ecliptic">'
        + "".join(parts)
        + "</svg></div>"
    )


def key(files: CarrierFiles) -> str:
    """Return what the colours stand for."""
    lines = [("quiet", "the carrier")]
    lines += [
        (colour, f"P{craft}")
        for colour, craft in zip(_colours(files.craft), files.craft, strict=True)
    ]
    items = "".join(
        f'<li><svg viewBox="0 0 26 12"><path class="trace {colour}" d="M0 6H26"/></svg>'
        f"{text(name)}</li>"
        for colour, name in lines
    )
    return f'<ul class="key">{items}</ul>'


def timeline(files: CarrierFiles) -> str:
    """Return when the carrier's events are, and when each craft flies and stays, as one SVG."""
    begin = files.log[0].t_mjd2000
    ends = [files.log[-1].t_mjd2000]
    ends += [float(phases[-1].t_mjd2000[-1]) for phases in files.craft.values()]
    scale = (_WIDTH - _LEFT - 10) / max(max(ends) - begin, 1.0)

    def at(t: float) -> str:
        return f"{_LEFT + (t - begin) * scale:.1f}"

    parts = [_years(begin, max(ends), scale, len(files.craft))]
    parts.append(f'<text class="name" x="0" y="{_ROW // 2 + 4}">carrier</text>')
    for row in files.log:
        label = text(f"{row}, {date_of(row.t_mjd2000)}")
        parts.append(
            f'<path class="trace red" d="M{at(row.t_mjd2000)} 6V{_ROW - 8}">'
            f"<title>{label}</title></path>"
        )
    for k, (number, phases) in enumerate(files.craft.items(), 1):
        top = k * _ROW
        parts.append(f'<text class="name" x="0" y="{top + _ROW // 2 + 4}">P{number}</text>')
        for phase in phases:
            first, last = float(phase.t_mjd2000[0]), float(phase.t_mjd2000[-1])
            label = text(f"{phase.start} to {phase.end}, {last - first:.1f} days")
            parts.append(_bar("flight", at(first), (last - first) * scale, top, label))
        for before, after in pairwise(phases):
            first, last = float(before.t_mjd2000[-1]), float(after.t_mjd2000[0])
            label = text(f"at {before.end}, {last - first:.1f} days")
            parts.append(_bar("stay", at(first), (last - first) * scale, top, label))
    height = (len(files.craft) + 1) * _ROW + 20
    return (
        f'<div class="drawing"><svg viewBox="0 0 {_WIDTH} {height}" role="img" '
        'aria-label="Events, flights and stays over time">' + "".join(parts) + "</svg></div>"
    )


def _days(span: float) -> _Array:
    return np.linspace(0.0, span, 2 + int(span / _STEP_DAYS))


def _thinned(phase: Phase) -> _Array:
    every = np.linspace(0, len(phase) - 1, min(len(phase), _POINTS_A_PHASE)).astype(np.intp)
    points: _Array = phase.states[every, :2]
    return points


def _colours(crafts: Iterable[int]) -> list[str]:
    return [COLOURS[k % len(COLOURS)] for k, _ in enumerate(crafts)]


def _line(points: _Array, scale: float, colour: str, *, dashed: bool = False) -> str:
    # The y axis of SVG points down.
    pixels = " ".join(f"{x * scale:.1f},{-y * scale:.1f}" for x, y in points.tolist())
    dashes = ' stroke-dasharray="4 3"' if dashed else ""
    return f'<polyline class="trace {colour}" points="{pixels}"{dashes}/>'


def _mark(point: _Array, scale: float, label: str) -> str:
    x, y = (point * scale).tolist()
    return (
        f'<circle class="trace red" cx="{x:.1f}" cy="{-y:.1f}" r="3.5">'
        f"<title>{text(label)}</title></circle>"
    )


def _rings(reach: float, scale: float) -> str:
    """Return the Sun and circles one astronomical unit apart."""
    rings = ['<circle class="stay" cx="0" cy="0" r="4"/>']
    for au in range(1, int(reach / AU) + 1):
        radius = au * AU * scale
        rings.append(f'<circle class="grid" cx="0" cy="0" r="{radius:.1f}" fill="none"/>')
        rings.append(f'<text x="3" y="{-radius - 2:.1f}">{au} AU</text>')
    return "".join(rings)


def _bar(kind: str, left: str, width: float, top: int, label: str) -> str:
    return (
        f'<rect class="{kind}" x="{left}" y="{top + 6}" width="{max(width, 0.3):.1f}" '
        f'height="{_ROW - 14}"><title>{label}</title></rect>'
    )


def _years(begin: float, end: float, scale: float, rows: int) -> str:
    lines: Sequence[str] = [
        f'<path class="grid" d="M{x:.1f} 0V{(rows + 1) * _ROW}"/>'
        f'<text x="{x + 2:.1f}" y="{(rows + 1) * _ROW + 14}">{year}</text>'
        for year, x in _new_years(begin, end, scale)
    ]
    return "".join(lines)


def _new_years(begin: float, end: float, scale: float) -> list[tuple[int, float]]:
    first = int(date_of(begin)[:4]) + 1
    last = int(date_of(end)[:4])
    days = {year: _new_year(year) for year in range(first, last + 1)}
    return [(year, _LEFT + (day - begin) * scale) for year, day in days.items()]


def _new_year(year: int) -> float:
    return mjd_of(f"{year}-01-01", "year") - MJD2000_MJD

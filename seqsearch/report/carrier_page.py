"""`write_carrier_report`: a carrier with its craft as one HTML page, without any script."""

from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from feasibility.constants import MJD2000_MJD, MU_SUN
from feasibility.runtime.atomic import write_text
from seqsearch.report.carrier_drawings import carrier_map, key, timeline
from seqsearch.report.page import scriptless_page, section
from seqsearch.report.sections import table, text
from seqsearch.runs.carriers import carrier_flight
from seqsearch.tours.carrier.path import coasted
from seqsearch.tours.carrier.reading import CAPTURE, IMPULSE, CarrierFiles
from seqsearch.tours.carrier.verify_craft import CARRIER
from seqsearch.tours.dates import date_of
from seqsearch.tours.trajectory import Phase

_TITLE: Final = "A carrier and its craft"


def write_carrier_report(folder: Path, out: Path) -> int:
    """Write a carrier with its craft as one HTML page and return its size in bytes.

    Parameters
    ----------
    folder : Path
        With the files to hand in, or the folder of a run.
    out : Path
        The page; replaced if it is there.

    Raises
    ------
    InputError
        A file is missing or damaged, or the page cannot be written.
    """
    page = render(carrier_flight(folder))
    write_text(out, page)
    return len(page.encode())


def render(files: CarrierFiles) -> str:
    """Return the page."""
    facts = "".join(f"<li>{text(fact)}</li>" for fact in _facts(files))
    head = f'<h1>{_TITLE}</h1><ul class="facts">{facts}</ul>'
    body = [
        section("Paths", carrier_map(files) + key(files)),
        section("Times", timeline(files)),
        section("Events of the carrier", _events(files)),
    ]
    body += [
        section(f"P{number}", _chain(phases) + _legs(phases))
        for number, phases in files.craft.items()
    ]
    return scriptless_page(_TITLE, head, body)


def _facts(files: CarrierFiles) -> list[str]:
    log = files.log
    caught = {row.craft for row in log if row.kind == CAPTURE}
    visits = {
        name
        for number, phases in files.craft.items()
        if number in caught
        for name in _visits(phases)
    }
    kept = sum(float(files.craft[number][-1].mass_kg[-1]) for number in caught)
    days = log[-1].t_mjd2000 - log[0].t_mjd2000
    return [
        f"{len(visits)} asteroids by {len(files.craft)} craft, {len(caught)} of which came back "
        f"with {kept:.3f} kg together",
        f"{date_of(log[0].t_mjd2000)} to {date_of(log[-1].t_mjd2000)}, {days:.2f} days",
        f"{sum(row.kind == IMPULSE for row in log)} impulses, {sum(_impulses(files)):.1f} m/s",
        "as the files say; seqsearch verify checks them",
    ]


def _visits(phases: tuple[Phase, ...]) -> list[str]:
    names = [phases[0].start, *(phase.end for phase in phases)]
    return [name for name in names if name != CARRIER]


def _impulses(files: CarrierFiles) -> list[float]:
    """Return the size of the jump of velocity at each event but the first, m/s."""
    return [
        float(np.linalg.norm(after.state[3:] - arrived[0, 3:])) if after.kind == IMPULSE else 0.0
        for before, after in pairwise(files.log)
        for arrived in [
            coasted(before.state[None], np.array([after.t_mjd2000 - before.t_mjd2000]), MU_SUN)
        ]
    ]


def _events(files: CarrierFiles) -> str:
    head = ("event", "date", "MJD", "days", "impulse, m/s", "mass after, kg")
    begin = files.log[0].t_mjd2000
    rows = [
        (
            row,
            date_of(row.t_mjd2000),
            f"{row.t_mjd2000 + MJD2000_MJD:.4f}",
            f"{row.t_mjd2000 - begin:.2f}",
            f"{size:.2f}" if row.kind == IMPULSE else "",
            f"{row.mass_kg:.3f}",
        )
        for row, size in zip(files.log, [0.0, *_impulses(files)], strict=True)
    ]
    return table(head, rows, words=1)


def _chain(phases: tuple[Phase, ...]) -> str:
    names = [phases[0].start, *(phase.end for phase in phases)]
    return f'<pre class="line" tabindex="0">{text(" -> ".join(names))}</pre>'


def _legs(phases: tuple[Phase, ...]) -> str:
    head = (
        "leg", "from", "to", "departure", "MJD", "arrival", "days", "stay after, days", "m0, kg",
        "mf, kg", "duty, %",
    )  # fmt: skip
    stays = [
        f"{float(after.t_mjd2000[0] - before.t_mjd2000[-1]):.2f}"
        for before, after in pairwise(phases)
    ]
    rows = [
        (
            number,
            phase.start,
            phase.end,
            date_of(float(phase.t_mjd2000[0])),
            f"{float(phase.t_mjd2000[0]) + MJD2000_MJD:.2f}",
            date_of(float(phase.t_mjd2000[-1])),
            f"{float(phase.t_mjd2000[-1] - phase.t_mjd2000[0]):.2f}",
            stay,
            f"{float(phase.mass_kg[0]):.2f}",
            f"{float(phase.mass_kg[-1]):.2f}",
            f"{100.0 * _duty(phase):.0f}",
        )
        for number, (phase, stay) in enumerate(zip(phases, [*stays, ""], strict=True), 1)
    ]
    return table(head, rows, words=3)


def _duty(phase: Phase) -> float:
    """Return the mean thrust as a share of the largest of the leg."""
    size = np.linalg.norm(phase.thrust_n, axis=1)
    span = np.diff(phase.t_mjd2000)
    most = float(size.max()) * float(span.sum())
    return float(size[:-1] @ span) / most if most > 0.0 else 0.0

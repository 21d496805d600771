"""The parts of the page that are text and tables: they are there without any script."""

import html
import json
from collections.abc import Iterable, Sequence
from typing import Any, Final

from feasibility.constants import MJD2000_MJD
from seqsearch.report.material import Material
from seqsearch.tours.dates import date_of
from seqsearch.tours.pictures.stops import stops
from seqsearch.tours.tour import Tour

_LONGEST: Final = 60_000
"""Characters of a configuration or a record that are shown; more is a mistake or a prank."""


def text(value: object) -> str:
    """Return a value as HTML text: whatever it holds, it is shown and never obeyed."""
    return html.escape(str(value))


def table(head: Sequence[str], rows: Iterable[Sequence[object]], *, words: int = 0) -> str:
    """Return a table that scrolls in itself; all columns but the first `words` are numbers."""
    cells = "".join(
        f'<th scope="col"{_kind(k, words)}>{text(name)}</th>' for k, name in enumerate(head)
    )
    body = "".join(
        "<tr>"
        + "".join(f"<td{_kind(k, words)}>{text(c)}</td>" for k, c in enumerate(row))
        + "</tr>"
        for row in rows
    )
    return (
        '<div class="scroll" tabindex="0"><table>'
        f"<thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _kind(column: int, words: int) -> str:
    return ' class="word"' if column < words else ""


def headline(material: Material) -> str:
    """Return the title and what was found in a line."""
    tour = material.tour
    if material.flight is None:
        model = "no leg yet"
    elif material.flight.trajectory.continuous:
        model = "refined to continuous thrust"
    else:
        model = "impulses (Sims-Flanagan), not refined"
    found = tour.summary() if tour.bodies else "nothing found yet"
    facts = [found, model, f"table {tour.rules.catalogue}"]
    if tour.legs:
        first, last = tour.legs[0].t_dep_mjd2000, tour.legs[-1].t_arr_mjd2000
        facts.insert(1, f"{date_of(first)} to {date_of(last)}")
    if material.note:
        facts.append(f"the rows beside it are not shown: {material.note}")
    items = "".join(f"<li>{text(fact)}</li>" for fact in facts)
    return f'<h1>{text(tour.rules.name)}</h1><ul class="facts">{items}</ul>'


def sequence(tour: Tour) -> str:
    """Return the sequence on one line, to copy."""
    return (
        f'<pre id="sequence" class="line" tabindex="0">{text(tour.one_line())}</pre>'
        '<button type="button" id="copy" hidden>Copy</button> '
        '<span id="copied" role="status"></span>'
    )


def legs(tour: Tour) -> str:
    """Return the table of legs: the numbers of `Tour.table`, and stays."""
    head = (
        "leg", "from", "to", "name", "departure", "MJD", "arrival", "days", "stay after, days",
        "m0, kg", "mf, kg", "margin", "",
    )  # fmt: skip
    rows = [
        (
            stop.number,
            leg.from_id,
            leg.to_id,
            stop.body.name,
            date_of(leg.t_dep_mjd2000),
            f"{leg.t_dep_mjd2000 + MJD2000_MJD:.2f}",
            date_of(leg.t_arr_mjd2000),
            f"{leg.tof_days:.2f}",
            "" if stop.stay_days is None or stop.fly_by else f"{stop.stay_days:.2f}",
            f"{leg.m0_kg:.2f}",
            f"{leg.m_final_kg:.2f}",
            f"{leg.margin:.3f}",
            "fly-by" if stop.fly_by else "",
        )
        for leg, stop in zip(tour.legs, stops(tour)[1:], strict=True)
    ]
    return table(head, rows, words=4) if rows else "<p>There is no leg yet.</p>"


def ranks(material: Material) -> str:
    """Return the counts of all passes together as a table, one row a rank."""
    by_rank: dict[int, list[int]] = {}
    for line in material.ranks:
        sums = by_rank.setdefault(line.rank, [0] * 5)
        counts = (line.proposed, line.pruned, line.optimised, line.feasible, line.kept)
        for k, count in enumerate(counts):
            sums[k] += count
    head = ("rank", "proposed", "pruned", "optimised", "flyable", "kept")
    return table(head, [(rank, *sums) for rank, sums in sorted(by_rank.items())])


def audit(material: Material) -> str:
    """Return what the audit says, in a sentence and a table of its strata."""
    estimate = _dict(material.audit.get("estimate"))
    if not estimate.get("solved_pruned"):
        return "<p>No pruned leg was tried in this run.</p>"
    share, low, high = _percent(estimate)
    found = (
        f"{share} % of the flyable legs were pruned (95 % interval {low} to {high} %)"
        if share
        else "No flyable leg was seen"
    )
    sentence = (
        f"{found}. {estimate.get('solved_pruned')} pruned and {estimate.get('solved_kept')} kept "
        f"legs were optimised to learn it; {estimate.get('found')} of the pruned ones can be "
        f"flown, {estimate.get('contenders_found')} of them would have gone on in the beam."
    )
    return f"<p>{text(sentence)}</p>" + _strata(material.audit.get("ranks"))


def _percent(estimate: dict[str, Any]) -> tuple[str, str, str]:
    interval = estimate.get("interval")
    limits = interval if isinstance(interval, list) and len(interval) == 2 else [None, None]
    share, low, high = (
        f"{100 * value:.2f}" if isinstance(value, int | float) else ""
        for value in (estimate.get("false_prune_rate"), *limits)
    )
    return share, low, high


def _strata(records: Any) -> str:
    sums: dict[tuple[str, str], list[float]] = {}
    for record in records if isinstance(records, list) else []:
        for side in ("pruned", "kept"):
            for stratum in _list(_dict(record).get(side)):
                key = ("pruned" if side == "pruned" else "kept", str(_dict(stratum).get("label")))
                totals = sums.setdefault(key, [0.0, 0.0, 0.0])
                for k, name in enumerate(("candidates", "solved", "flyable")):
                    value = _dict(stratum).get(name)
                    totals[k] += value if isinstance(value, int | float) else 0.0
    rows = [
        (side, "" if side == label else label, *(f"{value:.0f}" for value in totals))
        for (side, label), totals in sorted(sums.items(), key=lambda item: item[0][0] == "kept")
    ]
    head = ("", "predicted margin", "candidates", "optimised", "flyable")
    return table(head, rows, words=2) if rows else ""


def provenance(material: Material) -> str:
    """Return seed, versions and how the run was begun."""
    record = material.provenance
    if not record:
        return "<p>There is no provenance.</p>"
    command = " ".join(map(str, _list(record.get("command"))))
    rows: list[tuple[object, object]] = [
        ("seed", record.get("seed")),
        ("begun", record.get("created_utc")),
        ("command", command),
        ("resumed", len(_list(record.get("resumed")))),
        ("commit", record.get("git_commit") or "not from a checkout"),
        ("Python", record.get("python")),
        ("platform", record.get("platform")),
    ]
    rows += [(name, version) for name, version in _dict(record.get("versions")).items() if version]
    return table(("what", "value"), rows, words=2)


def settings(material: Material) -> str:
    """Return everything that was set."""
    shown = material.config[:_LONGEST] or "There is no config.toml."
    return f'<pre class="scroll" tabindex="0">{text(shown)}</pre>'


def data_block(name: str, record: dict[str, Any]) -> str:
    """Return data for the scripts, in which nothing can end the element or begin another."""
    plain = json.dumps(record, allow_nan=False, separators=(",", ":"))
    for character, code in (("<", "\\u003c"), (">", "\\u003e"), ("&", "\\u0026")):
        plain = plain.replace(character, code)
    return f'<script type="application/json" id="{text(name)}">{plain}</script>'


def _dict(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []

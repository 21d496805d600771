"""Draw the plan of the house: plan.svg, the floors of both packages and what each room holds.

Run with: python docs/design/plan.py
"""

from html import escape
from pathlib import Path

FLOORS = {
    "seqsearch": [
        {"commands": "the command seqsearch, one file a sub-command"},
        {"report": "a run as one HTML page"},
        {"runs": "run folder, checkpoints, sessions, resuming, fleets"},
        {"carriers": "a mother ship and the tours of her craft, together"},
        {"beam": "the search: passes, ranks, expanders, frontiers, rankings, scouting"},
        {"chart": "legs between near bodies, looked up"},
        {"polish": "all epochs of a tour at once", "refine": "continuous thrust"},
        {"problems": "one folder a problem, found by entry points; problem files"},
        {"pruning": "pruners by name, pruning of hops, the audit"},
        {"core": "the words: problem contract, nodes, hops, candidates, tree"},
        {"tours": "what is found: record, files, verify, plots", "fetching": "JPL, MPC"},
        {"settings": "[search]", "budget": "when to stop", "deadline": "the clock"},
    ],
    "feasibility": [
        {"commands": "the command feasibility, one file a sub-command"},
        {"study": "the paper's experiments", "spacecraft": "assess and retrain"},
        {"learning": "training: the margin model, the paper's models"},
        {"evaluation": "metrics and peers", "pruners": "which legs to keep"},
        {"classifier": "a trained model, asked", "dataset": "labelled legs"},
        {"sims_flanagan": "leg solvers", "continuous": "constant thrust by days"},
        {"orbits": "Kepler, elements, Lambert, MIMA, catalogues, neighbours"},
        {"legs": "Legs and Spacecraft, the one thing that all parts exchange"},
        {"runtime": "files, processes, kernels, TOML, the guarded import of pykep"},
        {"leg_checks": "columns of legs, and units that were probably meant"},
        {"quantities": "numbers that carry units"},
        {"constants": "units", "errors": "InputError", "arrays": "structs of arrays"},
    ],
}
"""Rooms by floor, the highest first. A room knows those on the floors below it."""

NOTES = (
    "An arrow means: may import. A room knows the rooms on lower floors of its package and none "
    "above it. seqsearch uses feasibility, never the other way round.",
    "tours.verify and verify_rows reach neither core, beam and problems nor the solvers, kernels "
    "and orbits of feasibility: what checks a tour shares nothing with what found it.",
)

TITLES = {
    "seqsearch": "seqsearch: the search and what it finds",
    "feasibility": "feasibility: legs, their solvers, and what predicts them",
}

WIDTH, FLOOR, GAP, MARGIN, HEAD = 500, 52, 8, 24, 64
GROUND = HEAD + max(map(len, FLOORS.values())) * (FLOOR + GAP)
COLOURS = {"seqsearch": "#e8f1fb", "feasibility": "#eef6e8"}
LINES = {"seqsearch": "#5b8cc0", "feasibility": "#76a35c"}


def svg() -> str:
    """Return the drawing."""
    width, height = 2 * WIDTH + 5 * MARGIN, GROUND + 72
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" font-family="DejaVu Sans, Verdana, sans-serif">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" '
        'markerHeight="8" orient="auto"><path d="M0 0 8 4 0 8z" fill="#555"/></marker></defs>',
    ]
    for package, x in (("seqsearch", 2 * MARGIN), ("feasibility", WIDTH + 4 * MARGIN)):
        parts.append(_text(x, 38, TITLES[package], 16, bold=True))
        for level, rooms in enumerate(reversed(FLOORS[package])):
            parts += _floor(package, rooms, x, GROUND - (level + 1) * (FLOOR + GAP))
    right, half = 2 * MARGIN + WIDTH, (HEAD + GROUND) / 2
    parts += [
        _arrow(MARGIN, HEAD + FLOOR, MARGIN, GROUND - GAP),
        _arrow(right + 4, half, right + 2 * MARGIN - 4, half),
        _text(2 * MARGIN, GROUND + 26, NOTES[0], 12),
        _text(2 * MARGIN, GROUND + 46, NOTES[1], 12),
    ]
    return "\n".join([*parts, "</svg>"]) + "\n"


def _floor(package: str, rooms: dict[str, str], x: int, y: int) -> list[str]:
    parts = []
    share = (WIDTH - GAP * (len(rooms) - 1)) / len(rooms)
    for k, (name, content) in enumerate(rooms.items()):
        left = x + k * (share + GAP)
        parts.append(
            f'<rect x="{left:.1f}" y="{y}" width="{share:.1f}" height="{FLOOR}" rx="5" '
            f'fill="{COLOURS[package]}" stroke="{LINES[package]}"/>'
        )
        parts.append(_text(left + 12, y + 21, name, 14, bold=True))
        parts.append(_text(left + 12, y + 40, content, 12))
    return parts


def _text(x: float, y: float, text: str, size: int, *, bold: bool = False) -> str:
    weight = ' font-weight="bold"' if bold else ""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}"{weight} fill="#222">'
        f"{escape(text, quote=False)}</text>"
    )


def _arrow(x1: float, y1: float, x2: float, y2: float) -> str:
    return (
        f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="#555" '
        'stroke-width="1.5" marker-end="url(#tip)"/>'
    )


if __name__ == "__main__":
    Path(__file__).with_name("plan.svg").write_text(svg(), encoding="utf-8")

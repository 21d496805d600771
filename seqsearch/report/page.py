"""`write_report`: the page, put together of sections, drawings, style and scripts.

The page asks no network: its content security policy forbids every request and every script but
ours, which the policy knows by its digest.
"""

import base64
import hashlib
from importlib import resources
from pathlib import Path
from typing import Final

from feasibility.runtime.atomic import write_text
from seqsearch.report import sections
from seqsearch.report.drawings import drawings
from seqsearch.report.material import Material, gather

REPORT_PAGE: Final = "report.html"
"""Name of the page in a run folder."""

_STYLE: Final = "page.css"
_SCRIPTS: Final = ("shapes.js", "charts.js", "scene.js", "page.js")


def write_report(run: Path, out: Path) -> int:
    """Write a run as one HTML page and return its size in bytes.

    Parameters
    ----------
    run : Path
        A run folder, or a tour file.
    out : Path
        The page; replaced if it is there.

    Raises
    ------
    InputError
        A file of the run is damaged, or the page cannot be written.
    """
    page = render(gather(run))
    write_text(out, page)
    return len(page.encode())


def render(material: Material) -> str:
    """Return the page."""
    style = _asset(_STYLE)
    script = '"use strict";(function(){\n' + "\n".join(map(_asset, _SCRIPTS)) + "\n})();"
    policy = (
        f"default-src 'none'; style-src {_digest(style)}; script-src {_digest(script)}; "
        "base-uri 'none'; form-action 'none'"
    )
    return "\n".join(
        [
            *_opening(f"{material.tour.rules.name}: report", policy, style),
            f"<header>{sections.headline(material)}</header>\n<main>",
            *_body(material),
            "</main>\n<footer>Made by seqsearch. The page needs no network.</footer>",
            sections.data_block("data", drawings(material)),
            f"<script>{script}</script>\n</body>\n</html>\n",
        ]
    )


def scriptless_page(title: str, head: str, body: list[str]) -> str:
    """Return a page of HTML parts that holds no script, and would run none."""
    style = _asset(_STYLE)
    policy = f"default-src 'none'; style-src {_digest(style)}; base-uri 'none'; form-action 'none'"
    return "\n".join(
        [
            *_opening(title, policy, style),
            f"<header>{head}</header>\n<main>",
            *body,
            "</main>\n<footer>Made by seqsearch. The page needs no network.</footer>",
            "</body>\n</html>\n",
        ]
    )


def _opening(title: str, policy: str, style: str) -> list[str]:
    return [
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="color-scheme" content="light dark">',
        f"<title>{sections.text(title)}</title>\n<style>{style}</style>\n</head>\n<body>",
    ]


def _body(material: Material) -> list[str]:
    tour = material.tour
    parts = [
        section("Sequence", sections.sequence(tour)),
        section("Legs", sections.legs(tour)),
    ]
    if material.flight is not None:
        parts += [
            section("Trajectory", _TRAJECTORY),
            section("Thrust and mass", _drawing("thrust") + _drawing("mass")),
            section("Visits and stays", _drawing("visits")),
        ]
    if material.ranks:
        counts = f"<details><summary>Numbers</summary>{sections.ranks(material)}</details>"
        parts.append(section("The beam, rank by rank", _RANKS + counts))
    if any(line.margin is not None for line in material.candidates):
        parts.append(section("Candidates kept and pruned", _CANDIDATES))
    if material.audit:
        parts.append(section("Audit", sections.audit(material)))
    if material.provenance:
        parts.append(section("Seed and versions", sections.provenance(material)))
    if material.config:
        parts.append(section("Settings", sections.settings(material)))
    return parts


def section(title: str, content: str) -> str:
    """Return a part of the page with its heading."""
    return f"<section><h2>{title}</h2>{content}</section>"


def _drawing(name: str) -> str:
    return f'<div class="drawing" id="{name}"></div>'


_TRAJECTORY: Final = """\
<noscript><p>The drawings need JavaScript.</p></noscript>
<div class="pair">
<figure><canvas id="ecliptic" role="img" aria-label="The path in the ecliptic"></canvas>
<figcaption>In the ecliptic. Numbers are those of the legs, 0 is the start; thin lines are the
bodies' orbits, dashed ones stays.</figcaption></figure>
<figure><canvas id="space" tabindex="0" role="img"
aria-label="The path in space; arrow keys turn it, plus and minus zoom"></canvas>
<figcaption><span class="buttons"><button type="button" id="nearer">+</button>
<button type="button" id="farther">&minus;</button>
<button type="button" id="higher" aria-pressed="false">height &times; 5</button>
<button type="button" id="upright">reset</button></span>
In space: drag to turn, or use the arrow keys.</figcaption></figure>
</div>
<p id="pointed" class="note" role="status">Point at a number to see where and when.</p>"""

_RANKS: Final = """\
<p class="note">Hops at each rank, on a logarithmic scale: proposed, left after pruning, optimised,
flyable, and kept for the next rank. <label>Pass <select id="pass"></select></label></p>
<div class="drawing" id="ranks"></div>"""

_CANDIDATES: Final = """\
<p class="note">A random sample of each rank, optimised for the audit whatever the pruner said.
A leg can be flown where its true margin is 1 or more; the map shows the predicted one, from 0 to
2.</p>
<div class="drawing" id="candidates"></div>"""


def _asset(name: str) -> str:
    file = resources.files(__package__).joinpath("assets", name)
    return file.read_text(encoding="utf-8").strip()


def _digest(content: str) -> str:
    digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
    return f"'sha256-{digest}'"

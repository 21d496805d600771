"""Draw the four kinds of ends of legs: legs.svg.

Run with: python docs/guide/legs.py
"""

import math
from html import escape
from pathlib import Path

PANELS = (
    ("rest", "Rendezvous", "vinf = 0", 0.0),
    ("launch", "Launch", "vinf_dep = 4000", 34.0),
    ("fly-by", "Fly-by", "vinf_arr = inf", math.inf),
    ("arrival", "Arrival with speed left", "vinf_arr = 2000", 22.0),
)
"""Kind, title, how Python says it, and radius of the circle of velocities that are allowed."""

WIDTH, HEIGHT, HEAD = 236, 232, 52
BODY, CRAFT, FREE = "#76a35c", "#c0603b", "#5b8cc0"


def svg() -> str:
    """Return the drawing."""
    width = WIDTH * len(PANELS)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {HEIGHT}" '
        'font-family="sans-serif" font-size="13" fill="#222">',
        "<defs>" + "".join(_head(colour) for colour in (BODY, CRAFT)) + "</defs>",
        f'<rect width="{width}" height="{HEIGHT}" fill="#ffffff"/>',
    ]
    for number, panel in enumerate(PANELS):
        parts.append(f'<g transform="translate({number * WIDTH} 0)">')
        parts += _panel(*panel)
        parts.append("</g>")
    return "\n".join([*parts, "</svg>", ""])


def _head(colour: str) -> str:
    return (
        f'<marker id="{colour[1:]}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
        f'markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z" fill="{colour}"/></marker>'
    )


def _panel(kind: str, title: str, said: str, radius: float) -> list[str]:
    """Return the lines of a panel: the body's velocity, and those that a spacecraft may have."""
    x, y = (96.0, 168.0) if kind == "launch" else (104.0, 168.0)
    tip = x + 58.0, y - 62.0
    own = {"rest": (0.0, 0.0), "launch": (26.0, -16.0), "fly-by": (38.0, 52.0)}
    dx, dy = own.get(kind, (-18.0, -9.0))
    lines = [
        f'<text x="14" y="22" font-weight="bold">{escape(title)}</text>',
        f'<text x="14" y="40" font-family="monospace" font-size="12">{escape(said)}</text>',
        f'<path d="M{x - 62:g} {y + 40:g}Q{x - 2:g} {y + 22:g} {x + 66:g} {y - 84:g}" fill="none" '
        f'stroke="{BODY}" stroke-dasharray="3 4"/>',
    ]
    if math.isinf(radius):
        lines.append(
            f'<rect x="8" y="{HEAD}" width="{WIDTH - 16}" height="{HEIGHT - HEAD - 8}" rx="6" '
            f'fill="{FREE}" fill-opacity="0.18"/>'
        )
    elif radius:
        lines.append(
            f'<circle cx="{tip[0]:g}" cy="{tip[1]:g}" r="{radius:g}" fill="{FREE}" '
            f'fill-opacity="0.18" stroke="{FREE}"/>'
        )
    end = tip[0] + dx, tip[1] + dy
    lines += _path(kind, (x, y), end)
    lines.append(_arrow((x, y), tip, BODY, 2.0))
    lines.append(_arrow((x, y), end, CRAFT, 2.6 if kind == "rest" else 2.2, dashed=kind == "rest"))
    lines.append(f'<circle cx="{x:g}" cy="{y:g}" r="5" fill="{BODY}"/>')
    return lines


def _path(kind: str, at: tuple[float, float], end: tuple[float, float]) -> list[str]:
    """Return the way of the spacecraft, along its velocity at the body."""
    (x, y), length = at, math.dist(at, end)
    ux, uy = (end[0] - x) / length, (end[1] - y) / length
    sign = 1.0 if kind == "launch" else -1.0
    a = x + sign * 34.0 * ux, y + sign * 34.0 * uy
    b = (x + 108.0, y + 2.0) if kind == "launch" else (x - 84.0, y - 30.0)
    return [
        f'<path d="M{x:g} {y:g}Q{a[0]:.1f} {a[1]:.1f} {b[0]:g} {b[1]:g}" fill="none" '
        f'stroke="{CRAFT}" stroke-opacity="0.55"/>'
    ]


def _arrow(
    start: tuple[float, float],
    end: tuple[float, float],
    colour: str,
    width: float,
    *,
    dashed: bool = False,
) -> str:
    dashes = ' stroke-dasharray="5 4"' if dashed else ""
    return (
        f'<line x1="{start[0]:g}" y1="{start[1]:g}" x2="{end[0]:g}" y2="{end[1]:g}" '
        f'stroke="{colour}" stroke-width="{width}"{dashes} marker-end="url(#{colour[1:]})"/>'
    )


if __name__ == "__main__":
    Path(__file__).with_name("legs.svg").write_text(svg(), encoding="utf-8")

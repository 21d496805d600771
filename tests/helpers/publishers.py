"""Bodies written in the formats of those who publish them."""

import datetime
import json
from dataclasses import dataclass, replace

import numpy as np

from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.orbits import classical_to_cartesian

JD = 2_400_000.5
LETTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"


@dataclass(frozen=True)
class Body:
    """A body as tables give it: epoch in MJD, a in AU, angles in degrees."""

    number: int = 3
    name: str = "Someone"
    epoch: float = 59000.0
    a: float = 2.5
    e: float = 0.1
    i: float = 7.0
    node: float = 100.0
    argp: float = 200.0
    m: float = 300.0
    h: float = 16.5
    g: float = 0.15

    @property
    def orbit(self):
        """Epoch, a, e, i, node, argp, M."""
        return (self.epoch, self.a, self.e, self.i, self.node, self.argp, self.m)


def packed_date(mjd):
    day = datetime.date.fromordinal(int(mjd) + 678_576)
    century = LETTERS[day.year // 100]
    return f"{century}{day.year % 100:02d}{LETTERS[day.month]}{LETTERS[day.day]}"


def packed_number(number):
    if number < 620_000:
        return f"{LETTERS[number // 10_000]}{number % 10_000:04d}"
    text, rest = "", number - 620_000
    for _ in range(4):
        text, rest = LETTERS[rest % 62] + text, rest // 62
    return "~" + text


def mpc_line(body, packed=None):
    packed = packed_number(body.number) if packed is None else packed
    name = f"({body.number}) {body.name}" if len(packed) == 5 else f"        {body.name}"
    h = "" if body.h is None else f"{body.h:5.2f}"
    g = "" if body.g is None else f"{body.g:5.2f}"
    return (
        f"{packed:7} {h:5} {g:5} {packed_date(body.epoch)} {body.m:9.5f}  {body.argp:9.5f}  "
        f"{body.node:9.5f}  {body.i:9.5f}  {body.e:9.7f} {0.2:11.8f} {body.a:11.7f}  0 E2025-X00 "
        f" 1234  12 1990-2025 0.50 M-v 3Ek MPCLINUX   8800 {name:28}20251120"
    )


def mpcorb(bodies):
    preamble = "MINOR PLANET CENTER ORBIT DATABASE\n\nDes'n H G Epoch M\n" + 160 * "-" + "\n"
    return preamble + "\n".join(map(mpc_line, bodies)) + "\n"


def mpc_json(bodies):
    return json.dumps(
        [
            {
                "Number": f"({body.number})",
                "Name": body.name,
                "Epoch": body.epoch + JD,
                "M": body.m,
                "Peri": body.argp,
                "Node": body.node,
                "i": body.i,
                "e": body.e,
                "a": body.a,
                "H": body.h,
                "G": body.g,
            }
            for body in bodies
        ],
        indent=1,
    )


FIELDS = ("full_name", "epoch", "a", "e", "i", "om", "w", "ma", "H")


def sbdb_cells(body):
    orbit = (body.epoch + JD, body.a, body.e, body.i, body.node, body.argp, body.m, body.h)
    name = f"{body.number:6d} {body.name} (1999 AB1)"
    return [name, *(None if value is None else repr(value) for value in orbit)]


def sbdb_query(bodies):
    rows = [sbdb_cells(body) for body in bodies]
    return json.dumps(
        {"signature": {"version": "1.0"}, "fields": FIELDS, "data": rows, "count": len(rows)}
    )


def sbdb_csv(bodies):
    lines = [",".join(FIELDS)]
    for body in bodies:
        name, *cells = sbdb_cells(body)
        lines.append(",".join([f'"{name}"', *(cell or "" for cell in cells)]))
    return "\n".join(lines) + "\n"


def sbdb_lookup(bodies):
    (body,) = bodies
    values = dict(zip(("a", "e", "i", "om", "w", "ma"), body.orbit[1:], strict=True))
    units = {"a": "au", "e": None}
    return json.dumps(
        {
            "object": {"des": str(body.number), "fullname": f"{body.number} {body.name}"},
            "orbit": {
                "epoch": repr(body.epoch + JD),
                "elements": [
                    {"name": name, "value": repr(value), "units": units.get(name, "deg")}
                    for name, value in values.items()
                ],
            },
            "phys_par": [{"name": "H", "value": repr(body.h)}],
        }
    )


def horizons(header, body, cells, units):
    return (
        f"Target body name: {body.number} {body.name}      {{source: JPL#48}}\n"
        f"Center body name: Sun (10)      {{source: DE441}}\nOutput units    : {units}\n"
        "Output type     : GEOMETRIC states\nReference frame : Ecliptic of J2000.0\n"
        f"*****\n   JDTDB,  Calendar Date (TDB), {', '.join(header)},\n*****\n"
        f"$$SOE\n{body.epoch + JD:.9f}, A.D. 2020, {', '.join(map(repr, cells))},\n$$EOE\n*****\n"
    )


def horizons_elements(bodies):
    return "".join(
        horizons(
            ("EC", "QR", "IN", "OM", "W", "Tp", "N", "MA", "TA", "A"),
            body,
            (body.e, 2.0, body.i, body.node, body.argp, 2.4e6, 0.2, body.m, 9.0, body.a),
            "AU-D, deg, Julian Day Number (Tp)",
        )
        for body in bodies
    )


def state_of(body):
    """Return (6,) the state, m and m/s."""
    angles = np.radians([body.i, body.node, body.argp, body.m])
    return classical_to_cartesian([body.a * AU, body.e, *angles])


def horizons_vectors(bodies, turn=None):
    texts = []
    for body in bodies:
        state = state_of(body) if turn is None else turn(state_of(body))
        cells = (*(state[:3] / AU), *(state[3:] / AU * DAY_S))
        names = ("X", "Y", "Z", "VX", "VY", "VZ")
        texts.append(horizons(names, body, [float(cell) for cell in cells], "AU-D"))
    return "".join(texts)


def numbr(bodies):
    lines = [
        " Num   Name              Epoch      a          e        i         w        Node        M"
        "         H     G   Ref",
        "------ ----------------- ----- ---------- ---------- --------- --------- --------- "
        "----------- ----- ----- ----------",
    ]
    lines += [
        f"{body.number:6d} {body.name:17} {body.epoch:5.0f} {body.a:10.7f} {body.e:10.8f} "
        f"{body.i:9.5f} {body.argp:9.5f} {body.node:9.5f} {body.m:11.7f} {body.h:5.2f} "
        f"{body.g:5.2f} JPL 48"
        for body in bodies
    ]
    return "\n".join(lines) + "\n"


def unnum(bodies):
    lines = [
        "Designation   Epoch      a           e        i         w        Node        M         H"
        "    G   Ref",
        "------------- ----- ----------- ---------- --------- --------- --------- ----------- "
        "----- ---- ----------",
    ]
    lines += [
        f"{body.name:13} {body.epoch:5.0f} {body.a:11.7f} {body.e:10.8f} {body.i:9.5f} "
        f"{body.argp:9.5f} {body.node:9.5f} {body.m:11.7f} {body.h:5.2f} {body.g:4.2f} JPL 1"
        for body in bodies
    ]
    return "\n".join(lines) + "\n"


def perihelion_date(body):
    """Return the last passage of the perihelion before the epoch, in MJD."""
    motion = np.degrees(np.sqrt(MU_SUN / (body.a * AU) ** 3)) * DAY_S
    return body.epoch - body.m / motion


def comet(bodies):
    lines = [
        "Num  Name                                     Epoch      q           e        i         w"
        "        Node          Tp       Ref",
        "------------------------------------------- ------- ----------- ---------- --------- "
        "--------- --------- -------------- ------------",
    ]
    for body in bodies:
        passage = perihelion_date(body) if body.e < 1 else body.epoch
        day = datetime.date.fromordinal(int(passage) + 678_576)
        tp = f"{day:%Y%m%d}" + f"{passage % 1:.5f}"[1:]
        lines.append(
            f"{body.number:3d}P/{body.name:37} {body.epoch:8.0f} {body.a * abs(1 - body.e):11.8f} "
            f"{body.e:10.8f} {body.i:9.5f} {body.argp:9.5f} {body.node:9.5f} {tp:>14} JPL K1"
        )
    return "\n".join(lines) + "\n"


def astdys(bodies):
    return (
        "format  = 'OEF2.0'       ! file format\nrectype = '1L'           ! record type (1L/ML)\n"
        "elem    = 'KEP'          ! type of orbital elements\n"
        "refsys  = ECLM J2000     ! default reference system\nEND_OF_HEADER\n"
        "! Name, Epoch(MJD), a, e, i, long. node, arg. peric., mean anomaly, absolute magnitude\n"
        + "".join(
            f"'{body.number}'  {body.epoch:.6f}  {body.a:.16E} {body.e:.16E} {body.i:.16E} "
            f"{body.node:.16E} {body.argp:.16E} {body.m:.16E} {body.h:6.2f} {body.g:5.2f} 0\n"
            for body in bodies
        )
    )


def plain(bodies):
    rows = [" ".join(map(repr, (body.number, *body.orbit))) for body in bodies]
    return "\n".join(["ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)", *rows]) + "\n"


FORMATS = {
    "MPCORB": mpcorb,
    "MPC extended JSON": mpc_json,
    "SBDB query": sbdb_query,
    "SBDB look-up": sbdb_lookup,
    "CSV": sbdb_csv,
    "Horizons": horizons_elements,
    "AstDyS": astdys,
    "GTOC12": plain,
}
"""What is written with all digits, or as many as the format has."""

FIXED = {"MPCORB": mpcorb, "NUMBR": numbr, "UNNUM": unnum}
ONE_BODY = ("SBDB look-up",)


def rounded(body, **digits):
    """Return a body whose numbers have so many digits behind the point."""
    return replace(body, **{name: round(getattr(body, name), n) for name, n in digits.items()})

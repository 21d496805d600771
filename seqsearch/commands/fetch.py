"""``seqsearch fetch``: bodies from the services that publish them."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility import InputError
from feasibility.runtime.terminal import say, say_json
from seqsearch.commands.options import add_output

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands
    from seqsearch.fetching.download import Wanted

_DESCRIPTION: Final = """\
Fetch bodies into files that [catalogue] file and --catalogue read.

A file that was fetched before is used as it is; --refresh fetches it anew. It is replaced
when the new one is complete and checked, and stays as it is if anything goes wrong. A busy
server and a cut connection are tried again, and a large file goes on where it was cut.
Beside each file NAME, NAME.source.json says what was fetched, from where and when, and its
SHA-256.
"""

_SBDB: Final = """\
Bodies of JPL's Small-Body Database that fulfil all conditions.

  seqsearch fetch sbdb --class MBA --where 'H < 12' --out belt.json
  seqsearch fetch sbdb --query sb-group=neo --where 'i < 5' --out neo.csv

Classes are IEO, ATE, APO, AMO, MCA, IMB, MBA, OMB, TJN, CEN, TNO and others, parted by
commas. Conditions compare a field (a, e, i, q, H, diameter ...) with a number, or are in the
service's own words, such as 'a|RG|2.2|3.2'. --query passes any other parameter on
(https://ssd-api.jpl.nasa.gov/doc/sbdb_query.html).
"""

_HORIZONS: Final = """\
SPK kernels of single bodies by JPL Horizons, one file a body, in a folder that
[catalogue] file may name.

  seqsearch fetch horizons-spk 1 4 433 --start 2030-01-01 --stop 2045-01-01 --out kernels

Bodies are numbers of asteroids, NAIF numbers, names or designations.
"""


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    fetch = commands.add_parser(
        "fetch",
        help="fetch bodies from JPL and the Minor Planet Center",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    services = fetch.add_subparsers(required=True, metavar="SERVICE")
    _add_sbdb(services)
    mpcorb = services.add_parser("mpcorb", help="the Minor Planet Center's MPCORB.DAT.gz")
    mpcorb.add_argument(
        "--out", metavar="FILE", default="MPCORB.DAT.gz", help="default: %(default)s"
    )
    _add_common(mpcorb, "mpcorb")
    mpcorb.set_defaults(run=_fetch, wanted=_mpcorb)
    horizons = services.add_parser(
        "horizons-spk",
        help="SPK kernels of single bodies",
        description=_HORIZONS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    horizons.add_argument("bodies", metavar="BODY", nargs="+", help="number, name or designation")
    horizons.add_argument("--start", metavar="DATE", required=True, help="such as 2030-01-01")
    horizons.add_argument("--stop", metavar="DATE", required=True, help="such as 2045-01-01")
    horizons.add_argument("--out", metavar="DIR", default="kernels", help="default: %(default)s")
    _add_common(horizons, "horizons")
    horizons.set_defaults(run=_fetch, wanted=_horizons)


def _add_sbdb(services: "Commands") -> None:
    sbdb = services.add_parser(
        "sbdb",
        help="bodies of JPL's Small-Body Database by a query",
        description=_SBDB,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    sbdb.add_argument("--class", metavar="CODES", dest="orbit_class", help="orbit classes")
    sbdb.add_argument(
        "--where", metavar="CONDITION", action="append", default=[], help="may be repeated"
    )
    sbdb.add_argument(
        "--query",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="a parameter of the service, may be repeated",
    )
    sbdb.add_argument("--fields", metavar="NAMES", help="columns, parted by commas")
    sbdb.add_argument(
        "--out", metavar="FILE", default="sbdb.json", help=".json or .csv; default: %(default)s"
    )
    _add_common(sbdb, "sbdb")
    sbdb.set_defaults(run=_fetch, wanted=_sbdb)


def _add_common(command: argparse.ArgumentParser, name: str) -> None:
    command.add_argument("--refresh", action="store_true", help="fetch it though it is there")
    command.add_argument("--sha256", metavar="HEX", help="refuse a file with another SHA-256")
    command.add_argument(
        "--retries", type=int, default=4, metavar="N", help="tries after the first; default: 4"
    )
    command.add_argument(
        "--url",
        help=f"another address of the service (or the variable SEQSEARCH_{name.upper()}_URL)",
    )
    add_output(command)


def _fetch(options: argparse.Namespace) -> int:
    # Imported here: the other commands need no network.
    from seqsearch.fetching.download import Patience, fetch

    if not 0 <= options.retries <= 20:
        raise InputError(f"--retries {options.retries}: expected 0 to 20")
    if options.sha256 is not None and not re.fullmatch(r"\s*[0-9a-fA-F]{64}\s*", options.sha256):
        raise InputError(f"--sha256 {options.sha256}: expected 64 hexadecimal digits")
    patience = Patience(retries=options.retries)
    found = []
    for wanted in options.wanted(options):
        record, now = fetch(wanted, refresh=options.refresh, patience=patience)
        how = "fetched" if now else f"there since {record.fetched}, --refresh fetches it anew"
        say(f"{wanted.target}: {record.size_bytes} bytes, {how}; SHA-256 {record.sha256}")
        found.append(
            {
                "file": str(wanted.target),
                "fetched_now": now,
                "url": record.url,
                "fetched": record.fetched,
                "sha256": record.sha256,
                "size_bytes": record.size_bytes,
            }
        )
    if options.json:
        say_json({"files": found})
    return 0


def _sbdb(options: argparse.Namespace) -> "list[Wanted]":
    from seqsearch.fetching.sbdb import FIELDS, sbdb

    fields = FIELDS
    if options.fields is not None:
        fields = tuple(name.strip() for name in options.fields.split(","))
    return [
        sbdb(
            Path(options.out),
            orbit_class=options.orbit_class,
            where=options.where,
            query=options.query,
            fields=fields,
            url=options.url,
            sha256=options.sha256,
        )
    ]


def _mpcorb(options: argparse.Namespace) -> "list[Wanted]":
    from seqsearch.fetching.mpcorb import mpcorb

    return [mpcorb(Path(options.out), url=options.url, sha256=options.sha256)]


def _horizons(options: argparse.Namespace) -> "list[Wanted]":
    from seqsearch.fetching.horizons import file_name, horizons_spk

    if options.sha256 is not None and len(options.bodies) > 1:
        raise InputError("--sha256: of one file, but several bodies are named")
    return [
        horizons_spk(
            body,
            Path(options.out) / file_name(body),
            start=options.start,
            stop=options.stop,
            url=options.url,
            sha256=options.sha256,
        )
        for body in options.bodies
    ]

"""``MPCORB.DAT.gz``: the orbits of all minor planets, as the Minor Planet Center has them."""

import gzip
import shutil
import zlib
from pathlib import Path
from typing import Final

from seqsearch.fetching.contents import check_no_page
from seqsearch.fetching.download import UnfitError, Wanted
from seqsearch.fetching.services import MPCORB, address_of

FILE: Final = "MPCORB.DAT.gz"

_GZIP: Final = b"\x1f\x8b"
_EXPECTED: Final = "a gzipped table"
_BLOCK: Final = 1 << 20
_LONG_ROW: Final = 160
"""Characters that the row of an orbit has at least; the MPC's have 202."""


def mpcorb(target: Path, *, url: str | None = None, sha256: str | None = None) -> Wanted:
    """Return what to fetch: the whole table."""
    return Wanted(
        url=address_of(MPCORB, "mpcorb", url),
        target=target,
        what="orbits of the Minor Planet Center",
        make=_make,
        resumable=True,
        sha256=sha256,
    )


def _make(came: Path, file: Path) -> None:
    with came.open("rb") as stream:
        begin = stream.read(_BLOCK)
    check_no_page(begin, _EXPECTED)
    if not begin.startswith(_GZIP):
        raise UnfitError(f"answers with something else than {_EXPECTED}")
    try:
        with gzip.open(came) as stream:
            text = stream.read(_BLOCK)
            check_no_page(text, _EXPECTED)
            # To the end: only there does the file say whether it is whole.
            while stream.read(_BLOCK):
                pass
    except (EOFError, gzip.BadGzipFile, zlib.error, OSError):
        raise UnfitError(f"answers with {_EXPECTED} that is cut off or damaged") from None
    if not any(len(line) >= _LONG_ROW for line in text.splitlines()):
        raise UnfitError("answers with a table without the long rows of MPCORB")
    shutil.copyfile(came, file)

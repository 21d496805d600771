"""Addresses of the services, and how another one stands in for them."""

import os
from typing import Final
from urllib.parse import urlsplit, urlunsplit

SBDB: Final = "https://ssd-api.jpl.nasa.gov/sbdb_query.api"
"""JPL's Small-Body Database, its query service."""

MPCORB: Final = "https://www.minorplanetcenter.net/iau/MPCORB/MPCORB.DAT.gz"
"""Orbits of the Minor Planet Center."""

HORIZONS: Final = "https://ssd.jpl.nasa.gov/api/horizons.api"
"""JPL's Horizons system."""


def address_of(service: str, name: str, given: str | None) -> str:
    """Return the address to ask.

    Parameters
    ----------
    service : str
        The service's own address.
    name : str
        Of the service; the environment variable ``SEQSEARCH_<NAME>_URL`` has another address.
    given : str, optional
        Another address, which comes first.

    Returns
    -------
    str
        With the service's own path where the other address has none.
    """
    other = given or os.environ.get(f"SEQSEARCH_{name.upper()}_URL") or service
    parts = urlsplit(other)
    if parts.netloc and parts.path in ("", "/"):
        other = urlunsplit(parts._replace(path=urlsplit(service).path))
    return other

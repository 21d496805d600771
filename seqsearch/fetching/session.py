"""Asking a service: what is tried again, and what is said where that does not help.

requests and urllib3 do the talking. They try again what may pass: a busy server, a connection
that is not made, an answer that does not come.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final
from urllib.parse import urlsplit

import requests
from requests.adapters import HTTPAdapter
from urllib3.util import Retry

from feasibility.errors import InputError

_BUSY: Final = (429, 500, 502, 503, 504)
_CONNECT_S: Final = 15.0
_SILENT_S: Final = 90.0
_LONGEST_ANSWER: Final = 200

TIMEOUT: Final = (_CONNECT_S, _SILENT_S)


def new_session(retries: int, pause_s: float) -> requests.Session:
    """Return a session that tries again `retries` times, after pauses that double."""
    policy = Retry(
        total=None,
        connect=min(retries, 2),
        read=retries,
        status=retries,
        other=0,
        redirect=5,
        backoff_factor=pause_s,
        status_forcelist=_BUSY,
        allowed_methods=("GET",),
        raise_on_status=False,
    )
    session = requests.Session()
    for scheme in ("http://", "https://"):
        session.mount(scheme, HTTPAdapter(max_retries=policy))
    # Files come as they are: what is packed stays packed.
    session.headers.update({"Accept-Encoding": "identity", "User-Agent": "seqsearch"})
    return session


@contextmanager
def in_words(url: str) -> Iterator[None]:
    """Turn what goes wrong in asking into one line.

    Raises
    ------
    InputError
        The service is not there, does not answer, or the address is none.
    """
    host = urlsplit(url).netloc or url
    try:
        yield
    except requests.exceptions.SSLError:
        raise InputError(f"{host}: no secure connection; is there a proxy in between?") from None
    except requests.exceptions.ConnectTimeout:
        raise InputError(
            f"{host}: no connection within {_CONNECT_S:.0f} s; are you offline?"
        ) from None
    except requests.exceptions.ReadTimeout:
        raise InputError(f"{host}: no answer within {_SILENT_S:.0f} s; try again later") from None
    except requests.exceptions.ConnectionError as error:
        raise InputError(
            f"{host}: cannot be reached ({_cause(error)}); are you offline?"
        ) from None
    except (
        requests.exceptions.InvalidURL,
        requests.exceptions.MissingSchema,
        requests.exceptions.InvalidSchema,
    ):
        raise InputError(f"{url}: is no address, expected one such as https://host/path") from None
    except requests.exceptions.RequestException as error:
        raise InputError(f"{host}: cannot be fetched from ({_short(str(error))})") from None


def check_status(response: requests.Response, retries: int) -> None:
    """Refuse an answer that is an error, with the service's own words where it has any.

    Raises
    ------
    InputError
        The status is not one of success.
    """
    status = response.status_code
    if status < 400:
        return
    host = urlsplit(response.url).netloc
    if status in _BUSY:
        raise InputError(
            f"{host}: answers with error {status} {response.reason}, {retries + 1} times in a "
            "row; try again later"
        )
    words = _message(response)
    raise InputError(f"{host}: refuses with {status} {response.reason}{words}")


def _message(response: requests.Response) -> str:
    """Return what a service says in JSON of its refusal."""
    try:
        answer = response.json()
    except (ValueError, requests.exceptions.RequestException):
        return ""
    text = answer.get("message") or answer.get("error") if isinstance(answer, dict) else None
    return f": {_short(str(text))}" if text else ""


def _cause(error: BaseException) -> str:
    """Return the innermost reason, such as 'Connection refused'."""
    reason: BaseException | None = error
    text = ""
    seen: set[int] = set()
    while reason is not None and id(reason) not in seen:
        seen.add(id(reason))
        text = getattr(reason, "strerror", None) or text
        inner = getattr(reason, "reason", None)
        first = reason.args[0] if reason.args else None
        candidates = (inner, first, reason.__cause__, reason.__context__)
        reason = next((found for found in candidates if isinstance(found, BaseException)), None)
    return text or "no connection"


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= _LONGEST_ANSWER else line[: _LONGEST_ANSWER - 3] + "..."

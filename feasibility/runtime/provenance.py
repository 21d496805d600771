"""Where a result came from: versions, platform and git commit, written beside every output."""

import platform
import re
import subprocess
import sys
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

_LIBRARIES = ("numpy", "scipy", "numba", "pykep", "pygmo", "networkx", "pyarrow", "torch")
_PACKAGES = ("seqsearch", *_LIBRARIES)


def provenance() -> dict[str, Any]:
    """Return versions of Python and packages, platform, time, command and git commit.

    Absolute paths in the command are cut to their last name, as folders tell about a machine
    only; so are paths and passwords of URLs.
    The commit is that of this project's own checkout, None outside one; a
    trailing ``+`` says that tracked files had been changed.
    """
    return {
        "created_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": [_without_folder(word) for word in sys.argv],
        "python": platform.python_version(),
        "platform": platform.platform(),
        "versions": {name: _version(name) for name in _PACKAGES},
        "git_commit": _git_commit(),
    }


def _without_folder(word: str) -> str:
    option, equals, value = word.partition("=")
    if equals and option.startswith("-"):
        return f"{option}={_without_folder(value)}"
    if equals and Path(value).is_absolute():
        return f"{option}={Path(value).name}"
    if Path(word).is_absolute():
        return Path(word).name
    url = re.sub(r"(://[^/:@]*):[^@]*@", r"\1:***@", word)
    return re.sub(r"^([\w+]+:///).*/", r"\1", url)


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _git_commit() -> str | None:
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return None
    try:
        commit = _git(root, "rev-parse", "HEAD")
        changed = _git(root, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.SubprocessError):
        return None
    return commit + ("+" if changed else "")


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(root), *arguments],
        capture_output=True,
        text=True,
        check=True,
        timeout=10,
    )
    return done.stdout.strip()

"""Where trials of an optimisation are kept: an own journal, or a storage that is shared."""

import re
import time
from pathlib import Path
from typing import Any, Final

from feasibility.errors import InputError, MissingDependencyError

_JOURNAL: Final = "journal:///"
_TRIES: Final = 5
_BUSY_S: Final = 60
"""How long a process waits for another that writes to the same SQLite file."""

_OTHER_BACKENDS: Final = "sqlite:///FILE, journal:///FILE, postgresql://... or mysql://..."


def open_study(optuna: Any, storage: Path | str, name: str) -> Any:
    """Return a study of the storage, made where it is not there yet.

    Parameters
    ----------
    optuna : module
        The package.
    storage : Path or str
        Journal file with this study alone; or URL of a storage that may have others beside it.
        The path of ``sqlite:///`` and ``journal:///`` is relative unless a fourth slash begins it.
    name : str
        The study's.

    Raises
    ------
    InputError
        A storage that cannot be used, or a journal that holds another study.
    MissingDependencyError
        The driver of the database is not installed.
    """
    opened = _opened(optuna, storage, name)
    return optuna.load_study(study_name=name, storage=opened)


def without_password(storage: Path | str) -> str:
    """Return a storage as it may be printed."""
    return re.sub(r"(://[^/:@]*):[^@]*@", r"\1:***@", str(storage))


def _opened(optuna: Any, storage: Path | str, name: str) -> Any:
    shown = without_password(storage)
    for tries_left in reversed(range(_TRIES)):
        try:
            return _with_study(optuna, storage, name)
        except InputError:
            raise
        except ImportError as error:
            raise MissingDependencyError(
                f"{shown}: the database's driver is not installed ({_reason(error)})"
            ) from None
        except (OSError, ValueError, KeyError) as error:
            raise InputError(f"{shown}: not a journal of optuna, or damaged ({error})") from None
        except Exception as error:
            # Databases have errors of their own. Of two processes that make the same tables at
            # the same time one fails, and finds them there at its next try.
            if tries_left and re.search("exist|UNIQUE", str(error)):
                time.sleep(0.2)
                continue
            raise InputError(
                f"{shown}: cannot be used ({_reason(error)}); expected {_OTHER_BACKENDS}"
            ) from None
    raise AssertionError("unreachable")


def _with_study(optuna: Any, storage: Path | str, name: str) -> Any:
    """Return the storage, in which there is the study."""
    opened = _backend(optuna, storage)
    known = [summary.study_name for summary in optuna.get_all_study_summaries(opened)]
    if isinstance(storage, Path) and known and name not in known:
        raise InputError(f"{storage}: holds the study {known[0]!r}, expected {name!r}")
    optuna.create_study(study_name=name, storage=opened, direction="maximize", load_if_exists=True)
    return opened


def _backend(optuna: Any, storage: Path | str) -> Any:
    if isinstance(storage, str) and not storage.startswith(_JOURNAL):
        if "://" not in storage:
            raise InputError(f"{storage}: expected the URL of a storage, {_OTHER_BACKENDS}")
        sqlite = storage.startswith("sqlite")
        engine = {"connect_args": {"timeout": _BUSY_S}} if sqlite else {}
        return optuna.storages.RDBStorage(storage, engine_kwargs=engine)
    file = storage.removeprefix(_JOURNAL) if isinstance(storage, str) else str(storage)
    return optuna.storages.JournalStorage(optuna.storages.journal.JournalFileBackend(file))


def _reason(error: Exception) -> str:
    """Return the innermost cause in one line: a database's driver says it best."""
    cause: BaseException = getattr(error, "orig", None) or error.__cause__ or error
    cause = getattr(cause, "orig", None) or cause
    return without_password(str(cause).strip().partition("\n")[0])

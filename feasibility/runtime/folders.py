"""Folders that commands write to."""

from pathlib import Path

from feasibility.errors import InputError


def make_folder(path: Path) -> None:
    """Make a folder, and those above it, where it is not there yet.

    Raises
    ------
    InputError
        It cannot be created, or is a file.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be created ({error.strerror})") from None


def new_folder(path: Path) -> None:
    """Make a folder that must not be there yet, and those above it.

    Raises
    ------
    InputError
        It exists or cannot be created; nothing is overwritten.
    """
    try:
        path.mkdir(parents=True)
    except FileExistsError:
        raise InputError(
            f"{path}: exists; nothing is overwritten, choose another --out or remove it"
        ) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be created ({error.strerror})") from None

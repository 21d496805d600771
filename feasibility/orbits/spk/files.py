"""Which files a path stands for: one kernel, a folder of them, or a meta-kernel."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from feasibility.errors import InputError
from feasibility.orbits.spk.text_kernel import joined, read_text_kernel

_HEAD: Final = 65_536
"""Bytes in which a meta-kernel has to say that it is one."""

_SPK: Final = b"DAF/SPK"
_TRANSFER: Final = b"DAFETF"
_LEAP_SECONDS: Final = b"KPL/LSK"


@final
@dataclass(frozen=True)
class KernelFiles:
    """The kernels that a path stands for.

    Attributes
    ----------
    path : Path
        What was given.
    spk : tuple of Path
        SPK kernels; where two have the same body at the same time the later one counts, as in
        SPICE. A folder's are in the order of their names.
    leap_seconds : Path or None
        A leap-second kernel.
    """

    path: Path
    spk: tuple[Path, ...]
    leap_seconds: Path | None


def is_kernel(path: Path) -> bool:
    """Return whether a path is a folder, a binary kernel or a meta-kernel: no table, at any rate.

    It may still be one that cannot be used, which `kernel_files` says.
    """
    if path.is_dir():
        return True
    head = _head(path)
    return head.startswith((b"DAF/", _TRANSFER)) or (
        b"\\begindata" in head and b"KERNELS_TO_LOAD" in head
    )


def kernel_files(path: Path) -> KernelFiles:
    """Return the kernels that a path stands for.

    Raises
    ------
    InputError
        There is no SPK kernel, a kernel of a meta-kernel is missing, or a file is another kind
        of kernel.
    """
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.is_file())
        found = _sorted(path, files)
        if not found.spk:
            raise InputError(
                f"{path}: is a folder without SPK kernels, expected an asteroid table, or a "
                "folder of kernels"
            )
        return found
    head = _head(path)
    if head.startswith(_SPK):
        return KernelFiles(path, (path,), None)
    if head.startswith(_TRANSFER):
        raise InputError(
            f"{path}: is a kernel in transfer format; expected a binary one (NAIF's tobin "
            "makes it)"
        )
    if head.startswith(b"DAF/"):
        kind = head[:8].decode("ascii", "replace").strip()
        raise InputError(f"{path}: is a kernel of type {kind}, expected DAF/SPK")
    found = _sorted(path, _named(path))
    if not found.spk:
        raise InputError(f"{path}: names no SPK kernel in KERNELS_TO_LOAD, expected one at least")
    return found


def _sorted(path: Path, files: list[Path]) -> KernelFiles:
    spk = [file for file in files if _head(file).startswith(_SPK)]
    leap_seconds = [file for file in files if _head(file).startswith(_LEAP_SECONDS)]
    return KernelFiles(path, tuple(spk), leap_seconds[-1] if leap_seconds else None)


def _named(path: Path) -> list[Path]:
    """Return the files that a meta-kernel names; relative ones lie beside it, or here."""
    table = read_text_kernel(path)
    symbols = joined(table.get("PATH_SYMBOLS", []))
    values = joined(table.get("PATH_VALUES", []))
    if len(symbols) != len(values):
        raise InputError(
            f"{path}: {len(symbols)} PATH_SYMBOLS and {len(values)} PATH_VALUES, expected as many"
        )
    # Longer symbols first: one may begin another.
    known = sorted(zip(symbols, values, strict=True), key=lambda pair: -len(pair[0]))
    files = []
    for name in joined(table.get("KERNELS_TO_LOAD", [])):
        for symbol, value in known:
            name = name.replace(f"${symbol}", value)
        file = next((file for file in (path.parent / name, Path(name)) if file.is_file()), None)
        if file is None:
            raise InputError(
                f"{path}: KERNELS_TO_LOAD names {name}, which is not there; paths are relative to "
                "the meta-kernel or to the working folder"
            )
        files.append(file)
    return files


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_HEAD)
    except OSError:
        # Whoever reads the file says so.
        return b""

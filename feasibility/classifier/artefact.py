"""`Artefact`: a trained model as one file, without pickle.

The file is a zip archive: ``manifest.json``, ``manifest.sha256`` with its
digest, and one ``.npy`` a array, whose digests the manifest has. Arrays are
named by section:

- ``model/...``: what the predictors of its kind read;
- ``scaler/mean``, ``scaler/std`` (k,): the standardisation of the k inputs;
- ``domain/low``, ``domain/high`` (k,): range of the inputs in training, a
  little widened; ``domain/isp`` (2,), s, and ``domain/thrust`` (2,), N;
- ``calibration/positive_scores``: rising probabilities of feasible legs that
  were not trained on, from which a threshold for any recall follows.
"""

import hashlib
import io
import json
import math
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.runtime.atomic import atomic_path

SUFFIX: Final = ".seqmodel"
"""Ending of the files' names."""

FORMAT: Final = "seqsearch-model"
FORMAT_VERSION: Final = 1
"""A reader understands files up to its own version."""

_MAX_BYTES: Final = 256 << 20
"""Of an unpacked model: a file from elsewhere may be made to unpack to any size."""

_LONGEST_REASON: Final = 200
"""Characters: messages of zipfile may quote the file."""

_MAX_MEMBERS: Final = 1000
_KINDS: Final = "biufU"
"""Kinds of arrays that a model may have: numbers and words."""

_MANIFEST: Final = "manifest.json"
_DIGEST: Final = "manifest.sha256"
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
"""Time stamp of all members: the same model gives the same file."""


@final
@dataclass(frozen=True, eq=False)
class Artefact:
    """A trained model and all that its use needs.

    Attributes
    ----------
    kind : str
        How the arrays of section ``model`` predict: "dnn", "ensemble", "knn", "svm" or "tree".
    feature_set : str
        Name of the set of features that the inputs are taken from.
    features, units : tuple of str
        The k inputs, in order, and their units.
    arrays : mapping of str to array
        See the module's text.
    config : mapping
        How it was trained: hyperparameters, balance, seed, sizes.
    metrics : mapping
        Measures on legs that were not trained on.
    provenance : mapping
        Dataset, versions, time.
    """

    kind: str
    feature_set: str
    features: tuple[str, ...]
    units: tuple[str, ...]
    arrays: Mapping[str, NDArray[Any]]
    config: Mapping[str, Any]
    metrics: Mapping[str, Any]
    provenance: Mapping[str, Any]

    def section(self, name: str) -> dict[str, NDArray[Any]]:
        """Return the arrays of one section, without its name."""
        prefix = f"{name}/"
        return {
            key.removeprefix(prefix): array
            for key, array in self.arrays.items()
            if key.startswith(prefix)
        }

    def save(self, path: Path) -> None:
        """Write the file, which is complete or absent.

        Raises
        ------
        InputError
            The folder cannot be written to.
        """
        contents = {name: _npy(array) for name, array in sorted(self.arrays.items())}
        manifest = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "kind": self.kind,
            "feature_set": self.feature_set,
            "features": list(self.features),
            "units": list(self.units),
            "config": dict(self.config),
            "metrics": dict(self.metrics),
            "provenance": dict(self.provenance),
            "arrays": {name: _sha256(content) for name, content in contents.items()},
        }
        text = json.dumps(manifest, indent=1, sort_keys=True, allow_nan=False).encode()
        members = {
            _MANIFEST: text,
            _DIGEST: _sha256(text).encode(),
            **{f"{name}.npy": content for name, content in contents.items()},
        }
        with (
            atomic_path(path) as temporary,
            zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
        ):
            for name, content in members.items():
                archive.writestr(zipfile.ZipInfo(name, _EPOCH), content, zipfile.ZIP_DEFLATED)

    @classmethod
    def load(cls, path: Path) -> "Artefact":
        """Read a file.

        Raises
        ------
        InputError
            No such file, not a model, damaged or changed, written by a newer version, or too
            large when unpacked.
        """
        try:
            with zipfile.ZipFile(path) as archive:
                return _read(archive, path)
        except InputError:
            raise
        except FileNotFoundError:
            raise InputError(f"{path}: no such file; expected a model ({SUFFIX})") from None
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
        except Exception as error:  # a damaged archive makes zipfile raise nearly anything
            reason = " ".join(str(error).split())[:_LONGEST_REASON]
            raise InputError(
                f"{path}: not a model file, or damaged ({type(error).__name__}: {reason})"
            ) from None


def _read(archive: zipfile.ZipFile, path: Path) -> Artefact:
    members = archive.infolist()
    size = sum(member.file_size for member in members)
    if size > _MAX_BYTES or len(members) > _MAX_MEMBERS:
        raise InputError(
            f"{path}: {len(members)} members of {size >> 20} MiB, expected a model of at most "
            f"{_MAX_MEMBERS} and {_MAX_BYTES >> 20} MiB"
        )
    text = _content(archive, _MANIFEST)
    try:
        manifest = json.loads(text)
    except ValueError:
        raise InputError(f"{path}: damaged or changed: {_MANIFEST} is not JSON") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise InputError(f"{path}: not a model file, or damaged: {_MANIFEST} of another format")
    version = manifest.get("format_version")
    if not isinstance(version, int) or version < 1:
        raise InputError(f"{path}: not a model file: format version {version!r:.40}")
    if version > FORMAT_VERSION:
        raise InputError(
            f"{path}: has format version {version}, this program reads up to {FORMAT_VERSION}; "
            "expected an older file, or upgrade seqsearch"
        )
    if _content(archive, _DIGEST).decode("ascii", "replace") != _sha256(text):
        raise InputError(f"{path}: damaged or changed: {_MANIFEST} does not match its checksum")
    _check_manifest(manifest, path)
    arrays = {}
    for name, digest in manifest["arrays"].items():
        content = _content(archive, f"{name}.npy")
        if _sha256(content) != digest:
            raise InputError(f"{path}: damaged or changed: {name} does not match its checksum")
        try:
            arrays[name] = _array(content)
        except ValueError as error:
            raise InputError(f"{path}: {name}: not an array ({error})") from None
    return Artefact(
        kind=manifest["kind"],
        feature_set=manifest["feature_set"],
        features=tuple(manifest["features"]),
        units=tuple(manifest["units"]),
        arrays=arrays,
        config=manifest["config"],
        metrics=manifest["metrics"],
        provenance=manifest["provenance"],
    )


def _content(archive: zipfile.ZipFile, name: str) -> bytes:
    """Return a member, of which no more is unpacked than the archive says that there is."""
    size = archive.getinfo(name).file_size
    with archive.open(name) as member:
        return member.read(size + 1)


def _check_manifest(manifest: dict[str, Any], path: Path) -> None:
    """Check the types of what the manifest says.

    Raises
    ------
    InputError
        An entry is missing or of another type.
    """
    kinds = {
        "kind": str,
        "feature_set": str,
        "features": list,
        "units": list,
        "arrays": dict,
        "config": dict,
        "metrics": dict,
        "provenance": dict,
    }
    for name, kind in kinds.items():
        if not isinstance(manifest.get(name), kind):
            raise InputError(f"{path}: {_MANIFEST}: no {name}, expected one")
    words = [*manifest["features"], *manifest["units"], *manifest["arrays"].values()]
    if not all(isinstance(word, str) for word in words):
        raise InputError(f"{path}: {_MANIFEST}: features, units and checksums, expected words")
    if len(manifest["features"]) != len(manifest["units"]):
        raise InputError(
            f"{path}: {_MANIFEST}: {len(manifest['features'])} features and "
            f"{len(manifest['units'])} units, expected as many"
        )


def _array(content: bytes) -> NDArray[Any]:
    """Return a ``.npy``, read-only; nothing is allocated before its header is known to be true.

    Raises
    ------
    ValueError
        It is no array of numbers or words, its size is another than its header says, or it has
        numbers that are not finite.
    """
    stream = io.BytesIO(content)
    if np.lib.format.read_magic(stream) != (1, 0):
        raise ValueError("another version than 1.0")
    shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
    if dtype.kind not in _KINDS:
        raise ValueError(f"of type {dtype}")
    if min(shape, default=0) < 0 or (
        math.prod(shape) * dtype.itemsize != len(content) - stream.tell()
    ):
        raise ValueError(f"shape {shape} does not fit its size")
    array = np.load(io.BytesIO(content), allow_pickle=False)
    if dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError("numbers that are not finite")
    array.flags.writeable = False
    return np.asarray(array)


def _npy(array: NDArray[Any]) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=False)
    return stream.getvalue()


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()

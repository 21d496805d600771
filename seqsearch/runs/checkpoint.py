"""Checkpoints: a search on disk, one file a rank, each complete or absent.

The folder ``checkpoints`` of a run holds ``origin.ckpt``, how the run was begun,
and one file for each rank with what that rank added: nodes of the tree with
their legs, counters, the nodes that wait, and the state of the random stream. A
file names the digest of the one before it, so that files of two runs cannot be
mixed.

A file is a line with format and version, a line with the SHA-256 of the rest,
and the rest in msgpack. Nothing in it is executed on reading.
"""

import hashlib
import json
import typing
from pathlib import Path
from typing import Any, Final, Self, TypeVar, final

import msgspec
import numpy as np
from numpy.typing import NDArray

from feasibility import InputError
from feasibility.orbits import Catalogue
from feasibility.runtime.atomic import atomic_path
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.scouting.pool import Pool
from seqsearch.beam.state import SearchState
from seqsearch.core.nodes import Nodes
from seqsearch.core.tree import FlownLeg, SearchTree
from seqsearch.settings import SearchSettings

FOLDER: Final = "checkpoints"
"""Name of the folder inside a run folder."""

_FORMAT: Final = "seqsearch checkpoint"
_VERSION: Final = 3
_ORIGIN: Final = "origin.ckpt"
_T = TypeVar("_T")


@final
class Origin(msgspec.Struct, frozen=True, kw_only=True):
    """How a run was begun.

    Attributes
    ----------
    seed : int
        Seed of the search.
    time_limit_s : float or None
        Budget of wall-clock time.
    max_solves : int or None
        Budget of full optimisations.
    config_sha256, catalogue_sha256 : str
        Digests of the text of ``config.toml`` and of the asteroid table, see
        `catalogue_digest`.
    """

    seed: int
    time_limit_s: float | None
    max_solves: int | None
    config_sha256: str
    catalogue_sha256: str


class _Node(msgspec.Struct, frozen=True, array_like=True):
    """A node of the tree: by the legs that lead to it from its parent, or a start."""

    parent: int
    legs: tuple[FlownLeg, ...]
    start: tuple[int, float, float] | None


class _Rank(msgspec.Struct, frozen=True, kw_only=True):
    """What one rank added to a `SearchState`, and what replaces its other members.

    `pool` is None where it is the one of the rank before; `closing` completes the tour that
    the best node ends.
    """

    previous: str
    nodes: list[_Node]
    counters: list[RankCounters]
    settings: SearchSettings
    pass_number: int
    waiting: Nodes | None
    pool: Pool | None
    guide: Nodes | None
    rng_state: str
    best_node: int
    best_key: tuple[int, float]
    closing: tuple[FlownLeg, ...]
    spent_s: float
    solves: int


@final
class Checkpoints:
    """The checkpoints of one run: appends one for each rank.

    Use `begin` for a new run and `load` for one that is there.

    Attributes
    ----------
    path : Path
        The folder.
    origin : Origin
        How the run was begun.
    """

    def __init__(self, path: Path, origin: Origin) -> None:
        self.path = path
        self.origin = origin
        self._files = 0
        self._nodes = 0
        self._counters = 0
        self._pool: Pool | None = None
        self._digest = ""

    @classmethod
    def begin(cls, run: Path, origin: Origin, state: SearchState) -> Self:
        """Make the folder inside a run folder and save the state before the first rank.

        Raises
        ------
        InputError
            It cannot be written.
        """
        path = run / FOLDER
        try:
            path.mkdir()
        except OSError as error:
            raise InputError(f"{path}: cannot be created ({error.strerror})") from None
        checkpoints = cls(path, origin)
        checkpoints._digest = _write(path / _ORIGIN, origin)
        checkpoints.save(state)
        return checkpoints

    def save(self, state: SearchState) -> None:
        """Append what is new since the last call.

        Raises
        ------
        InputError
            The file cannot be written; those before are intact.
        """
        graph = state.tree.graph
        rank = _Rank(
            previous=self._digest,
            nodes=[_node(state.tree, node) for node in range(self._nodes, len(graph))],
            counters=state.counters[self._counters :],
            settings=state.settings,
            pass_number=state.pass_number,
            waiting=state.waiting,
            pool=None if state.pool is self._pool else state.pool,
            guide=state.guide,
            rng_state=json.dumps(state.rng_state, default=_plain),
            best_node=state.best_node,
            best_key=state.best_key,
            closing=state.closing,
            spent_s=state.spent_s,
            solves=state.solves,
        )
        name = f"{self._files:06}-pass-{state.pass_number}-rank-{_rank_number(state)}.ckpt"
        self._digest = _write(self.path / name, rank)
        self._files += 1
        self._pool = state.pool
        self._nodes, self._counters = len(graph), len(state.counters)

    @classmethod
    def load(
        cls, run: Path, after: tuple[int, int] | None = None
    ) -> "tuple[Checkpoints, SearchState]":
        """Read the checkpoints of a run folder.

        Parameters
        ----------
        run : Path
            The run folder.
        after : tuple of int, optional
            Pass and rank after which to go on; default: the last that there is.

        Returns
        -------
        checkpoints : Checkpoints
            Appends after that rank.
        state : SearchState
            The state after that rank.

        Raises
        ------
        InputError
            No checkpoints, no such rank, or a file that is damaged, changed,
            of another version or of another run.
        """
        path = run / FOLDER
        origin, digest = _read(path / _ORIGIN, Origin)
        files = _rank_files(path)
        if after is not None:
            ends = [i for i, file in enumerate(files) if _pass_and_rank(file) == after]
            if not ends:
                known = f"{_label(files[0])} to {_label(files[-1])}" if files else "none"
                raise InputError(
                    f"{path}: no checkpoint of pass and rank {after[0]}:{after[1]}; "
                    f"there are {known}"
                )
            files = files[: ends[-1] + 1]
        checkpoints = cls(path, origin)
        state = SearchState(settings=SearchSettings())
        for file in files:
            rank, this = _read(file, _Rank)
            if rank.previous != digest or file.name.split("-")[0] != f"{checkpoints._files:06}":
                raise InputError(
                    f"{file}: does not follow the checkpoint before it; "
                    "a file is missing or from another run"
                )
            digest = this
            checkpoints._files += 1
            _apply(rank, state, file)
        if not files:
            raise InputError(f"{path}: no checkpoint to go on from")
        checkpoints._nodes, checkpoints._counters = len(state.tree), len(state.counters)
        checkpoints._digest = digest
        checkpoints._pool = state.pool
        return checkpoints, state

    def discard_later(self) -> None:
        """Delete the files of ranks after the one that was loaded."""
        for file in _rank_files(self.path)[self._files :]:
            file.unlink()


def catalogue_digest(catalogue: Catalogue) -> str:
    """Return the SHA-256 of ids, epochs and elements of a catalogue, and of how it moves."""
    digest = hashlib.sha256()
    for column in (catalogue.ids, catalogue.epoch_mjd2000, catalogue.elements):
        digest.update(np.ascontiguousarray(column).tobytes())
    if catalogue.ephemeris is not None:
        digest.update(catalogue.ephemeris.digest.encode())
    return digest.hexdigest()


def _apply(rank: _Rank, state: SearchState, file: Path) -> None:
    """Bring a state up to the end of a rank."""
    for node in rank.nodes:
        if node.start is not None:
            state.tree.add_start(*node.start)
        elif 0 <= node.parent < len(state.tree):
            state.tree.add_hop(node.parent, node.legs)
        else:
            raise InputError(f"{file}: damaged: a node has no parent in the tree")
    state.counters += rank.counters
    state.settings = rank.settings
    state.pass_number = rank.pass_number
    state.waiting = rank.waiting
    state.pool = rank.pool or state.pool
    state.guide = rank.guide
    state.rng_state = json.loads(rank.rng_state)
    state.best_node = rank.best_node
    state.best_key = rank.best_key
    state.closing = rank.closing
    state.spent_s = rank.spent_s
    state.solves = rank.solves


def _node(tree: SearchTree, node: int) -> _Node:
    parents = list(tree.graph.predecessors(node))
    if parents:
        return _Node(parents[0], tree.graph.edges[parents[0], node]["legs"], None)
    start = tree.node(node)
    return _Node(-1, (), (start["row"], start["t_mjd2000"], start["mass"]))


def _rank_files(path: Path) -> list[Path]:
    return sorted(path.glob("[0-9]*-pass-*-rank-*.ckpt"))


def _pass_and_rank(file: Path) -> tuple[int, int]:
    parts = file.stem.split("-")
    return int(parts[2]), int(parts[4])


def _label(file: Path) -> str:
    return ":".join(map(str, _pass_and_rank(file)))


def _rank_number(state: SearchState) -> int:
    """Return the rank of this pass that was finished last; 0 before the first."""
    last = state.counters[-1] if state.counters else None
    return 0 if last is None or last.pass_number != state.pass_number else last.rank


def _write(path: Path, record: Origin | _Rank) -> str:
    """Write a file and return its digest."""
    content = msgspec.msgpack.encode(record, enc_hook=_packed)
    digest = hashlib.sha256(content).hexdigest()
    with atomic_path(path) as temporary:
        temporary.write_bytes(f"{_FORMAT} {_VERSION}\n{digest}\n".encode() + content)
    return digest


def _read(path: Path, kind: type[_T]) -> tuple[_T, str]:
    """Read a file and return its record and digest."""
    try:
        head, stored, content = path.read_bytes().split(b"\n", 2)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); expected the checkpoint of a run"
        ) from None
    except ValueError:
        raise InputError(f"{path}: no checkpoint, or cut off") from None
    if head != f"{_FORMAT} {_VERSION}".encode():
        found = head[:40].decode("ascii", "replace")
        raise InputError(
            f"{path}: written by another version ({found!r}); this program reads "
            f"'{_FORMAT} {_VERSION}'"
        )
    digest = hashlib.sha256(content).hexdigest()
    if digest.encode() != stored:
        raise InputError(f"{path}: damaged or changed: does not match its checksum")
    try:
        return msgspec.msgpack.decode(content, type=kind, dec_hook=_unpacked), digest
    except (msgspec.DecodeError, ValueError, TypeError) as error:
        raise InputError(f"{path}: written by another version ({error})") from None


def _packed(value: Any) -> Any:
    """Turn what msgpack does not know into what it knows."""
    if isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        return array.dtype.str, array.shape, array.tobytes()
    return _plain(value)


def _plain(value: Any) -> Any:
    """Turn arrays and numbers of numpy into lists and numbers."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"cannot be saved: {type(value).__name__}")


def _unpacked(kind: type, value: Any) -> NDArray[Any]:
    if typing.get_origin(kind) is not np.ndarray:
        raise TypeError(f"unknown kind {kind}")
    dtype, shape, content = value
    return np.frombuffer(content, dtype=dtype).reshape(shape).copy()

"""What ``feasibility generate`` does: check, make the missing shards, report."""

import importlib
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from feasibility.dataset.generate import Generation, begin
from feasibility.dataset.protocol import read_protocol
from feasibility.errors import InputError, MissingDependencyError
from feasibility.runtime.workers import default_workers, worker_pool
from feasibility.sims_flanagan.fast.compilation import compile_kernels


def run_generate(
    protocol_name: str,
    *,
    legs: int,
    out: Path,
    seed: int,
    workers: int | None,
    catalogue: str | None,
    scheduler: str | None,
) -> int:
    """Generate or complete a dataset as the command line asks for it; return the exit code.

    0: complete; 1: a worker died; 130: interrupted. After 1 and 130 the same
    command goes on from the finished shards.

    Raises
    ------
    InputError
        Anything in the input that cannot be used, an unwritable folder, a full disk.
    MissingDependencyError
        pyarrow, or for a scheduler dask, is not installed.
    """
    if workers is not None and workers < 1:
        raise InputError(f"--workers {workers}: expected one or more")
    protocol = read_protocol(protocol_name)
    if catalogue is not None:
        protocol = protocol.with_catalogue(catalogue)
    generation = begin(protocol, legs, out, seed=seed)
    missing = generation.legs_missing
    print(
        f"{protocol.name}: {legs} legs, seed {seed}, in {out}"
        + (f" ({legs - missing} are there already)" if missing < legs else ""),
        flush=True,
    )
    began = time.perf_counter()
    done = 0

    def on_shard(rows: int) -> None:
        nonlocal done
        done += rows

    try:
        with _executor(min(workers or default_workers(), len(generation.tasks)), scheduler) as (
            executor,
            in_flight,
        ):
            _run(generation, executor, in_flight, on_shard)
    except KeyboardInterrupt:
        print(_unfinished("interrupted", legs - missing + done, legs), file=sys.stderr)
        return 130
    except BrokenExecutor:
        print(_unfinished("a worker process died", legs - missing + done, legs), file=sys.stderr)
        return 1
    seconds = time.perf_counter() - began
    if done:
        print(f"{done} legs in {seconds:.1f} s, {done / seconds:.0f} legs/s")
    print(f"look at it with: feasibility inspect {out}")
    return 0


def _run(
    generation: Generation,
    executor: Executor | None,
    in_flight: int,
    on_shard: Callable[[int], None],
) -> None:
    from tqdm import tqdm

    # disable=None: silent where stderr is no terminal.
    with tqdm(
        total=generation.legs,
        initial=generation.legs - generation.legs_missing,
        unit=" legs",
        disable=None,
    ) as bar:

        def tell(rows: int) -> None:
            on_shard(rows)
            bar.update(rows)

        generation.run(executor, in_flight=in_flight, on_shard=tell)


def _unfinished(what: str, done: int, legs: int) -> str:
    return f"feasibility: {what}; {done} of {legs} legs are written, the same command goes on"


@contextmanager
def _executor(workers: int, scheduler: str | None) -> Iterator[tuple[Executor | None, int]]:
    """Yield the executor and how many shards to have at work on it."""
    if scheduler is None:
        compile_kernels()
        with worker_pool(max(workers, 1)) as pool:
            yield pool, 2 * workers
        return
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise MissingDependencyError(
            "--scheduler needs dask, which is not installed; pip install 'seqsearch[dask]'"
        ) from None
    try:
        client = distributed.Client(scheduler, timeout=5)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {scheduler}: no Dask scheduler there ({error})") from None
    with client:
        threads = sum(client.nthreads().values())
        yield client.get_executor(), 2 * max(threads, 1)

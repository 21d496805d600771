"""The command ``feasibility generate``: check, make the missing shards, report."""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from feasibility.commands.options import add_common, one_or_more
from feasibility.runtime.cluster import cluster
from feasibility.runtime.workers import default_workers, worker_pool

if TYPE_CHECKING:
    from feasibility.dataset import Generation

_DESCRIPTION: Final = """\
Draw legs and label each with its maximum initial mass m*: the leg can be flown
with every initial mass up to m*. The result is a folder of Parquet files with
a metadata.json that says how it was made and what each column means.

The rows depend on the protocol, the catalogue and the seed alone, not on the
number of workers; a larger dataset begins with the rows of a smaller one.
Run the command again to go on after an interruption, or with more --legs to
enlarge a dataset.
"""


def add_parser(commands: Any) -> None:
    """Add the command to the parser's sub-commands."""
    parser = commands.add_parser(
        "generate",
        help="draw and label legs",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("protocol", help="name of a built-in protocol, or a TOML file")
    parser.add_argument("--legs", type=one_or_more, required=True, metavar="N", help="rows in all")
    parser.add_argument("--out", required=True, metavar="DIR", help="folder of the dataset")
    add_common(parser, seed="the draws")
    parser.add_argument(
        "--catalogue", metavar="FILE", help="asteroid table (default: a synthetic main belt)"
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="use a running Dask cluster, such as tcp://host:8786, instead of own processes",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Do what the command line asks for and return the exit code.

    0: complete; 1: a worker died; 130: interrupted. After 1 and 130 the same
    command goes on from the finished shards.

    Raises
    ------
    InputError
        Anything in the input that cannot be used, an unwritable folder, a full disk.
    MissingDependencyError
        pyarrow, or for a scheduler dask, is not installed.
    """
    from feasibility.dataset import begin, read_protocol

    legs, seed, out = options.legs, options.seed, Path(options.out)
    protocol = read_protocol(options.protocol)
    if options.catalogue is not None:
        protocol = protocol.with_catalogue(options.catalogue)
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
        workers = min(options.workers or default_workers(), len(generation.tasks))
        with _executor(workers, options.scheduler) as (executor, in_flight):
            _make(generation, executor, in_flight, on_shard)
    except KeyboardInterrupt:
        print(_unfinished("interrupted", legs - missing + done, legs), file=sys.stderr)
        return 130
    except BrokenExecutor as error:
        print(_unfinished(str(error), legs - missing + done, legs), file=sys.stderr)
        return 1
    seconds = time.perf_counter() - began
    if done:
        print(f"{done} legs in {seconds:.1f} s, {done / seconds:.0f} legs/s")
    print(f"look at it with: feasibility inspect {out}")
    return 0


def _make(
    generation: "Generation",
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
        from feasibility.sims_flanagan.fast.compilation import compile_kernels

        compile_kernels()
        with worker_pool(max(workers, 1)) as pool:
            yield pool, 2 * workers
        return
    with cluster(scheduler, ("feasibility",)) as executor:
        yield executor, 2 * executor.threads

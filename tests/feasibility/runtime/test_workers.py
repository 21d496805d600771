"""The pool of workers: it mends itself, and gives up in the end; threads; how many of each."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import CancelledError, wait
from pathlib import Path

import pytest

from feasibility.runtime import workers
from feasibility.runtime.workers import (
    MendingPool,
    WorkersLostError,
    default_workers,
    in_threads,
    worker_pool,
)


@pytest.fixture
def pool():
    with worker_pool(2) as pool:
        yield pool


def _square(x):
    return x * x


def _die_once(marker, x):
    if not Path(marker).exists():
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def _die():
    os.kill(os.getpid(), signal.SIGKILL)


def _fail():
    raise ValueError("mine")


def test_calls_survive_a_killed_worker(pool, tmp_path):
    futures = [pool.submit(_square, x) for x in range(20)]
    futures.append(pool.submit(_die_once, str(tmp_path / "died"), -1))
    futures += [pool.submit(_square, x) for x in range(20)]
    expected = [x * x for x in range(20)]
    assert [future.result(60) for future in futures] == [*expected, -1, *expected]
    assert pool.mended == 1


def test_a_call_that_always_kills_its_worker_is_given_up(pool):
    with pytest.raises(WorkersLostError, match="died 3 times"):
        pool.submit(_die).result(60)
    assert pool.submit(_square, 3).result(60) == 9


def test_exceptions_of_the_call_pass_through(pool):
    with pytest.raises(ValueError, match="mine"):
        pool.submit(_fail).result(60)
    assert pool.mended == 0


def test_a_cancelled_call_is_not_begun(pool):
    blockers = [pool.submit(time.sleep, 0.5) for _ in range(4)]
    futures = [pool.submit(time.sleep, 60) for _ in range(4)]
    assert all(future.cancel() for future in futures)
    wait(blockers, timeout=60)
    with pytest.raises(CancelledError):
        futures[0].result(0)
    assert pool.submit(_square, 2).result(60) == 4


def test_after_its_end_the_pool_takes_no_calls():
    pool = MendingPool(2)
    pool.shutdown()
    with pytest.raises(RuntimeError):
        pool.submit(_square, 1)


@pytest.mark.parametrize("threads", [1, 3])
def test_threads_answer_in_order_with_few_items_under_way(threads):
    begun = []

    def items():
        for k in range(20):
            begun.append(k)
            yield k

    answers = in_threads(_square, items(), threads)
    assert next(answers) == 0
    assert len(begun) <= 2 * threads + 1
    assert list(answers) == [k * k for k in range(1, 20)]


@pytest.mark.parametrize(
    ("text", "processors"),
    [
        ("max 100000", None),
        ("200000 100000", 2),
        ("150000 100000", 2),
        ("1000 100000", 1),
        ("", None),
    ],
)
def test_a_container_with_a_limit_counts_as_fewer_processors(tmp_path, text, processors):
    file = tmp_path / "cpu.max"
    file.write_text(text + "\n")
    limit = workers._container_limit(file)
    assert limit == processors or (processors is None and limit > 10_000)
    assert workers._container_limit(tmp_path / "none") > 10_000


def test_a_process_pinned_to_one_processor_starts_one_worker(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3}, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    assert default_workers() == 1


UNGUARDED = """
from feasibility.runtime.workers import worker_pool
with worker_pool(2) as pool:
    print(pool.submit(pow, 2, 5).result(60))
"""


def test_a_program_without_a_main_guard_is_told_so_in_one_line(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(UNGUARDED)
    done = subprocess.run(
        [sys.executable, str(program)], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 1
    assert done.stdout == ""
    # One traceback, that of the first process.
    assert done.stderr.count("Traceback") == 1 + done.stderr.count("direct cause")
    assert "if __name__ == '__main__':" in done.stderr.splitlines()[-1]
    assert "WorkersLostError" in done.stderr.splitlines()[-1]


def test_a_program_from_standard_input_needs_no_guard():
    done = subprocess.run(
        [sys.executable, "-"],
        input=UNGUARDED,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.stdout == "32\n", done.stderr
    assert done.stderr == ""

"""Commands that are killed at random moments, sometimes beside a second process on one folder."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np


def command(program: str, *arguments: object) -> list[str]:
    """Return a command line that runs ``seqsearch`` or ``feasibility`` in this interpreter."""
    code = f"import sys; from {program}.commands.cli import main; sys.exit(main())"
    return [sys.executable, "-c", code, *map(str, arguments)]


def finished(line: list[str]) -> float:
    """Run a command to its end, which must be a good one, and return how long it took."""
    began = time.monotonic()
    done = subprocess.run(line, check=False, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr[-2000:]
    return time.monotonic() - began


def killed(line: list[str], after_s: float, *, twice: bool) -> bool:
    """Start a command, kill it and its children after a while; tell whether it was too late.

    Where `twice`, the same command is started a second time meanwhile. It must either see that
    the folder is in use, with one line, or be killed as well.
    """
    processes = [_started(line)]
    end = time.monotonic() + after_s
    if twice:
        time.sleep(after_s * 0.5)
        processes.append(_started(line))
    while time.monotonic() < end and processes[0].poll() is None:
        time.sleep(0.01)
    late = processes[0].poll() is not None
    for process in processes:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        error = process.communicate()[1]
        assert process.returncode in (0, 2, -signal.SIGKILL), error
        assert "Traceback" not in error
        if process.returncode == 2:
            assert len(error.strip().splitlines()) == 1, error
    return late


def killed_often(
    next_line: Callable[[], list[str]], whole_s: float, kills: int, rng: np.random.Generator
) -> int:
    """Kill a command several times at random moments, then let it end; return how often.

    Parameters
    ----------
    next_line : callable
        Returns the command with which a user would go on.
    whole_s : float
        How long an undisturbed run takes.
    kills : int
        How often to kill, in a third of the cases beside a second process.
    rng : numpy.random.Generator
        Draws the moments.
    """
    count = 0
    for k in range(kills):
        if killed(next_line(), rng.uniform(0.1, 0.8) * whole_s, twice=k % 3 == 2):
            return count
        count += 1
    finished(next_line())
    return count


def _started(line: list[str]) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        line,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )

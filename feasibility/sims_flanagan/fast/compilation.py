"""Compile the fast solver's kernels before worker processes start, on two cores if there are."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import numpy as np

from feasibility.constants import AU, EARTH_VELOCITY
from feasibility.legs import Legs
from feasibility.runtime.workers import usable_processors
from feasibility.sims_flanagan.fast.solver import fast_max_initial_mass, fast_min_propellant

_LONGEST_WAIT_S: Final = 120.0


def prefer_fast_compilation() -> None:
    """Ask numba for LLVM's level 1, unless the user's environment says otherwise.

    Measured: a fifth less compilation time, and the kernels run as fast. For
    our own programs, before numba is loaded: a library must not decide this.
    """
    os.environ.setdefault("NUMBA_OPT", "1")


def compile_kernels() -> None:
    """Compile and cache every kernel of the fast solver, or load it from the cache.

    Without it, workers that start with an empty cache would all compile the
    same kernels at the same time. Costs about a second where the cache is
    there: kernels are loaded, and pykep imported to confirm the solution.

    Where something has to be compiled and a second core is free to this process, another
    process compiles half of it; the two meet in numba's cache on disk. They may
    compile a kernel both, and the other may die: this one then compiles more.
    """
    from feasibility.runtime.jit import rare_collections

    with rare_collections():
        with _second_process() as other:
            _compile_first_half()
            if other:
                _wait(other[0])
        for legs in (sample_leg(), sample_leg(vinf_arr=1000.0)):
            heaviest = fast_max_initial_mass(legs)
            # A light leg, which passes through all kernels.
            fast_min_propellant(legs.with_m0(0.1 * heaviest.m0), guess=heaviest)


def compile_second_half() -> None:
    """Compile what needs the least of the other half; in the order in which that needs it."""
    from feasibility.runtime.jit import rare_collections
    from feasibility.sims_flanagan.fast.arc_kernels import close
    from feasibility.sims_flanagan.fast.free_propellant_kernels import free_minimum_batch
    from feasibility.sims_flanagan.fast.newton_kernels import polish
    from feasibility.sims_flanagan.fast.propellant_kernels import minimum_batch
    from feasibility.sims_flanagan.fast.restart_kernels import minimum_restarts

    w, six, impulses, batch = _examples()
    with rare_collections():
        _compile(close, six, impulses, 2, six, 1.0, 1, w)
        _compile(polish, six, impulses, 2, 1, 1.0, six, w)
        rows, numbers = batch
        throttles = np.zeros((1, 2, 3))
        leg = (rows, rows, numbers, numbers, numbers, 2, 1.0, throttles, numbers)
        _compile(minimum_batch, *leg)
        whole = np.zeros(1, dtype=np.int64)
        _compile(minimum_restarts, *leg, whole)
        ends = (numbers, numbers, numbers, np.zeros(1, dtype=np.bool_))
        found = (throttles, numbers, np.zeros((1, 2, 3)), whole)
        _compile(free_minimum_batch, rows, rows, numbers, numbers, *ends, 2, 1.0, *found)


def _compile_first_half() -> None:
    from feasibility.sims_flanagan.fast.dual_kernels import least_thrust
    from feasibility.sims_flanagan.fast.free_kernels import free_maximum_batch
    from feasibility.sims_flanagan.fast.lifted_kernels import advance, lifted_sweep
    from feasibility.sims_flanagan.fast.maximum_kernels import maximum_batch

    w, six, impulses, (rows, numbers) = _examples()
    nodes = w.n6[0]
    _compile(least_thrust, w.b[0], six, 2, 1, 1.0, six, 1.0, impulses, impulses, w)
    _compile(
        lifted_sweep,
        *(six, six, 1.0, 2, 1, 1.0, True, True, nodes, impulses, 1.0, six, w),
    )
    _compile(advance, nodes, impulses, 2, 1.0, 1, w)
    paths = (2, 1.0, np.zeros((1, 5, 3)), np.zeros((1, 1, 5, 3)))
    found = (np.zeros((1, 2, 3)), numbers, np.zeros(1, dtype=np.int64), numbers)
    _compile(maximum_batch, rows, rows, numbers, numbers, *paths, *found)
    ends = (numbers, numbers)
    _compile(
        *(free_maximum_batch, rows, rows, numbers, numbers, *ends, *paths, *found),
        np.zeros((1, 2, 3)),
    )


def _examples() -> tuple[Any, Any, Any, tuple[Any, Any]]:
    """Return a workspace, a 6-vector, impulses, and columns of a batch, for their types alone."""
    from feasibility.sims_flanagan.fast.workspace_kernels import Workspace

    four, three, two = np.zeros((1, 1, 1, 1)), np.zeros((1, 1, 1)), np.zeros((1, 1))
    workspace = Workspace(three, three, four, three, two, two, two)
    return workspace, np.zeros(6), np.zeros((2, 3)), (np.zeros((1, 6)), np.zeros(1))


def _compile(kernel: Any, *arguments: object) -> None:
    """Compile a kernel for arguments like these; it is not called."""
    import numba

    type_of: Any = numba.typeof
    kernel.compile(tuple(type_of(argument) for argument in arguments))


@contextmanager
def _second_process() -> Iterator[list["subprocess.Popen[bytes]"]]:
    """Start another process that compiles the second half, once something is compiled here."""
    from numba.core import event

    started: list[subprocess.Popen[bytes]] = []

    class Starter(event.Listener):
        def on_start(self, _: Any) -> None:
            if not started and usable_processors() > 1:
                started.append(_start())

        def on_end(self, _: Any) -> None:
            """One process is enough."""

    install: Any = event.install_listener
    with install("numba:compile", Starter()):
        try:
            yield started
        finally:
            for process in started:
                process.kill()
                process.wait()


def _start() -> "subprocess.Popen[bytes]":
    # Not a pool's process: that would run the main program's file once more.
    return subprocess.Popen(
        [sys.executable, "-c", f"import {__name__} as p; p.compile_second_half()"],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        # This process announces the compilation for both.
        stderr=subprocess.DEVNULL,
    )


def _wait(process: "subprocess.Popen[bytes]") -> None:
    try:
        process.wait(_LONGEST_WAIT_S)
    except subprocess.TimeoutExpired:
        process.kill()


def sample_leg(vinf_arr: float = 0.0) -> Legs:
    """Return one leg that can be flown, for a first call of anything that looks at legs.

    `vinf_arr`, in m/s, makes it one with a free end.
    """
    circular = EARTH_VELOCITY / np.sqrt(2.5)
    angle = np.radians(70.0)
    return Legs(
        rv_dep=[2.5 * AU, 0.0, 0.0, 0.0, circular, 0.0],
        rv_arr=[
            *(2.55 * AU * np.cos(angle), 2.55 * AU * np.sin(angle), 0.02 * AU),
            *(-circular * np.sin(angle), circular * np.cos(angle), 0.0),
        ],
        tof_days=280.0,
        m0=500.0,
        thrust=0.5,
        isp=3000.0,
        m_dry=0.0,
        vinf_arr=vinf_arr,
    )

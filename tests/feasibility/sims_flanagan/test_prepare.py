"""Preparing the kernels once is enough for every worker, and two processes share it."""

import os
import subprocess
import sys

import pytest
from numba.core import event

from feasibility.runtime.workers import usable_processors
from feasibility.sims_flanagan.fast import compilation as prepare

PROGRAM = """
import numpy as np
from numba.core import event
from feasibility import Legs, max_initial_mass, optimise
from feasibility.orbits import synthetic_main_belt
from feasibility.sims_flanagan.fast.compilation import compile_kernels

with event.install_recorder("numba:compile") as before:
    compile_kernels()
belt = synthetic_main_belt(50, np.random.default_rng(1))
tof = np.linspace(200.0, 900.0, 20)
start, end = belt.states_at(np.arange(20), 8000.0), belt.states_at(np.arange(20, 40), 8000.0 + tof)
leg = (start, end, tof, 300.0, 0.5, 3000.0, 0.0)
with event.install_recorder("numba:compile") as after:
    for ends in ((0.0, 0.0), (2000.0, 0.0), (0.0, np.inf)):
        legs = Legs(*leg, vinf_dep=ends[0], vinf_arr=ends[1])
        optimise(legs.with_m0(np.minimum(max_initial_mass(legs), 1e6) * 0.9 + 51.0))
print(len(after.buffer))
for _, each in before.buffer:
    kernel = each.data["dispatcher"]
    if each.is_start and kernel.__module__.startswith("feasibility"):
        print(kernel.__module__ + "." + kernel.__name__)
"""


@pytest.mark.slow
def test_after_preparing_no_leg_compiles_anything(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=environment,
        check=True,
        capture_output=True,
        text=True,
    )
    after, *kernels = done.stdout.split()
    assert int(after) == 0
    # A second time would be for other types: the first was for none that is ever used.
    assert len(set(kernels)) == len(kernels) > 0
    assert done.stderr.count("compiling numeric kernels") == 1
    if usable_processors() > 1:
        names = {kernel.rpartition(".")[2] for kernel in kernels}
        assert "maximum_batch" in names
        assert "free_maximum_batch" in names
        assert not {"polish", "minimise_one", "minimum_batch", "free_minimum_batch"} & names


def test_what_the_other_process_compiles_is_what_the_solver_calls():
    from feasibility.sims_flanagan.fast.free_kernels import free_maximum_batch
    from feasibility.sims_flanagan.fast.free_propellant_kernels import free_minimum_batch
    from feasibility.sims_flanagan.fast.propellant_kernels import minimum_batch

    prepare.compile_second_half()
    prepare.compile_kernels()
    for batch in (minimum_batch, free_minimum_batch, free_maximum_batch):
        assert len(batch.signatures) == 1


def test_with_a_warm_cache_no_other_process_is_started(monkeypatch):
    prepare.compile_kernels()
    started = []
    monkeypatch.setattr(prepare, "_start", lambda: started.append(1))
    prepare.compile_kernels()
    assert started == []


def test_a_second_process_that_dies_at_once_does_no_harm(monkeypatch):
    monkeypatch.setattr(prepare, "usable_processors", lambda: 2)
    monkeypatch.setattr(
        prepare,
        "_start",
        lambda: subprocess.Popen([sys.executable, "-c", "import os; os._exit(1)"]),
    )
    with prepare._second_process() as other:
        with event.trigger_event("numba:compile", data={"dispatcher": None}):
            pass
        assert len(other) == 1
        prepare._wait(other[0])
    prepare.compile_kernels()

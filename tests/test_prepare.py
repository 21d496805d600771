"""Preparing the kernels once is enough for every worker."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import numpy as np
from numba.core import event
from feasibility import Legs, max_initial_mass, optimise
from feasibility.orbits import synthetic_main_belt
from feasibility.sims_flanagan.prepare import compile_kernels

with event.install_recorder("numba:compile") as before:
    compile_kernels()
belt = synthetic_main_belt(50, np.random.default_rng(1))
tof = np.linspace(200.0, 900.0, 20)
start, end = belt.states_at(np.arange(20), 8000.0), belt.states_at(np.arange(20, 40), 8000.0 + tof)
legs = Legs(start, end, tof, 300.0, 0.5, 3000.0, 0.0)
with event.install_recorder("numba:compile") as after:
    optimise(legs.with_m0(max_initial_mass(legs) * 0.9 + 1e-3))
print(len(before.buffer), len(after.buffer))
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
    before, after = map(int, done.stdout.split())
    assert before > 0
    assert after == 0

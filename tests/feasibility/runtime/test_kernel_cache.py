"""Compiled kernels are announced once, cached on disk and shared by processes."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import feasibility

PROGRAM = """
import numpy as np
from feasibility.orbits.kepler_kernels import propagate_batch, propagate_stm_batch
from feasibility.orbits.lambert import lambert
from feasibility.orbits.mima import mima, mima2
state = np.array([[1.0, 0, 0, 0, 1.0, 0]])
other = np.array([[0, 1.1, 0, -1.0, 0, 0.1]])
propagate_batch(state, np.ones(1), 1.0)
propagate_stm_batch(state, np.ones(1), 1.0)
lambert(state[:, :3], other[:, :3], [1.5], 1, 1.0)
mima(state, other, 1.5, 1.0, 1.0, mu=1.0)
mima2(state, other, 1.5, 1.0, 1.0, mu=1.0)
"""

CHEAP_PROGRAM = """
import numpy as np
from feasibility.orbits.kepler_kernels import propagate_batch
propagate_batch(np.array([[1.0, 0, 0, 0, 1.0, 0]]), np.ones(1), 1.0)
"""


def test_second_process_compiles_nothing(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    errors, seconds = [], []
    for _ in range(2):
        start = time.monotonic()
        result = subprocess.run(
            [sys.executable, "-c", PROGRAM],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        seconds.append(time.monotonic() - start)
        errors.append(result.stderr)
    assert errors[0].count("compiling numeric kernels") == 1
    assert errors[1] == ""
    assert seconds[1] < seconds[0] < 60


def test_a_changed_kernel_file_invalidates_the_kernels_of_all_files(tmp_path):
    package = tmp_path / "feasibility"
    shutil.copytree(
        Path(feasibility.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__")
    )
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    environment.pop("NUMBA_CACHE_DIR", None)

    def errors():
        command = [sys.executable, "-c", CHEAP_PROGRAM]
        done = subprocess.run(
            command, env=environment, cwd=tmp_path, check=True, capture_output=True, text=True
        )
        return done.stderr

    assert "compiling" in errors()
    assert errors() == ""
    other = package / "orbits" / "mima_kernels.py"
    other.write_text(other.read_text() + "\n# changed\n")
    assert "compiling" in errors()


NOWHERE_TO_WRITE = """
from numba.core import caching
caching.CacheImpl._locator_classes = [caching.UserProvidedCacheLocator]
"""


def run_program(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    clean = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    return subprocess.run(
        [sys.executable, "-c", code],
        env=clean | environment,
        capture_output=True,
        text=True,
        check=True,
    )


def test_without_a_writable_folder_kernels_are_cached_in_the_temporary_one(tmp_path):
    first, second = (
        run_program(NOWHERE_TO_WRITE + CHEAP_PROGRAM, TMPDIR=str(tmp_path)).stderr
        for _ in range(2)
    )
    assert first.count("no folder for compiled kernels") == 1
    assert str(tmp_path) in first
    assert "NUMBA_CACHE_DIR" in first
    assert "compiling" in first
    assert "compiling" not in second
    (folder,) = tmp_path.iterdir()
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_temporary_folder_that_others_may_write_to_is_not_trusted(tmp_path):
    run_program(NOWHERE_TO_WRITE + CHEAP_PROGRAM, TMPDIR=str(tmp_path))
    (folder,) = tmp_path.iterdir()
    shutil.rmtree(folder)
    folder.mkdir()
    folder.chmod(0o777)
    done = run_program(NOWHERE_TO_WRITE + CHEAP_PROGRAM, TMPDIR=str(tmp_path))
    assert "each process compiles them anew" in done.stderr
    assert not list(folder.iterdir())


def test_the_users_own_functions_are_not_moved_to_our_folder(tmp_path):
    code = (
        NOWHERE_TO_WRITE
        + CHEAP_PROGRAM
        + "import numba; print(repr(numba.config.CACHE_DIR), end='')"
    )
    assert run_program(code, TMPDIR=str(tmp_path)).stdout == "''"


def test_levels_of_optimisation_have_caches_of_their_own(tmp_path):
    said = [
        run_program(CHEAP_PROGRAM, NUMBA_CACHE_DIR=str(tmp_path), NUMBA_OPT=level).stderr
        for level in ("1", "3", "1", "3")
    ]
    assert ["compiling" in text for text in said] == [True, True, False, False]

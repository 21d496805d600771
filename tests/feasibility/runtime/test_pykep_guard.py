"""The pykep guard, seen from outside: each test is a process of its own."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

SHORT_RUN = """
import sys
from feasibility.runtime.pykep_guard import load_pykep
pykep = load_pykep()
import numba
import pygmo
leg = pykep.leg.sims_flanagan()
leg.throttles = [0.1] * 6
assert len(leg.compute_mismatch_constraints()) == 7
problem = pygmo.problem(pygmo.rosenbrock(3))
pygmo.algorithm(pygmo.nlopt("cobyla")).evolve(pygmo.population(problem, 1, seed=1))
"""

HIDE_PYKEP = """
import sys
from importlib.machinery import PathFinder
class WithoutPykep:
    @staticmethod
    def find_spec(name, path=None, target=None):
        return None if name.split(".")[0] == "pykep" else PathFinder.find_spec(name, path, target)
sys.meta_path[:] = [WithoutPykep if f is PathFinder else f for f in sys.meta_path]
"""


def run_python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )


@pytest.mark.parametrize("n_runs", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_short_runs_exit_with_their_own_code_never_with_an_abort(n_runs):
    # A run that ends with an exception tears down in another order: every second one does.
    endings = ["", "raise ValueError('the end')"]
    codes = [SHORT_RUN + endings[index % 2] for index in range(n_runs)]
    with ThreadPoolExecutor(2) as pool:
        exits = [run.returncode for run in pool.map(run_python, codes)]
    assert exits == [index % 2 for index in range(n_runs)]


def test_one_libheyoka_is_mapped():
    maps = SHORT_RUN + "print(*{line.split()[-1] for line in open('/proc/self/maps')}, sep='\\n')"
    run = run_python(maps)
    assert run.returncode == 0, run.stderr
    heyokas = [path for path in run.stdout.split() if "libheyoka" in path]
    assert len(heyokas) == 1


def test_print_options_of_numpy_are_unchanged():
    run = run_python(
        "import numpy as np\n"
        "np.set_printoptions(precision=3)\n"
        "before = np.get_printoptions()\n" + SHORT_RUN + "assert np.get_printoptions() == before\n"
    )
    assert run.returncode == 0, run.stderr


def test_stand_ins_do_not_stay_behind():
    run = run_python(
        SHORT_RUN + "assert 'heyoka' not in sys.modules and 'pykep.trajopt' not in sys.modules"
    )
    assert run.returncode == 0, run.stderr


def test_absent_pykep_is_said_in_one_friendly_line():
    run = run_python(
        HIDE_PYKEP + "from feasibility.runtime.pykep_guard import load_pykep\n"
        "from feasibility.errors import MissingDependencyError\n"
        "try:\n"
        "    load_pykep()\n"
        "except MissingDependencyError as error:\n"
        "    print(error)\n"
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("\n") == 1
    assert "pykep is not installed" in run.stdout
    assert "pip install" in run.stdout


def test_heyoka_imported_first_is_refused_instead_of_a_crash():
    run = run_python(
        "import sys, types\n"
        "sys.modules['heyoka'] = types.ModuleType('heyoka')\n"
        "from feasibility.runtime.pykep_guard import load_pykep\n"
        "from feasibility.errors import MissingDependencyError\n"
        "try:\n"
        "    load_pykep()\n"
        "except MissingDependencyError as error:\n"
        "    print(error)\n"
    )
    assert run.returncode == 0, run.stderr
    assert "import feasibility before heyoka" in run.stdout


def test_pykep_imported_before_us_is_left_alone_with_one_warning():
    run = run_python(
        "import sys, types, warnings\n"
        "from importlib.machinery import ModuleSpec\n"
        "import importlib.util\n"
        "real = importlib.util.find_spec('pykep')\n"
        "ours = types.ModuleType('pykep')\n"
        "ours.__spec__ = ModuleSpec('pykep', None, origin=real.origin)\n"
        "sys.modules['pykep'] = ours\n"
        "sys.modules['heyoka'] = types.ModuleType('heyoka')\n"
        "from feasibility.runtime.pykep_guard import load_pykep\n"
        "with warnings.catch_warnings(record=True) as caught:\n"
        "    warnings.simplefilter('always')\n"
        "    assert load_pykep() is ours and load_pykep() is ours\n"
        "assert sys.modules['pykep'] is ours\n"
        "assert [w.category for w in caught] == [RuntimeWarning], caught\n"
        "assert 'imported before feasibility' in str(caught[0].message)\n"
    )
    assert run.returncode == 0, run.stderr


def test_our_packages_do_not_import_pykep_or_pygmo_by_themselves():
    run = run_python(
        "import sys, feasibility.sims_flanagan, seqsearch\n"
        "heavy = {'pykep', 'pygmo', 'numba', 'torch', 'sklearn', 'matplotlib'}\n"
        "print(sorted(heavy & set(sys.modules)))\n"
    )
    assert run.stdout == "[]\n", run.stderr


def test_pykep_imported_after_us_works_and_says_what_it_lacks():
    run = run_python(
        SHORT_RUN + "import pykep as theirs\n"
        "assert theirs is pykep and not hasattr(theirs, 'trajopt')\n"
        "assert not hasattr(theirs, 'no_such_name')\n"
        "for attempt in ('theirs.trajopt.mga', 'import pykep.trajopt',\n"
        "                'from pykep.trajopt import mga'):\n"
        "    try:\n"
        "        exec(attempt)\n"
        "    except (AttributeError, ImportError) as error:\n"
        "        print(error)\n"
        "assert not {'heyoka', 'pykep.trajopt'} & set(sys.modules)\n"
    )
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert len(lines) == 3
    assert all("import pykep before you use feasibility" in line for line in lines)

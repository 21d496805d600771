"""What importing costs, and what it must not load."""

import json
import subprocess
import sys

import pytest

_HEAVY = ("torch", "sklearn", "optuna", "imblearn", "pykep", "pygmo", "matplotlib", "pyarrow")


@pytest.mark.parametrize("package", ["feasibility", "seqsearch", "seqsearch.beam.beam_search"])
def test_importing_loads_nothing_heavy(package):
    code = f"import sys, json, {package}; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    loaded = {name.partition(".")[0] for name in json.loads(done.stdout)}
    assert not loaded & set(_HEAVY)


def test_every_public_name_is_there():
    import feasibility
    import seqsearch

    for package in (feasibility, seqsearch):
        for name in package.__all__:
            assert getattr(package, name) is not None
        with pytest.raises(AttributeError):
            _ = package.no_such_name

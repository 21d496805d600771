"""Rules of the house that import-linter cannot say."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
KERNELS = sorted(path.relative_to(ROOT) for path in ROOT.glob("feasibility/**/*kernels.py"))
_ALLOWED = {
    "math",
    "numpy",
    "numpy.typing",
    "typing",
    "numba",
    "feasibility.runtime.float_bits",
    "feasibility.runtime.jit",
    "feasibility.constants",
}


@pytest.mark.parametrize("path", KERNELS, ids=str)
def test_kernels_know_bare_arrays_and_numbers_only(path):
    for node in ast.walk(ast.parse((ROOT / path).read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        else:
            continue
        for name in names:
            assert name in _ALLOWED or name.endswith("kernels"), f"{path} imports {name}"


def test_there_are_kernels():
    assert len(KERNELS) >= 4


def test_pykep_is_imported_in_one_place():
    for package in ("feasibility", "seqsearch"):
        for path in (ROOT / package).rglob("*.py"):
            if path.name == "pykep_guard.py":
                continue
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Import):
                    names = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom):
                    names = [node.module or ""]
                else:
                    continue
                assert not any(name.split(".")[0] == "pykep" for name in names), path

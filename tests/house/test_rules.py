"""Rules of the house about files, folders, functions and names."""

import ast
import functools
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("feasibility", "seqsearch")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
FOLDERS = sorted({path.parent for path in FILES})
TESTS = sorted((ROOT / "tests").rglob("*.py"))

MOST_FILES = 20
MOST_FILES_AT_THE_TOP = 8
MOST_LINES = 450
MOST_LINES_OF_A_FUNCTION = 100

AT_HOME = ("seqsearch/problems/", "feasibility/orbits/tables.py")
"""Where competitions may be named: their rules, and the layouts of their tables."""


def _name(path):
    return path.relative_to(ROOT).as_posix()


@functools.cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def test_there_is_something_to_look_at():
    assert len(FILES) > 200
    assert len(TESTS) > 50


def test_no_folder_is_crowded():
    counts = {_name(folder): len(list(folder.glob("*.py"))) for folder in FOLDERS}
    crowded = {name: count for name, count in counts.items() if count > MOST_FILES}
    top = {name: counts[name] for name in PACKAGES if counts[name] > MOST_FILES_AT_THE_TOP}
    assert crowded | top == {}


def test_no_file_is_long_but_for_kernels():
    lines = {_name(path): len(path.read_text(encoding="utf-8").splitlines()) for path in FILES}
    long = {name: n for name, n in lines.items() if n > MOST_LINES}
    assert [name for name in long if not name.endswith("_kernels.py")] == []


def test_no_function_is_long():
    long = [
        f"{_name(path)}: {node.name} has {node.end_lineno - node.lineno + 1} lines"
        for path in FILES
        for node in ast.walk(_tree(path))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and node.end_lineno - node.lineno >= MOST_LINES_OF_A_FUNCTION
    ]
    assert long == []


def _docstrings(tree: ast.Module) -> set[int]:
    """Return the ids of strings that stand alone: docstrings of modules, classes, constants."""
    return {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }


def _words(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield all identifiers, imports and strings with their lines; no docstrings."""
    docstrings = _docstrings(tree)
    for node in ast.walk(tree):
        words: list[str | None] = []
        match node:
            case ast.Constant(value=str(text)) if id(node) not in docstrings:
                words = [text]
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name):
                words = [name]
            case ast.keyword(arg=name):
                words = [name]
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                words = [name]
            case ast.ImportFrom(module=module, names=names):
                words = [module, *(alias.name for alias in names)]
                words += [alias.asname for alias in names]
            case ast.Import(names=names):
                words = [part for alias in names for part in (alias.name, alias.asname)]
        yield from ((getattr(node, "lineno", 0), word) for word in words if word)


def test_no_competition_is_named_outside_its_own_folder():
    named = [
        f"{_name(path)}:{line}: {word.splitlines()[0][:60]}"
        for path in FILES
        if not _name(path).startswith(AT_HOME)
        for line, word in _words(_tree(path))
        if "gtoc" in word.lower()
    ]
    assert named == []


def test_docstrings_are_told_from_other_strings():
    code = '"""gtoc1"""\nX = "gtoc2"\n"""gtoc3"""\nimport gtoc4 as y\ndef f(gtoc5): g(gtoc6=1)\n'
    found = {word for _, word in _words(ast.parse(code)) if "gtoc" in word}
    assert found == {"gtoc2", "gtoc4", "gtoc5", "gtoc6"}


def test_the_verifier_loads_nothing_of_solvers_kernels_and_problems():
    code = (
        "import seqsearch.tours.verify, sys; print([m for m in sys.modules "
        "if 'sims_flanagan' in m or 'problems' in m or '_kernels' in m])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("folder", ["tests", "benchmarks", "examples", "training"])
def test_no_test_is_imported_and_no_benchmark(folder):
    imported = []
    for path in sorted((ROOT / folder).rglob("*.py")):
        for node in ast.walk(_tree(path)):
            modules = []
            if isinstance(node, ast.Import):
                modules = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                modules = [node.module or ""]
            for module in modules:
                parts = module.split(".")
                if parts[0] == "benchmarks" or any(part.startswith("test_") for part in parts):
                    imported.append(f"{_name(path)}:{node.lineno}: {module}")
    assert imported == []

"""Folder locks and atomic files: one writer at a time, nothing half-written that lasts."""

import subprocess
import sys

import pytest

from feasibility import InputError
from feasibility.runtime.atomic import atomic_path, write_text
from feasibility.runtime.locks import folder_lock

_HOLD = (
    "import sys, time; from pathlib import Path\n"
    "from feasibility.runtime.locks import folder_lock\n"
    "with folder_lock(Path(sys.argv[1])):\n    print('held', flush=True); time.sleep(60)"
)


@pytest.fixture
def held(tmp_path):
    """A folder that another process holds, and that process."""
    process = subprocess.Popen(
        [sys.executable, "-c", _HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    yield tmp_path, process
    process.kill()
    process.wait()


def test_a_second_process_gets_one_line_that_names_the_first(held):
    folder, process = held
    message = f"in use by another process \\({process.pid}\\)"
    with pytest.raises(InputError, match=message), folder_lock(folder):
        pass


def test_the_lock_of_a_dead_process_is_taken_over(held):
    folder, process = held
    process.kill()
    process.wait()
    with folder_lock(folder):
        pass
    with folder_lock(folder):
        pass


def test_what_a_killed_process_left_is_removed_and_nothing_else(tmp_path):
    write_text(tmp_path / "kept.json", "{}")
    (tmp_path / ".kept.json.abcd1234.tmp").write_text("{")
    (tmp_path / ".hidden").write_text("mine")
    with folder_lock(tmp_path):
        assert sorted(path.name for path in tmp_path.iterdir()) == [
            ".hidden",
            ".lock",
            "kept.json",
        ]


def test_a_folder_that_is_not_there_cannot_be_held(tmp_path):
    with (
        pytest.raises(InputError, match="cannot be written to"),
        folder_lock(tmp_path / "missing"),
    ):
        pass


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")

    def fail():
        with atomic_path(path) as temporary:
            temporary.write_text("new")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]

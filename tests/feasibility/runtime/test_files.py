"""Files and folders: complete or absent, never overwritten unasked."""

import json

import pytest

from feasibility import InputError
from feasibility.runtime.atomic import atomic_path, write_json, write_text
from feasibility.runtime.folders import make_folder, new_folder


def test_a_file_is_as_before_where_writing_fails(tmp_path):
    path = tmp_path / "tour.json"
    write_text(path, "old")

    def fail():
        with atomic_path(path) as temporary:
            temporary.write_text("half of the n")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_record_is_written_as_json_that_people_can_read(tmp_path):
    path = tmp_path / "record.json"
    write_json(path, {"seed": 3, "names": ["a", "b"]})
    text = path.read_text()
    assert json.loads(text) == {"seed": 3, "names": ["a", "b"]}
    assert text.startswith('{\n "seed": 3,')
    assert text.endswith("}\n")


def test_what_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none/record\.json: cannot be written \(No such file"):
        write_json(tmp_path / "none" / "record.json", {})


def test_a_folder_may_be_there_or_must_be_new(tmp_path):
    folder = tmp_path / "runs" / "first"
    new_folder(folder)
    make_folder(folder)
    make_folder(tmp_path / "other" / "one")
    assert folder.is_dir()
    assert (tmp_path / "other" / "one").is_dir()
    with pytest.raises(InputError, match="first: exists; nothing is overwritten, choose another"):
        new_folder(folder)


@pytest.mark.parametrize("make", [make_folder, new_folder])
def test_a_folder_below_a_file_cannot_be_created(tmp_path, make):
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(InputError, match=r"below: cannot be created \("):
        make(file / "below")

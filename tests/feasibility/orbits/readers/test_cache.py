"""The cache of large tables: the same bodies, whatever happens to its files."""

import os

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from feasibility.errors import InputError
from feasibility.orbits import read_catalogue
from feasibility.orbits.readers import cache
from feasibility.orbits.tables import read_bodies
from tests.helpers import publishers
from tests.helpers.publishers import Body


@pytest.fixture
def table(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "LEAST_BYTES", 1000)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = tmp_path / "MPCORB.DAT"
    many = [Body(k, f"Zoë{k}", h=None if k == 4 else 9.0, e=1.5 * (k == 7)) for k in range(1, 20)]
    path.write_text(publishers.mpcorb(many))
    return path


def kept(table):
    return sorted((table.parent / "cache" / "seqsearch" / "tables").glob("*"))


def check_same(one, two):
    assert (one.label, one.left_out, one.notes) == (two.label, two.left_out, two.notes)
    assert one.names == two.names
    assert_array_equal(one.ids, two.ids)
    assert_array_equal(one.orbits, two.orbits)
    assert one.extra.keys() == two.extra.keys()
    for name, column in one.extra.items():
        assert_array_equal(column, two.extra[name])


def test_a_table_comes_from_the_cache_as_it_was_read(table, monkeypatch):
    first = read_bodies(table)
    assert len(kept(table)) == 1
    moved = table.rename(table.with_name("elsewhere"))
    monkeypatch.setattr("feasibility.orbits.tables._read", None)
    check_same(read_bodies(moved), first)
    with pytest.warns(UserWarning, match="elsewhere: 1 of 19 rows lack .* 1 with e >= 1"):
        assert read_catalogue(moved).source == str(moved)


def test_another_content_is_another_table_though_name_size_and_time_are_the_same(table):
    first, stat = read_bodies(table), table.stat()
    table.write_text(table.read_text().replace("2.5000000", "2.6000000"))
    os.utime(table, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert_array_equal(read_bodies(table).orbits[:, 1], 2.6)
    assert_array_equal(first.orbits[:, 1], 2.5)


@pytest.mark.parametrize("seed", range(40))
def test_a_damaged_cache_is_built_anew(table, seed):
    first = read_bodies(table)
    (file,) = kept(table)
    intact = file.read_bytes()
    rng = np.random.default_rng(seed)
    place = int(rng.integers(len(intact)))
    damaged = (
        intact[:place],
        intact[:place] + bytes([intact[place] ^ 255]) + intact[place + 1 :],
        b"",
        rng.bytes(500),
    )[seed % 4]
    file.write_bytes(damaged)
    check_same(read_bodies(table), first)
    check_same(read_bodies(table), first)


def test_units_are_part_of_what_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "LEAST_BYTES", 10)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = tmp_path / "table"
    path.write_text("id epoch a e i node argp M\n3 54800 2.5 0.1 0.1 1 2 3\n")
    assert read_bodies(path).orbits[0, 3] == 0.1
    assert read_bodies(path, units={"i": "rad"}).orbits[0, 3] == np.degrees(0.1)


def test_where_nothing_can_be_written_tables_are_read_all_the_same(table, monkeypatch):
    first = read_bodies(table)
    (table.parent / "file").write_text("")
    for folder in ("/proc/nowhere", str(table.parent / "file"), "relative"):
        monkeypatch.setenv("XDG_CACHE_HOME", folder)
        monkeypatch.setenv("HOME", "/proc/nowhere")
        check_same(read_bodies(table), first)


def test_what_cannot_be_read_is_not_kept(table):
    table.write_text(table.read_text()[:-150])
    with pytest.raises(InputError):
        read_bodies(table)
    assert kept(table) == []


def test_the_last_tables_are_kept(table):
    text = table.read_text()
    for k in range(12):
        table.write_text(text.replace("2.5000000", f"2.{k:02d}00000"))
        read_bodies(table)
    assert len(kept(table)) == 8

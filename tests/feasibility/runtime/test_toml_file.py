"""Reading TOML into structs: what a file says wrong is told in its own words."""

from typing import Annotated

import msgspec
import pytest
from msgspec import Meta

from feasibility import InputError
from feasibility.runtime.toml_file import convert_table, decode_toml, parse_toml, read_toml


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    pass


class Scouts(_Table, frozen=True):
    width: Annotated[int, Meta(ge=1)] = 3


class Search(_Table, frozen=True):
    beam: int = 10
    scouts: Scouts = Scouts()


class Launch(_Table, frozen=True, tag="launch", tag_field="kind"):
    speed: float


class Drop(_Table, frozen=True, tag="drop", tag_field="kind"):
    mass: float = 1.0


class Spread(_Table, frozen=True):
    ends: tuple[float, Drop] = (0.0, Drop())

    def __post_init__(self):
        if self.ends[0] < 0:
            raise ValueError("ends begin below zero")


class File(_Table, frozen=True):
    name: str
    search: Annotated[Search, Meta(title="search")] = Search()
    first: Launch | Drop | None = None
    events: tuple[Launch | Drop, ...] = ()
    by_name: dict[str, Launch | Drop] = {}
    spread: Spread = Spread()


LEAST = 'name = "mine"\n'


def test_a_file_with_tables_in_tables_and_lists_is_read(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        LEAST
        + "[search.scouts]\nwidth = 5\n[[events]]\nkind = 'launch'\nspeed = 3\n"
        + "[[events]]\nkind = 'drop'\n[by_name.a]\nkind = 'drop'\nmass = 2\n"
    )
    assert read_toml(path, File) == File(
        name="mine",
        search=Search(scouts=Scouts(width=5)),
        events=(Launch(3.0), Drop()),
        by_name={"a": Drop(2.0)},
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no key 'name' at top level, expected one"),
        (
            LEAST + "wings = 2",
            "unknown key 'wings' at top level; known keys are "
            "name, search, first, events, by_name, spread",
        ),
        (
            LEAST + "[search]\nbeams = 2",
            "unknown key 'beams' in [search]; known keys are beam, scouts",
        ),
        (
            LEAST + "[search.scouts]\nwidht = 2",
            "unknown key 'widht' in [search.scouts]; known keys are width",
        ),
        (LEAST + "[search.scouts]\nwidth = 0", "expected `int` >= 1 (at search.scouts.width)"),
        (LEAST + "search = 3", "expected `object`, got `int` (at search)"),
        ("name = 3", "expected `str`, got `int` (at name)"),
        (
            LEAST + "[first]\nkind = 'drop'\nspeed = 3",
            "unknown key 'speed' in [first]; known keys are kind, mass",
        ),
        (LEAST + "[first]\nkind = 'dive'", "invalid value 'dive' (at first.kind)"),
        (LEAST + "[first]\nmass = 2", "no key 'kind' in [first], expected one"),
        (LEAST + "[first]\nkind = 'launch'", "no key 'speed' in [first], expected one"),
        (
            LEAST + "[[events]]\nkind = 'drop'\n[[events]]\nkind = 'launch'\nspeed = 1\nx = 2",
            "unknown key 'x' in [events[1]]; known keys are kind, speed",
        ),
        (
            LEAST + "[by_name.a]\nkind = 'drop'\nx = 2",
            "unknown key 'x' in [by_name[...]]; known keys are kind, speed, mass",
        ),
        (
            LEAST + "[spread]\nends = [1, {kind = 'drop', x = 2}]",
            "unknown key 'x' in [spread.ends[1]]; known keys are kind, mass",
        ),
        (LEAST + "[spread]\nends = [-1, {kind = 'drop'}]", "ends begin below zero (at spread)"),
    ],
)
def test_a_mistake_is_one_line_that_names_table_and_key(text, message):
    with pytest.raises(InputError) as caught:
        decode_toml(text, File, "mine.toml")
    assert str(caught.value) == f"mine.toml: {message}"


def test_what_is_not_toml_is_named():
    with pytest.raises(InputError, match=r"^mine\.toml: not valid TOML \(Expected"):
        parse_toml("[search", "mine.toml")


def test_a_table_of_a_larger_file_is_named_in_full():
    with pytest.raises(InputError, match=r"^f: unknown key 'q' in \[a.scouts\]; .* are width$"):
        convert_table({"scouts": {"q": 1}}, Search, "f", table="a")
    with pytest.raises(InputError, match=r"^f: unknown key 'q' in \[a\]; .* are beam, scouts$"):
        convert_table({"q": 1}, Search, "f", table="a")


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml: cannot be read .*\(No such file"):
        read_toml(tmp_path / "none.toml", File)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\xfa")
    with pytest.raises(InputError, match=r"binary\.toml: cannot be read .*\(not text\)"):
        read_toml(tmp_path / "binary.toml", File)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_byte_order_mark_does_not_matter(tmp_path, encoding):
    path = tmp_path / "marked.toml"
    path.write_bytes("beam = 3\n".encode(encoding))
    assert read_toml(path, Search).beam == 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"beam = {2**63}", "mine: beam is a whole number of about 20 digits"),
        (f"beam = -{10**400}", "mine: beam is a whole number of about 40[01] digits"),
        ("beam = 1" + 5000 * "0", "mine: not valid TOML"),
        (
            f"[scouts]\nwidth = {2**70}",
            r"mine: scouts\.width is a whole number of about 2. digits",
        ),
        ("beam = [inf]", "mine: beam is inf, expected a finite number"),
        ("beam = nan", "mine: beam is nan"),
        ("beam = " + 2000 * "[", "mine: not valid TOML"),
        ("beam = " + 3000 * "{a=", "mine: not valid TOML"),
    ],
)
def test_absurd_numbers_and_depths_are_one_line_with_file_and_key(text, message):
    with pytest.raises(InputError, match=message) as caught:
        decode_toml(text, Search, "mine")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300

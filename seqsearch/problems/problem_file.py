"""What a problem's TOML file may say, and how it becomes a `Problem` and `SearchSettings`."""

import re
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, final

import msgspec
import numpy as np
import tomli_w
from msgspec import Meta

from feasibility import InputError, Spacecraft
from feasibility.constants import mjd_to_mjd2000
from feasibility.orbits import Catalogue, read_catalogue, synthetic_main_belt
from feasibility.orbits.selection import selected_rows
from feasibility.orbits.spk.files import is_kernel
from feasibility.runtime.toml_file import convert_table, parse_toml, read_toml_text
from seqsearch.core.problem import Problem
from seqsearch.problems.extra_bodies import BodyTable, extra_bodies
from seqsearch.problems.old_keys import upgraded_search
from seqsearch.problems.registry import ProblemPlugin, builtin_problems, plugins
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.settings import SearchSettings
from seqsearch.tours.dates import mjd_of


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A TOML table in which every key is known."""


@final
class ProblemTable(_Table, frozen=True, kw_only=True):
    """Table ``[problem]``."""

    name: str
    description: str = ""

    def __post_init__(self) -> None:
        # Run folders are named after problems.
        if re.fullmatch(r"[^\W_][^/\\\x00-\x1f]{0,99}", self.name) is None:
            raise ValueError(
                f"name {self.name!r}, expected a plain name that begins with a letter or digit"
            )


@final
class SpacecraftTable(_Table, frozen=True, kw_only=True):
    """Table ``[spacecraft]``."""

    wet_mass_kg: float
    dry_mass_kg: float
    thrust_n: float
    isp_s: float


@final
class MissionTable(_Table, frozen=True, kw_only=True):
    """Table ``[mission]``; epochs in MJD, or as dates such as ``2030-01-01``.

    With a `sequence` these bodies alone are visited, in this order. With an `end_id` tours end
    there, and they visit all that `must_visit` names.
    """

    first_departure_mjd: tuple[float, float]
    max_duration_days: float
    min_stay_days: float = 0.0
    start_ids: tuple[int, ...] = ()
    sequence: tuple[int, ...] = ()
    end_id: int | None = None
    must_visit: tuple[int, ...] = ()


@final
class CatalogueTable(_Table, frozen=True, kw_only=True):
    """Table ``[catalogue]``: a file, or a synthetic belt, or neither (then --catalogue).

    Of its bodies those are searched that `select` describes, less `exclude_ids`. `units` are those
    of columns whose header does not tell them. Where the file is an SPK kernel, a folder of them
    or a meta-kernel, `bodies` says which of its bodies are meant (default: all small bodies and
    spacecraft), and `ephemeris` whether they move on Kepler orbits or as the kernels say.
    """

    file: str | None = None
    units: dict[str, str] = msgspec.field(default_factory=dict)
    select: str | None = None
    synthetic_bodies: Annotated[int, Meta(ge=2)] | None = None
    synthetic_seed: Annotated[int, Meta(ge=0)] = 0
    exclude_ids: tuple[int, ...] = ()
    bodies: tuple[int | str, ...] = ()
    ephemeris: Literal["kepler", "spk"] = "kepler"


@final
class FleetTable(_Table, frozen=True, kw_only=True):
    """Table ``[fleet]``: probes that share no asteroid, and how much of the time is polishing."""

    probes: Annotated[int, Meta(ge=1, le=100)] = 1
    polish_share: Annotated[float, Meta(ge=0, le=0.9)] = 0.4


class Config(_Table, frozen=True, kw_only=True):
    """A whole problem file, but for the tables of plug-ins: those are fields of `_whole`."""

    problem: ProblemTable
    spacecraft: SpacecraftTable
    mission: MissionTable
    catalogue: CatalogueTable = msgspec.field(default_factory=CatalogueTable)
    bodies: tuple[BodyTable, ...] = ()
    fleet: FleetTable = msgspec.field(default_factory=FleetTable)
    search: SearchSettings = msgspec.field(default_factory=SearchSettings)


@cache
def _whole() -> type[Config]:
    """Return the struct of problem files with a field for the rules of each plug-in.

    Raises
    ------
    InputError
        As `plugins`, or a plug-in's table has the name of one that all problem files have.
    """
    ours = [name for name in Config.__struct_fields__ if name in plugins()]
    if ours:
        raise InputError(
            f"problem plug-in {ours[0]}: expected another name, as every problem file has a "
            f"table [{ours[0]}]"
        )
    tables = [
        (plugin.name, plugin.rules | None, None)
        for plugin in plugins().values()
        if plugin.rules is not None
    ]
    # Its bases are missing from the type hints of defstruct.
    whole: Any = msgspec.defstruct(
        "ProblemFile",
        tables,
        bases=(Config,),
        namespace={"__doc__": "A whole problem file."},
        frozen=True,
        kw_only=True,
        forbid_unknown_fields=True,
    )
    typed: type[Config] = whole
    return typed


def read_config(problem: str) -> Config:
    """Read a problem by name or from a TOML file.

    Parameters
    ----------
    problem : str
        Name of a built-in problem (see `builtin_problems`) or path of a TOML file.

    Raises
    ------
    InputError
        No such problem, unreadable file, TOML that does not parse, an unknown
        key, or a value of the wrong type; the message names file and key.
    """
    builtin = builtin_problems()
    if problem in builtin:
        return _decode(builtin[problem], f"built-in problem {problem}")
    path = Path(problem)
    if not path.exists():
        raise InputError(
            f"{problem}: no such problem or file; built-in problems are {', '.join(builtin)}"
        )
    config = _decode(read_toml_text(path), str(path))
    file = config.catalogue.file
    if file is not None and not Path(file).is_absolute():
        # A path inside a file is meant relative to that file.
        catalogue = msgspec.structs.replace(config.catalogue, file=str(path.parent / file))
        config = msgspec.structs.replace(config, catalogue=catalogue)
    return config


def _decode(text: str, label: str) -> Config:
    plain = parse_toml(text, label)
    if isinstance(plain.get("search"), dict):
        plain["search"] = upgraded_search(plain["search"], label)
    mission = plain.get("mission")
    if isinstance(mission, dict) and isinstance(mission.get("first_departure_mjd"), list):
        # TOML has dates of its own, and people write them as texts too.
        mission["first_departure_mjd"] = [
            mjd_of(epoch, f"{label}: mission.first_departure_mjd")
            for epoch in mission["first_departure_mjd"]
        ]
    for number, body in enumerate(plain.get("bodies") or (), 1):
        if isinstance(body, dict) and "epoch_mjd" in body:
            body["epoch_mjd"] = mjd_of(body["epoch_mjd"], f"{label}: bodies[{number}].epoch_mjd")
    return convert_table(plain, _whole(), label)


def override(config: Config, **changes: Any) -> Config:
    """Return the configuration with values of its ``[search]`` table replaced.

    Values that are None are left as they are.

    Raises
    ------
    InputError
        A value is out of range.
    """
    given = {name: value for name, value in changes.items() if value is not None}
    return msgspec.structs.replace(config, search=config.search.with_(**given))


def with_catalogue(config: Config, file: str) -> Config:
    """Return the configuration with another catalogue file, of which the same bodies count."""
    table = msgspec.structs.replace(
        config.catalogue, file=file, synthetic_bodies=None, synthetic_seed=0
    )
    return msgspec.structs.replace(config, catalogue=table)


def with_selection(config: Config, select: str) -> Config:
    """Return the configuration with another selection of bodies."""
    table = msgspec.structs.replace(config.catalogue, select=select)
    return msgspec.structs.replace(config, catalogue=table)


def with_sequence(config: Config, sequence: tuple[int, ...]) -> Config:
    """Return the configuration with a sequence of bodies to visit in this order."""
    mission = msgspec.structs.replace(config.mission, sequence=sequence)
    return msgspec.structs.replace(config, mission=mission)


def build_problem(config: Config, catalogue: Catalogue | None = None) -> Problem:
    """Load the catalogue and build the validated problem.

    A tour of rendezvous; with the table of a plug-in, a tour by its rules.

    Parameters
    ----------
    config : Config
        The problem file.
    catalogue : Catalogue, optional
        Stands in for the one that the file names; the same bodies are left out.

    Raises
    ------
    InputError
        The catalogue is missing or malformed, a value is out of range, or there are tables of
        two plug-ins.
    """
    craft = config.spacecraft
    mission = config.mission
    earliest, latest = mission.first_departure_mjd
    bodies = _without_excluded(catalogue or whole_catalogue(config), config)
    if config.bodies:
        bodies = bodies.with_bodies(extra_bodies(config.bodies, config.problem.name))
    if mission.sequence:
        # The others play no part, and most of the work would be to look at them.
        bodies = bodies.select(np.unique(bodies.rows_of(np.asarray(_on_the_way(config)))))
    base = RendezvousProblem(
        name=config.problem.name,
        catalogue=bodies,
        spacecraft=Spacecraft(craft.dry_mass_kg, craft.thrust_n, craft.isp_s),
        m0=craft.wet_mass_kg,
        first_departure_mjd2000=(mjd_to_mjd2000(earliest), mjd_to_mjd2000(latest)),
        max_duration_days=mission.max_duration_days,
        min_stay_days=mission.min_stay_days,
        start_ids=_start_ids(config),
        sequence=mission.sequence,
        end_id=mission.end_id,
        must_visit=mission.must_visit,
        unscored_ids=tuple(body.id for body in config.bodies if not body.scored),
    )
    own = [
        (plugin, rules) for plugin in plugins().values() if (rules := _rules_of(config, plugin))
    ]
    if len(own) > 1:
        raise InputError(
            f"problem {config.problem.name}: tables [{own[0][0].name}] and [{own[1][0].name}], "
            "expected the rules of one problem"
        )
    for plugin, rules in own:
        _check_mission(config, plugin)
        if plugin.build is not None:
            problem = plugin.build(base, rules)
            if base.catalogue.ephemeris is not None and problem.catalogue.ephemeris is None:
                raise InputError(
                    f"problem {base.name}: [{plugin.name}] has bodies of its own on Kepler "
                    'orbits; expected [catalogue] ephemeris = "kepler"'
                )
            return problem
    return base


def _check_mission(config: Config, plugin: ProblemPlugin) -> None:
    """Check that a problem file says no more of the mission than a plug-in's rules go with."""
    mission = config.mission
    given = {
        "sequence": ("a sequence", bool(mission.sequence)),
        "end_id": ("an end_id", mission.end_id is not None),
        "must_visit": ("must_visit", bool(mission.must_visit)),
        "bodies": ("[[bodies]]", bool(config.bodies)),
    }
    for key, (what, there) in given.items():
        if there and key not in plugin.mission_keys:
            raise InputError(
                f"problem {config.problem.name}: {what} and a table [{plugin.name}], expected "
                f"{what} only in tours of rendezvous alone"
            )


def _on_the_way(config: Config) -> list[int]:
    """Return the ids of the bodies of a sequence, and of those at which it may start and end."""
    mission = config.mission
    end = () if mission.end_id is None else (mission.end_id,)
    unscored = {body.id for body in config.bodies if not body.scored}
    starts = [body for body in mission.start_ids if body in unscored]
    return list(dict.fromkeys([*mission.sequence, *starts, *end]))


def _rules_of(config: Config, plugin: ProblemPlugin) -> object:
    return getattr(config, plugin.name, None) if plugin.rules is not None else None


def _start_ids(config: Config) -> tuple[int, ...]:
    """Return the ids of start bodies that are not excluded."""
    given, excluded = config.mission.start_ids, set(config.catalogue.exclude_ids)
    left = tuple(body for body in given if body not in excluded)
    if given and not left:
        raise InputError(
            f"problem {config.problem.name}: all of start_ids are in exclude_ids, "
            "expected one that is not"
        )
    return left


def load_problem(problem: str, catalogue: str | Path | None = None) -> Problem:
    """Return a problem by name or from a TOML file, with its catalogue.

    Parameters
    ----------
    problem : str
        Name of a built-in problem (see `builtin_problems`) or path of a TOML file.
    catalogue : str or Path, optional
        Asteroid table to use instead of the one that the problem names.

    Raises
    ------
    InputError
        As `read_config` and `build_problem`.
    """
    config = read_config(problem)
    return build_problem(config if catalogue is None else with_catalogue(config, str(catalogue)))


def table_at_hand(config: Config) -> Catalogue | None:
    """Return the catalogue that a configuration names, or None where it cannot be found.

    Raises
    ------
    InputError
        It is there, but cannot be read.
    """
    file = config.catalogue.file
    there = config.catalogue.synthetic_bodies if file is None else Path(file).exists()
    return whole_catalogue(config) if there else None


def _without_excluded(catalogue: Catalogue, config: Config) -> Catalogue:
    excluded = catalogue.rows_of(np.asarray(config.catalogue.exclude_ids, dtype=np.int64))
    kept = np.setdiff1d(np.arange(len(catalogue)), excluded)
    return catalogue.select(kept) if len(excluded) else catalogue


def whole_catalogue(config: Config) -> Catalogue:
    """Return the catalogue that a configuration names, with the bodies that it excludes.

    Raises
    ------
    InputError
        There is none, or it cannot be read.
    """
    table = config.catalogue
    if table.file is not None and table.synthetic_bodies is not None:
        raise InputError(
            f"problem {config.problem.name}: [catalogue] has both file and synthetic_bodies, "
            "expected one of them"
        )
    if table.file is not None and is_kernel(Path(table.file)):
        return _kernel_bodies(config, Path(table.file))
    if table.bodies or table.ephemeris == "spk":
        key = "bodies" if table.bodies else 'ephemeris = "spk"'
        raise InputError(
            f"problem {config.problem.name}: [catalogue] has {key}, expected file to be an SPK "
            f"kernel, a folder of them or a meta-kernel, got {table.file or 'none'}"
        )
    if table.file is not None:
        return read_catalogue(Path(table.file), units=table.units, select=table.select)
    if table.synthetic_bodies is not None:
        rng = np.random.default_rng(table.synthetic_seed)
        belt = synthetic_main_belt(table.synthetic_bodies, rng)
        return belt if table.select is None else selected_rows(belt, table.select)
    raise InputError(
        f"problem {config.problem.name}: no asteroid table; give one with --catalogue FILE "
        "(the README says where the official tables are)"
    )


def _kernel_bodies(config: Config, path: Path) -> Catalogue:
    # Imported here: other problems have no need of SPICE.
    from feasibility.orbits.spk.reading import read_kernels

    earliest, latest = (mjd_to_mjd2000(epoch) for epoch in config.mission.first_departure_mjd)
    table = config.catalogue
    if table.units:
        raise InputError(f"{path}: units are given, but SPK kernels have their own; expected none")
    found = read_kernels(
        path,
        table.bodies,
        table.ephemeris,
        (earliest, latest + config.mission.max_duration_days),
    )
    return found if table.select is None else selected_rows(found, table.select)


def to_toml(config: Config) -> str:
    """Return the resolved configuration as TOML; `read_config` reads it back."""
    tables = msgspec.to_builtins(config)
    bodies = [_without_none(body) for body in tables.pop("bodies")]
    plain = {name: _without_none(table) for name, table in tables.items() if table is not None}
    return tomli_w.dumps(plain | ({"bodies": bodies} if bodies else {}))


def _without_none(table: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in table.items() if value is not None}

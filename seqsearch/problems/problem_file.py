"""What a problem's TOML file may say, and how it becomes a `Problem` and `SearchSettings`."""

from importlib import resources
from pathlib import Path
from typing import Annotated, Any, final

import msgspec
import numpy as np
import tomli_w
from msgspec import Meta

from feasibility import InputError, Spacecraft
from feasibility.constants import mjd_to_mjd2000
from feasibility.orbits import Catalogue, read_catalogue, synthetic_main_belt
from seqsearch.core.problem import TourProblem
from seqsearch.problems.gtoc5.problem import Gtoc5Problem
from seqsearch.problems.gtoc5.rules import Gtoc5Rules
from seqsearch.problems.rendezvous import Problem
from seqsearch.settings import SearchSettings


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A TOML table in which every key is known."""


@final
class ProblemTable(_Table, frozen=True, kw_only=True):
    """Table ``[problem]``."""

    name: str
    description: str = ""


@final
class SpacecraftTable(_Table, frozen=True, kw_only=True):
    """Table ``[spacecraft]``."""

    wet_mass_kg: float
    dry_mass_kg: float
    thrust_n: float
    isp_s: float


@final
class MissionTable(_Table, frozen=True, kw_only=True):
    """Table ``[mission]``."""

    first_departure_mjd: tuple[float, float]
    max_duration_days: float
    min_stay_days: float = 0.0
    start_ids: tuple[int, ...] = ()


@final
class CatalogueTable(_Table, frozen=True, kw_only=True):
    """Table ``[catalogue]``: a file, or a synthetic belt, or neither (then --catalogue).

    Bodies in `exclude_ids` are left out.
    """

    file: str | None = None
    synthetic_bodies: Annotated[int, Meta(ge=2)] | None = None
    synthetic_seed: Annotated[int, Meta(ge=0)] = 0
    exclude_ids: tuple[int, ...] = ()


@final
class FleetTable(_Table, frozen=True, kw_only=True):
    """Table ``[fleet]``: probes that share no asteroid, and how much of the time is polishing."""

    probes: Annotated[int, Meta(ge=1, le=100)] = 1
    polish_share: Annotated[float, Meta(ge=0, le=0.9)] = 0.4


@final
class Config(_Table, frozen=True, kw_only=True):
    """A whole problem file."""

    problem: ProblemTable
    spacecraft: SpacecraftTable
    mission: MissionTable
    catalogue: CatalogueTable = msgspec.field(default_factory=CatalogueTable)
    gtoc5: Gtoc5Rules | None = None
    fleet: FleetTable = msgspec.field(default_factory=FleetTable)
    search: SearchSettings = msgspec.field(default_factory=SearchSettings)


def builtin_problems() -> dict[str, str]:
    """Return the names of the built-in problems and their TOML texts."""
    folders = (f for f in resources.files("seqsearch.problems").iterdir() if f.is_dir())
    entries = [entry for folder in folders for entry in folder.iterdir()]
    return {
        entry.name.removesuffix(".toml"): entry.read_text(encoding="utf-8")
        for entry in sorted(entries, key=lambda entry: entry.name)
        if entry.name.endswith(".toml")
    }


def read_config(problem: str) -> Config:
    """Read a problem by name or from a TOML file.

    Parameters
    ----------
    problem : str
        Name of a built-in problem (``gtoc5``, ``gtoc7``, ``demo``) or path of a TOML file.

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
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a TOML file ({error})") from None
    config = _decode(text, str(path))
    file = config.catalogue.file
    if file is not None and not Path(file).is_absolute():
        # A path inside a file is meant relative to that file.
        catalogue = msgspec.structs.replace(config.catalogue, file=str(path.parent / file))
        config = msgspec.structs.replace(config, catalogue=catalogue)
    return config


def _decode(text: str, label: str) -> Config:
    try:
        return msgspec.toml.decode(text, type=Config, strict=False)
    except msgspec.ValidationError as error:
        raise InputError(f"{label}: {_readable(str(error))}") from None
    except msgspec.DecodeError as error:
        raise InputError(f"{label}: not valid TOML ({error})") from None


def _readable(message: str) -> str:
    """Rewrite msgspec's ``... - at `$.search` `` in the words of a TOML file."""
    text, _, where = message.partition(" - at `$")
    where = where.rstrip("`").lstrip(".")
    if text.startswith("Object contains unknown field"):
        key = text.split("`")[1]
        table: Any = Config
        if where:
            table = {field.name: field.type for field in msgspec.structs.fields(Config)}[where]
        known = ", ".join(field.name for field in msgspec.structs.fields(table))
        place = f"in [{where}]" if where else "at top level"
        return f"unknown key {key!r} {place}; known keys are {known}"
    text = text[0].lower() + text[1:]
    return f"{text} (at {where})" if where else text


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
    """Return the configuration with another catalogue file, less the same bodies."""
    table = CatalogueTable(file=file, exclude_ids=config.catalogue.exclude_ids)
    return msgspec.structs.replace(config, catalogue=table)


def build_problem(config: Config) -> TourProblem:
    """Load the catalogue and build the validated problem.

    A tour of rendezvous; with a table ``[gtoc5]``, a tour by its rules.

    Raises
    ------
    InputError
        The catalogue is missing or malformed, or a value is out of range.
    """
    craft = config.spacecraft
    mission = config.mission
    earliest, latest = mission.first_departure_mjd
    problem = Problem(
        name=config.problem.name,
        catalogue=_load_catalogue(config),
        spacecraft=Spacecraft(craft.dry_mass_kg, craft.thrust_n, craft.isp_s),
        m0=craft.wet_mass_kg,
        first_departure_mjd2000=(mjd_to_mjd2000(earliest), mjd_to_mjd2000(latest)),
        max_duration_days=mission.max_duration_days,
        min_stay_days=mission.min_stay_days,
        start_ids=_start_ids(config),
    )
    return problem if config.gtoc5 is None else Gtoc5Problem(base=problem, rules=config.gtoc5)


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


def load_problem(problem: str, catalogue: str | Path | None = None) -> TourProblem:
    """Return a problem by name or from a TOML file, with its catalogue.

    Parameters
    ----------
    problem : str
        Name of a built-in problem (``gtoc5``, ``gtoc7``, ``demo``) or path of a TOML file.
    catalogue : str or Path, optional
        Asteroid table to use instead of the one that the problem names.

    Raises
    ------
    InputError
        As `read_config` and `build_problem`.
    """
    config = read_config(problem)
    return build_problem(config if catalogue is None else with_catalogue(config, str(catalogue)))


def _load_catalogue(config: Config) -> Catalogue:
    catalogue = _whole_catalogue(config)
    excluded = catalogue.rows_of(np.asarray(config.catalogue.exclude_ids, dtype=np.int64))
    kept = np.setdiff1d(np.arange(len(catalogue)), excluded)
    return catalogue.select(kept) if len(excluded) else catalogue


def _whole_catalogue(config: Config) -> Catalogue:
    table = config.catalogue
    if table.file is not None and table.synthetic_bodies is not None:
        raise InputError(
            f"problem {config.problem.name}: [catalogue] has both file and synthetic_bodies, "
            "expected one of them"
        )
    if table.file is not None:
        return read_catalogue(Path(table.file))
    if table.synthetic_bodies is not None:
        rng = np.random.default_rng(table.synthetic_seed)
        return synthetic_main_belt(table.synthetic_bodies, rng)
    raise InputError(
        f"problem {config.problem.name}: no asteroid table; give one with --catalogue FILE "
        "(the README says where the official tables are)"
    )


def to_toml(config: Config) -> str:
    """Return the resolved configuration as TOML; `read_config` reads it back."""
    tables = msgspec.to_builtins(config)
    plain = {
        name: {key: value for key, value in table.items() if value is not None}
        for name, table in tables.items()
        if table is not None
    }
    return tomli_w.dumps(plain)

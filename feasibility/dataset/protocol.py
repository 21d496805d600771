"""`Protocol`: what a protocol's TOML file may say, and how it is read."""

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, final

import msgspec
from msgspec import Meta

from feasibility.dataset.samplers.impulsive import ImpulsiveGrid
from feasibility.dataset.samplers.make import NamedSampler
from feasibility.dataset.samplers.protocol import Sampler
from feasibility.errors import InputError
from feasibility.legs import Spacecraft, acceleration_fault
from feasibility.runtime.toml_file import decode_toml, read_toml

if TYPE_CHECKING:
    _Sampler = Sampler
else:
    # A file names one of ours; a caller may hand over any other.
    _Sampler = NamedSampler

_Positive = Annotated[float, Meta(gt=0)]


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A TOML table in which every key is known."""


@final
class SpacecraftTable(_Table, frozen=True, kw_only=True):
    """Table ``[spacecraft]``."""

    dry_mass_kg: Annotated[float, Meta(ge=0)]
    thrust_n: Annotated[float, Meta(gt=0)]
    isp_s: Annotated[float, Meta(gt=0)]

    def __post_init__(self) -> None:
        # Its checks are those of the values: a thrust in mN and the like.
        self.craft()

    def craft(self) -> Spacecraft:
        """Return the spacecraft."""
        return Spacecraft(m_dry=self.dry_mass_kg, thrust=self.thrust_n, isp=self.isp_s)


@final
class CatalogueTable(_Table, frozen=True, kw_only=True):
    """Table ``[catalogue]``: a file, or else a synthetic main belt."""

    file: str | None = None
    synthetic_bodies: Annotated[int, Meta(ge=2, le=10_000_000)] = 16256
    synthetic_seed: Annotated[int, Meta(ge=0)] = 0


@final
class Protocol(_Table, frozen=True, kw_only=True):
    """How the legs of a dataset are drawn and labelled.

    Parameters
    ----------
    name, description : str
        For people.
    sampler : Sampler
        What draws the legs: a `NamedSampler`, or one of your own.
    spacecraft : SpacecraftTable, optional
        The one spacecraft; needed by samplers that do not draw their own.
    catalogue : CatalogueTable
        The bodies.
    impulsive_grid : ImpulsiveGrid
        Grid of dt_imp.
    label : "margin" or "convergence"
        What makes a leg feasible: initial mass up to m*, or, as in the paper,
        that the minimum-propellant problem converged from one random start.
    solver : "fast", "reference", "best" or "auto"
        Leg solver of m*, and of the minimum propellant, as `method` of `optimise`.
    propellant : bool
        Whether the minimum-propellant problem is solved where the leg is flyable
        (margin label only).
    boundary_share : float
        Share of rows whose initial mass is drawn again, near m*, after solving.
    boundary_sigma : float
        Standard deviation of log(m0 / m*) of those rows.
    margin_range : pair of float, optional
        Range of m* / m0, log-uniform, from which the initial masses of all rows are drawn after
        solving, so that every leg can be flown where it begins at 1; margin label only, and
        without `boundary_share`. The sampler's range of masses is not exceeded.
    masses_per_leg : int
        Rows that differ in the initial mass alone: m* is found once for them, which is most
        of the work. With `margin_range` only.
    legs_per_shard : int
        Rows of one Parquet file: the unit of work and of random numbers.
    """

    name: str
    description: str = ""
    label: Literal["margin", "convergence"] = "margin"
    solver: Literal["fast", "reference", "best", "auto"] = "fast"
    propellant: bool = True
    boundary_share: Annotated[float, Meta(ge=0, le=1)] = 0.0
    boundary_sigma: Annotated[float, Meta(gt=0)] = 0.05
    margin_range: tuple[_Positive, _Positive] | None = None
    masses_per_leg: Annotated[int, Meta(ge=1, le=1000)] = 1
    legs_per_shard: Annotated[int, Meta(ge=1, le=1_000_000)] = 2000
    sampler: _Sampler
    spacecraft: SpacecraftTable | None = None
    catalogue: CatalogueTable = msgspec.field(default_factory=CatalogueTable)
    impulsive_grid: ImpulsiveGrid = msgspec.field(default_factory=ImpulsiveGrid)

    def __post_init__(self) -> None:
        self._check_margins()
        if self.sampler.draws_spacecraft:
            if self.spacecraft is not None:
                raise ValueError("this sampler draws its own; expected no [spacecraft]")
            return
        if self.spacecraft is None:
            raise ValueError("no table [spacecraft], which this sampler needs")
        if self.sampler.m0_kg[0] < self.spacecraft.dry_mass_kg:
            raise ValueError(
                f"sampler m0_kg begins at {self.sampler.m0_kg[0]:g}, below "
                f"dry_mass_kg = {self.spacecraft.dry_mass_kg:g}"
            )
        fault = acceleration_fault(self.spacecraft.thrust_n, self.sampler.m0_kg[0])
        if fault is not None:
            raise ValueError(f"thrust_n: {fault}")

    def _check_margins(self) -> None:
        """Raise ValueError where `margin_range` does not fit the rest."""
        if self.margin_range is None:
            if self.masses_per_leg > 1:
                raise ValueError("masses_per_leg: expected a margin_range with it")
            return
        low, high = self.margin_range
        if low > high:
            raise ValueError(f"margin_range = [{low:g}, {high:g}], expected the smaller one first")
        if self.label != "margin" or self.boundary_share > 0:
            raise ValueError('margin_range: expected label = "margin" and no boundary_share')

    def craft(self) -> Spacecraft | None:
        """Return the one spacecraft, None where each leg has its own."""
        table = self.spacecraft
        if table is None:
            return None
        return table.craft()

    def with_catalogue(self, file: str) -> "Protocol":
        """Return the protocol with another catalogue file."""
        return msgspec.structs.replace(self, catalogue=CatalogueTable(file=file))

    def to_dict(self) -> dict[str, Any]:
        """Return every setting as plain data, as JSON and TOML have it."""
        plain: dict[str, Any] = msgspec.to_builtins(self)
        # Datasets of versions that did not know these can still be completed.
        for name in ("margin_range", "masses_per_leg"):
            if plain[name] in (None, 1):
                del plain[name]
        kind = type(self.sampler)
        # Structs with a tag write it themselves; other samplers are told apart by their class.
        plain["sampler"] = {"kind": f"{kind.__module__}.{kind.__qualname__}"} | plain["sampler"]
        return plain


def builtin_protocols() -> dict[str, str]:
    """Return the names of the built-in protocols and their TOML texts."""
    folder = resources.files("feasibility.dataset") / "protocols"
    return {
        entry.name.removesuffix(".toml"): entry.read_text(encoding="utf-8")
        for entry in sorted(folder.iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith(".toml")
    }


def read_protocol(protocol: str) -> Protocol:
    """Read a protocol by name or from a TOML file.

    Parameters
    ----------
    protocol : str
        Name of a built-in protocol, or path of a TOML file.

    Raises
    ------
    InputError
        No such protocol, unreadable file, TOML that does not parse, an unknown
        key, or a value of the wrong type or range; the message names file and key.
    """
    builtin = builtin_protocols()
    if protocol in builtin:
        return decode_toml(builtin[protocol], Protocol, f"built-in protocol {protocol}")
    path = Path(protocol)
    if not path.exists():
        raise InputError(
            f"{protocol}: no such protocol or file; built-in protocols are {', '.join(builtin)}"
        )
    read = read_toml(path, Protocol)
    file = read.catalogue.file
    if file is not None and not Path(file).is_absolute():
        # A path inside a file is meant relative to that file.
        return read.with_catalogue(str(path.parent / file))
    return read

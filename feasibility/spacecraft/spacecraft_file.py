"""`SpacecraftFile`: a user's spacecraft as a TOML file, and the protocols of its legs."""

from pathlib import Path
from typing import Annotated, Any, Final, final

import msgspec
from msgspec import Meta

from feasibility.dataset.protocol import CatalogueTable, Protocol, SpacecraftTable
from feasibility.dataset.samplers.draws import check_ranges
from feasibility.dataset.samplers.random_pairs import RandomPairs
from feasibility.dataset.samplers.search_candidates import SearchCandidates
from feasibility.errors import InputError
from feasibility.legs import Spacecraft, acceleration_fault
from feasibility.runtime.toml_file import convert_table, parse_toml, read_toml_text

_Positive = Annotated[float, Meta(gt=0)]
_Range = tuple[_Positive, _Positive]
_Share = Annotated[float, Meta(ge=0, le=1)]

EXAMPLE: Final = """\
name = "probe"                # of the datasets and of the report

[spacecraft]                  # as in a problem's file
wet_mass_kg = 2000.0
dry_mass_kg = 800.0
thrust_n = 0.3                # largest thrust
isp_s = 3000.0
m0_kg = [800.0, 2000.0]       # masses with which its legs begin (default: dry to wet mass)

[sampling]                    # all of it may be left out; these are the defaults
start_mjd = [58849.0, 73459.0]  # departures, 1 Jan 2020 to 1 Jan 2060
search_share = 0.5            # of the legs: near neighbours with flights of tof_days, as a
                              # search asks about; the others: random pairs with flights of
                              # tof_ratio times the cheapest impulsive one, as in Table 1
tof_days = [40.0, 500.0]
neighbours = 60               # targets are among this many nearest bodies
tof_ratio = [0.6, 2.4]
tof_days_max = 1460.0
boundary_share = 0.5          # of the legs: mass drawn again near the heaviest possible
boundary_sigma = 0.05         # how near: standard deviation of log(m0 / m*)
"""
"""A complete file."""

LEGS_PER_SHARD: Final = 500


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A TOML table in which every key is known."""


@final
class Sampling(_Table, frozen=True, kw_only=True):
    """Table ``[sampling]``; `EXAMPLE` says what the keys mean."""

    start_mjd: _Range = (58849.0, 73459.0)
    search_share: _Share = 0.5
    tof_days: _Range = (40.0, 500.0)
    neighbours: Annotated[int, Meta(ge=1, le=100_000)] = 60
    tof_ratio: _Range = (0.6, 2.4)
    tof_days_max: Annotated[float, Meta(gt=0, le=1e5)] = 1460.0
    boundary_share: _Share = 0.5
    boundary_sigma: _Positive = 0.05

    def __post_init__(self) -> None:
        check_ranges(start_mjd=self.start_mjd, tof_days=self.tof_days, tof_ratio=self.tof_ratio)


@final
class _SpacecraftTable(_Table, frozen=True, kw_only=True):
    """Table ``[spacecraft]``, which problem files have too, there without `m0_kg`."""

    dry_mass_kg: Annotated[float, Meta(ge=0)]
    thrust_n: _Positive
    isp_s: _Positive
    wet_mass_kg: _Positive | None = None
    m0_kg: _Range | None = None

    def __post_init__(self) -> None:
        if self.wet_mass_kg is None and self.m0_kg is None:
            raise ValueError("no key 'wet_mass_kg', expected one, or 'm0_kg'")
        if self.wet_mass_kg is not None:
            if self.wet_mass_kg <= self.dry_mass_kg:
                raise ValueError(
                    f"wet_mass_kg = {self.wet_mass_kg:g}, expected more than "
                    f"dry_mass_kg = {self.dry_mass_kg:g}"
                )
            if self.m0_kg is not None and self.m0_kg[1] > self.wet_mass_kg:
                raise ValueError(
                    f"m0_kg ends at {self.m0_kg[1]:g}, above wet_mass_kg = {self.wet_mass_kg:g}"
                )

    def masses(self) -> _Range:
        """Return the range of masses with which legs begin."""
        if self.m0_kg is not None:
            return self.m0_kg
        assert self.wet_mass_kg is not None
        return max(self.dry_mass_kg, _LEAST_SHARE * self.wet_mass_kg), self.wet_mass_kg


_LEAST_SHARE: Final = 0.1
"""Of the wet mass: the lightest that a leg begins with where there is no dry mass."""

_CRAFT_KEYS: Final = {"dry_mass_kg", "thrust_n", "isp_s", "wet_mass_kg", "m0_kg"}


@final
class SpacecraftFile(_Table, frozen=True, kw_only=True):
    """A spacecraft and the legs that it flies.

    Parameters
    ----------
    dry_mass_kg, thrust_n, isp_s : float
        The spacecraft.
    m0_kg : pair of float
        Range of the masses with which its legs begin.
    name : str
        For people.
    sampling : Sampling
        Which legs are drawn.
    """

    dry_mass_kg: Annotated[float, Meta(ge=0)]
    thrust_n: _Positive
    isp_s: _Positive
    m0_kg: _Range
    name: str = "spacecraft"
    sampling: Sampling = msgspec.field(default_factory=Sampling)

    def __post_init__(self) -> None:
        check_ranges(m0_kg=self.m0_kg)
        # Its checks are those of the values: a thrust in mN and the like.
        Spacecraft(self.dry_mass_kg, self.thrust_n, self.isp_s)
        fault = acceleration_fault(self.thrust_n, self.m0_kg[0])
        if fault is not None:
            raise ValueError(f"thrust_n: {fault}")
        if self.m0_kg[0] < self.dry_mass_kg:
            raise ValueError(
                f"m0_kg begins at {self.m0_kg[0]:g}, below dry_mass_kg = {self.dry_mass_kg:g}"
            )

    def protocols(self, catalogue: str | None) -> dict[str, tuple[Protocol, float]]:
        """Return the protocols of its legs and the share of the legs of each, by kind.

        Parameters
        ----------
        catalogue : str, optional
            Asteroid table; a synthetic main belt if not given.
        """
        sampling = self.sampling
        samplers: dict[str, tuple[RandomPairs | SearchCandidates, float]] = {
            "search": (
                SearchCandidates(
                    start_mjd=sampling.start_mjd,
                    m0_kg=self.m0_kg,
                    tof_days=sampling.tof_days,
                    long_share=0.0,
                    neighbours=sampling.neighbours,
                ),
                sampling.search_share,
            ),
            "pairs": (
                RandomPairs(
                    start_mjd=sampling.start_mjd,
                    m0_kg=self.m0_kg,
                    tof_ratio=sampling.tof_ratio,
                    tof_days_max=sampling.tof_days_max,
                ),
                1.0 - sampling.search_share,
            ),
        }
        craft = SpacecraftTable(
            dry_mass_kg=self.dry_mass_kg, thrust_n=self.thrust_n, isp_s=self.isp_s
        )
        return {
            kind: (
                Protocol(
                    name=f"{self.name} {kind}",
                    propellant=False,
                    boundary_share=sampling.boundary_share,
                    boundary_sigma=sampling.boundary_sigma,
                    legs_per_shard=LEGS_PER_SHARD,
                    sampler=sampler,
                    spacecraft=craft,
                    catalogue=CatalogueTable(file=catalogue),
                ),
                share,
            )
            for kind, (sampler, share) in samplers.items()
            if share > 0.0
        }

    def to_dict(self) -> dict[str, Any]:
        """Return every setting as plain data."""
        plain: dict[str, Any] = msgspec.to_builtins(self)
        return plain


def read_spacecraft(path: str | Path) -> SpacecraftFile:
    """Read a spacecraft's TOML file: `EXAMPLE`, or the same keys without a table.

    Raises
    ------
    InputError
        The file cannot be read, is not TOML, lacks a key, has an unknown one, or a
        value of the wrong type or range; the message names file and key.
    """
    label = str(path)
    plain = parse_toml(read_toml_text(Path(path)), label)
    if "spacecraft" in plain:
        table = convert_table(plain.pop("spacecraft"), _SpacecraftTable, label, "spacecraft")
        twice = sorted(_CRAFT_KEYS & plain.keys())
        if twice:
            raise InputError(
                f"{label}: {twice[0]} at top level beside [spacecraft], expected it there"
            )
        plain |= {key: getattr(table, key) for key in ("dry_mass_kg", "thrust_n", "isp_s")}
        plain["m0_kg"] = table.masses()
    return convert_table(plain, SpacecraftFile, label)

"""A problem, an event and a score rule in a package of their own, as somebody else would write it.

Pilgrims visit bodies in ascending order of their ids, and pay a toll for each.
"""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

INIT = '''
"""Pilgrimage: a tour of bodies in ascending order of their ids."""

import msgspec


class PilgrimageRules(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    toll: float
    longest_step: int = 1000


RULES = PilgrimageRules


def build(base, rules):
    from pilgrimage.problem import Pilgrimage

    return Pilgrimage(base=base, rules=rules)
'''

PROBLEM = '''
from dataclasses import dataclass
from typing import ClassVar

import msgspec

from seqsearch.problems.variant import RendezvousVariant
from seqsearch.tours.checks import Check


@dataclass(frozen=True, kw_only=True, eq=False)
class Pilgrimage(RendezvousVariant):
    """A tour of rendezvous in ascending order of the ids."""

    rules: object

    def may_visit(self, nodes, target, /):
        ids = self.base.catalogue.ids
        step = ids[target] - ids[nodes.row][:, None]
        forward = (step > 0) & (step <= self.rules.longest_step)
        return self.base.may_visit(nodes, target) & forward

    def tour_rules(self):
        return msgspec.structs.replace(
            self.base.tour_rules(),
            events=(Ascending(longest_step=self.rules.longest_step),),
            score=AfterToll(toll=self.rules.toll),
        )


class Ascending(msgspec.Struct, frozen=True, tag_field="kind", tag="ascending"):
    longest_step: int

    @classmethod
    def forbidden(cls):
        return None

    def checks(self, flown, /):
        ids = [body.id for body in flown.bodies]
        steps = [b - a for a, b in zip(ids, ids[1:])]
        good = all(0 < step <= self.longest_step for step in steps)
        return [Check("ids ascend", good, f"steps {steps}", f"1 to {self.longest_step}")]


class AfterToll(msgspec.Struct, frozen=True, tag_field="kind", tag="after-toll"):
    name: ClassVar[str] = "merit"
    unit: ClassVar[str] = "pilgrims"

    toll: float

    def score(self, visits, legs, /):
        return len(visits) - self.toll * len(legs)
'''

TABLES = """
[problem]
name = "pilgrimage"
description = "upwards, ever upwards"
[spacecraft]
wet_mass_kg = 2000
dry_mass_kg = 800
thrust_n = 0.3
isp_s = 3000
[mission]
first_departure_mjd = [59215, 60000]
max_duration_days = 900
min_stay_days = 30
[catalogue]
synthetic_bodies = 1500
[pilgrimage]
toll = 0.25
longest_step = 1200
[search]
pruner = "mima2:0.97"
beam_width = 6
starts = 40
start_epochs = 2
neighbours = 40
tof_days_step = 40
solves_per_rank = 150
[search.audit]
per_rank = 6
"""

ENTRY_POINTS = """
[seqsearch.problems]
pilgrimage = pilgrimage
[seqsearch.events]
ascending = pilgrimage.problem:Ascending
[seqsearch.scores]
after-toll = pilgrimage.problem:AfterToll
"""


def install(site: Path, package: str, entry_points: str, files: dict[str, str]) -> None:
    """Put a package and what an installer would write of it into a folder of packages."""
    (site / package).mkdir(parents=True)
    for name, text in files.items():
        (site / package / name).write_text(text)
    about = site / f"{package}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(entry_points)


def install_pilgrimage(site: Path) -> None:
    """Install the pilgrims' package."""
    files = {"__init__.py": INIT, "problem.py": PROBLEM, "pilgrimage.toml": TABLES}
    install(site, "pilgrimage", ENTRY_POINTS, files)


def run_with(site: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a process that finds the packages of a folder, and ours."""
    path = os.pathsep.join([str(site), str(ROOT)])
    return subprocess.run(
        [sys.executable, *arguments],
        check=False,
        capture_output=True,
        text=True,
        timeout=300,
        env=os.environ | {"PYTHONPATH": path},
        cwd=site,
    )

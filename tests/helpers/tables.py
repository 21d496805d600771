"""Asteroid tables as files that several tests share."""

from pathlib import Path

import numpy as np

from feasibility.constants import AU, MJD2000_MJD
from feasibility.orbits import synthetic_main_belt


def write_table(path: Path, bodies: int, seed: int = 3) -> None:
    """Write a synthetic main belt in the layout ``ID epoch(MJD) a(AU) e i(deg) ...``."""
    belt = synthetic_main_belt(bodies, np.random.default_rng(seed))
    lines = ["ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)"]
    for body_id, epoch, (a, e, *angles) in zip(
        belt.ids, belt.epoch_mjd2000, belt.elements, strict=True
    ):
        numbers = (epoch + MJD2000_MJD, a / AU, e, *np.degrees(angles))
        lines.append(f"{body_id} " + " ".join(f"{number:.15g}" for number in numbers))
    path.write_text("\n".join(lines) + "\n")

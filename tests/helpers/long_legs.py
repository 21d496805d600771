"""Long legs that several tests of the solvers share."""

import numpy as np

from feasibility import Legs
from feasibility.constants import AU
from feasibility.orbits import classical_to_cartesian


def long_legs(n: int, seed: int) -> Legs:
    """Return legs of one to two revolutions between belt orbits."""
    rng = np.random.default_rng(seed)
    low = [2.2, 0.0, 0.0, 0.0, 0.0, 0.0]
    high = [3.0, 0.15, 0.1, 2 * np.pi, 2 * np.pi, 2 * np.pi]
    elements = rng.uniform(low, high, (2, n, 6)) * [AU, 1, 1, 1, 1, 1]
    return Legs(
        rv_dep=classical_to_cartesian(elements[0]),
        rv_arr=classical_to_cartesian(elements[1]),
        tof_days=rng.uniform(1200.0, 1700.0, n),
        m0=1000.0,
        thrust=0.6,
        isp=4000.0,
        m_dry=0.0,
    )

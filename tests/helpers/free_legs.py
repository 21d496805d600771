"""Legs with free ends that several tests share."""

import numpy as np

from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.legs import Legs
from feasibility.orbits import classical_to_cartesian
from feasibility.orbits.kepler_kernels import propagate_batch


def free_legs(n: int, seed: int, vinf_dep=0.0, vinf_arr=0.0, far: float = 0.1) -> Legs:
    """Return legs of 150 to 500 days that arrive about `far` AU from where they would coast to."""
    rng = np.random.default_rng(seed)
    elements = np.column_stack(
        [
            rng.uniform(1.0, 2.8, n) * AU,
            rng.uniform(0.0, 0.15, n),
            rng.uniform(0.0, 0.1, n),
            *rng.uniform(0.0, 2.0 * np.pi, (3, n)),
        ]
    )
    departure = classical_to_cartesian(elements)
    tof = rng.uniform(150.0, 500.0, n)
    arrival = propagate_batch(departure, tof * DAY_S, MU_SUN)
    arrival[:, :3] += rng.normal(0.0, far * AU, (n, 3))
    arrival[:, 3:] += rng.normal(0.0, 1500.0, (n, 3))
    return with_ends(
        Legs(departure, arrival, tof, m0=1500.0, thrust=0.3, isp=3000.0, m_dry=100.0),
        vinf_dep,
        vinf_arr,
    )


def with_ends(legs: Legs, vinf_dep=0.0, vinf_arr=0.0) -> Legs:
    """Return the same legs with other largest excess velocities."""
    return Legs(
        legs.rv_dep,
        legs.rv_arr,
        legs.tof_days,
        legs.m0,
        legs.thrust,
        legs.isp,
        legs.m_dry,
        vinf_dep=vinf_dep,
        vinf_arr=vinf_arr,
    )

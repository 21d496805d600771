"""Compile the fast solver's kernels before worker processes start."""

import os

import numpy as np

from feasibility.constants import AU, EARTH_VELOCITY
from feasibility.legs import Legs
from feasibility.sims_flanagan.fast import fast_max_initial_mass, fast_min_propellant


def prefer_fast_compilation() -> None:
    """Ask numba for LLVM's level 1, unless the user's environment says otherwise.

    Measured: a fifth less compilation time, and the kernels run as fast. For
    our own programs, before numba is loaded: a library must not decide this.
    """
    os.environ.setdefault("NUMBA_OPT", "1")


def compile_kernels() -> None:
    """Compile and cache every kernel of the fast solver, or load it from the cache.

    Without it, workers that start with an empty cache would all compile the
    same kernels at the same time. Costs about a second where the cache is
    there: kernels are loaded, and pykep imported to confirm the solution.
    """
    legs = sample_leg()
    fast_min_propellant(legs, guess=fast_max_initial_mass(legs))


def sample_leg() -> Legs:
    """Return one leg that can be flown, for a first call of anything that looks at legs."""
    circular = EARTH_VELOCITY / np.sqrt(2.5)
    angle = np.radians(70.0)
    return Legs(
        rv_dep=[2.5 * AU, 0.0, 0.0, 0.0, circular, 0.0],
        rv_arr=[
            *(2.55 * AU * np.cos(angle), 2.55 * AU * np.sin(angle), 0.02 * AU),
            *(-circular * np.sin(angle), circular * np.cos(angle), 0.0),
        ],
        tof_days=280.0,
        m0=500.0,
        thrust=0.5,
        isp=3000.0,
        m_dry=0.0,
    )

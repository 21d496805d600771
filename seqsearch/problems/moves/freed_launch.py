"""Launches whose direction the leg solver finds, in place of one that was chosen before."""

import numpy as np

from feasibility import Legs
from feasibility.orbits import Catalogue
from seqsearch.core.hops import Hops

VINF_SLACK = 2e-6
"""Share of a bound that legs leave: solvers may exceed theirs by half of it."""


def freed_launch(hops: Hops, catalogue: Catalogue, speed_max_m_s: float) -> Hops:
    """Return hops whose first legs depart with any excess velocity up to a bound.

    Whatever velocity they had is among those that the solver may take.

    Parameters
    ----------
    hops : Hops
        n hops.
    catalogue : Catalogue
        Their bodies.
    speed_max_m_s : float
        Largest excess speed.
    """
    first = hops.legs[0]
    assert first.t_dep_mjd2000 is not None
    assert first.dep_id is not None
    states = catalogue.states_at(catalogue.rows_of(first.dep_id), first.t_dep_mjd2000)
    freed = Legs(
        np.concatenate([first.rv_dep[:, :3], states[:, 3:]], axis=1),
        first.rv_arr,
        first.tof_days,
        first.m0,
        first.thrust,
        first.isp,
        first.m_dry,
        t_dep_mjd2000=first.t_dep_mjd2000,
        dep_id=first.dep_id,
        arr_id=first.arr_id,
        vinf_dep=(1.0 - VINF_SLACK) * speed_max_m_s,
        vinf_arr=first.vinf_arr,
    )
    return Hops((freed, *hops.legs[1:]), hops.dropped_kg)

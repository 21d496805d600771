"""The rules of GTOC7 in numbers: the mother ship, its probes and the Earth.

From the problem statement (Casalino and Colasurdo, "Problem description for the 7th Global
Trajectory Optimisation Competition", 2014).
"""

from typing import Final

from feasibility.constants import MJD2000_MJD, YEAR_DAYS
from feasibility.orbits import earth
from seqsearch.core.recording import tour_body
from seqsearch.tours.carrier.records import CarrierRules, CraftRules

NAME: Final = "gtoc7-full"


def carrier_rules() -> CarrierRules:
    """Return what the mother ship and its three probes have to respect."""
    return CarrierRules(
        name=NAME,
        planet=tour_body(earth(), 0),
        launch_mjd2000=(59215.0 - MJD2000_MJD, 62867.0 - MJD2000_MJD),
        v_inf_max_m_s=6000.0,
        m0_kg=24000.0,
        m_dry_kg=6000.0,
        isp_s=900.0,
        max_impulses=10,
        max_duration_days=12 * YEAR_DAYS,
        craft_count=3,
        craft=CraftRules(
            m0_kg=2000.0,
            m_dry_kg=800.0,
            thrust_n=0.3,
            isp_s=3000.0,
            max_duration_days=6 * YEAR_DAYS,
            min_stay_days=30.0,
        ),
    )

"""The Earth as the GTOC problems define it."""

import numpy as np

from feasibility.constants import AU, MJD2000_MJD
from feasibility.orbits.catalogue import Catalogue


def earth() -> Catalogue:
    """Return the catalogue of one body: the Earth on its GTOC orbit.

    Osculating elements at MJD 54000 from the problem statements of GTOC2,
    GTOC5 and GTOC7 (the same values in all three). The id is 0, which no GTOC
    table gives to an asteroid.
    """
    angles_deg = [0.8854353079654e-3, 175.40647696473, 287.61577546182, 257.60683707535]
    return Catalogue(
        ids=[0],
        names=["Earth"],
        epoch_mjd2000=54000.0 - MJD2000_MJD,
        elements=[[0.999988049532578 * AU, 1.671681163160e-2, *np.radians(angles_deg)]],
        source="the Earth",
    )

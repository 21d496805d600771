"""Catalogues of tours that are launched from the Earth."""

import numpy as np

from feasibility import InputError
from feasibility.orbits import Catalogue, earth


def earth_first(asteroids: Catalogue) -> Catalogue:
    """Return the Earth, row 0, and asteroids, without the further columns of their table.

    Raises
    ------
    InputError
        An asteroid has the id of the Earth, 0.
    """
    if 0 in asteroids.ids:
        raise InputError(f"{asteroids.source} has a body with id 0, which is the Earth's")
    planet = earth()
    return Catalogue(
        ids=np.concatenate([planet.ids, asteroids.ids]),
        names=[*planet.names, *asteroids.names],
        epoch_mjd2000=np.concatenate([planet.epoch_mjd2000, asteroids.epoch_mjd2000]),
        elements=np.concatenate([planet.elements, asteroids.elements]),
        source=asteroids.source,
    )

"""Orbits: element conversions, catalogues of bodies, their ephemerides and neighbours.

Knows the vocabulary and nothing above it. Importing it
is cheap; the compiled kernels are loaded when they are first used.
"""

from feasibility.orbits.catalogue import Catalogue
from feasibility.orbits.classical import cartesian_to_classical, classical_to_cartesian
from feasibility.orbits.earth import earth
from feasibility.orbits.equinoctial import (
    cartesian_to_equinoctial,
    classical_to_equinoctial,
    equinoctial_to_cartesian,
    equinoctial_to_classical,
)
from feasibility.orbits.neighbours import OrbitalNeighbours, orbital_metric
from feasibility.orbits.synthetic import synthetic_main_belt
from feasibility.orbits.tables import read_catalogue

__all__ = [
    "Catalogue",
    "OrbitalNeighbours",
    "cartesian_to_classical",
    "cartesian_to_equinoctial",
    "classical_to_cartesian",
    "classical_to_equinoctial",
    "earth",
    "equinoctial_to_cartesian",
    "equinoctial_to_classical",
    "orbital_metric",
    "read_catalogue",
    "synthetic_main_belt",
]

"""Sims-Flanagan legs: the reference solver (pykep and pygmo) and what every solver returns."""

from feasibility.sims_flanagan.mass_convention import impulses
from feasibility.sims_flanagan.solutions import LegSolutions, Status
from feasibility.sims_flanagan.solve import max_initial_mass, optimise, solve_max_initial_mass

__all__ = [
    "LegSolutions",
    "Status",
    "impulses",
    "max_initial_mass",
    "optimise",
    "solve_max_initial_mass",
]

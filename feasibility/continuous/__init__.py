"""Continuous thrust: legs of impulses refined to thrust that is constant over each day.

Knows nothing of tours. Beside the Sims-Flanagan solvers, from whose legs it starts.
"""

from feasibility.continuous.grid import file_epoch
from feasibility.continuous.leg import ContinuousArc, ContinuousLeg
from feasibility.continuous.refine import TIME_PRICE, refine_leg

__all__ = ["TIME_PRICE", "ContinuousArc", "ContinuousLeg", "file_epoch", "refine_leg"]

"""Refine: a tour of impulses becomes one of continuous thrust, leg by leg."""

from seqsearch.refine.refined import RefinedLeg, RefinedTour
from seqsearch.refine.refinement import refine_tour

__all__ = ["RefinedLeg", "RefinedTour", "refine_tour"]

"""Search for asteroid tours that a low-thrust spacecraft can fly.

The names below are the public face; they are loaded on first use.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from seqsearch.beam.beam_search import search
    from seqsearch.beam.rankings.check import check_ranking
    from seqsearch.beam.rankings.protocol import Ranking
    from seqsearch.beam.rankings.time_propellant import TimePropellantRanking
    from seqsearch.beam.result import SearchResult
    from seqsearch.core.check_problem import check_problem
    from seqsearch.core.problem import Problem
    from seqsearch.problems.problem_file import build_problem, load_problem, read_config
    from seqsearch.problems.rendezvous import RendezvousProblem
    from seqsearch.settings import SearchSettings
    from seqsearch.tours.checks import Verification
    from seqsearch.tours.pictures.plots import (
        plot_mass,
        plot_path,
        plot_thrust,
        plot_timeline,
        plot_tour,
    )
    from seqsearch.tours.tour import Tour
    from seqsearch.tours.tour_files import read_tour
    from seqsearch.tours.verify import verify_tour

__version__ = "0.1.0"

_HOMES = {
    "Problem": "seqsearch.core.problem",
    "Ranking": "seqsearch.beam.rankings.protocol",
    "RendezvousProblem": "seqsearch.problems.rendezvous",
    "SearchResult": "seqsearch.beam.result",
    "SearchSettings": "seqsearch.settings",
    "TimePropellantRanking": "seqsearch.beam.rankings.time_propellant",
    "Tour": "seqsearch.tours.tour",
    "Verification": "seqsearch.tours.checks",
    "build_problem": "seqsearch.problems.problem_file",
    "check_problem": "seqsearch.core.check_problem",
    "check_ranking": "seqsearch.beam.rankings.check",
    "load_problem": "seqsearch.problems.problem_file",
    "plot_mass": "seqsearch.tours.pictures.plots",
    "plot_path": "seqsearch.tours.pictures.plots",
    "plot_thrust": "seqsearch.tours.pictures.plots",
    "plot_timeline": "seqsearch.tours.pictures.plots",
    "plot_tour": "seqsearch.tours.pictures.plots",
    "read_config": "seqsearch.problems.problem_file",
    "read_tour": "seqsearch.tours.tour_files",
    "search": "seqsearch.beam.beam_search",
    "verify_tour": "seqsearch.tours.verify",
}

__all__ = [
    "Problem",
    "Ranking",
    "RendezvousProblem",
    "SearchResult",
    "SearchSettings",
    "TimePropellantRanking",
    "Tour",
    "Verification",
    "build_problem",
    "check_problem",
    "check_ranking",
    "load_problem",
    "plot_mass",
    "plot_path",
    "plot_thrust",
    "plot_timeline",
    "plot_tour",
    "read_config",
    "read_tour",
    "search",
    "verify_tour",
]


def __getattr__(name: str) -> object:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'seqsearch' has no attribute {name!r}")

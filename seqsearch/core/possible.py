"""Whether a mission can have any tour at all, told before a search begins."""

from feasibility import InputError
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings


def check_possible(problem: Problem, settings: SearchSettings) -> None:
    """Refuse a mission in which no hop, or no second one, fits.

    Raises
    ------
    InputError
        The shortest flight time or the shortest stay is longer than the mission.
    """
    if settings.tof_days_min > problem.max_duration_days:
        raise InputError(
            f"problem {problem.name}: no hop fits: the least flight time of "
            f"{settings.tof_days_min:g} days (tof_days_min) is longer than the whole mission of "
            f"{problem.max_duration_days:g} days (max_duration_days)"
        )
    if problem.min_stay_days > problem.max_duration_days:
        raise InputError(
            f"problem {problem.name}: a stay of {problem.min_stay_days:g} days (min_stay_days) "
            f"is longer than the whole mission of {problem.max_duration_days:g} days "
            "(max_duration_days), so that no tour has more than one leg"
        )

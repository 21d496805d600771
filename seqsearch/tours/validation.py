"""Whether the numbers of a tour file can be those of a tour at all, before anything is computed.

Limits are wide: what lies outside is a slip of units, a damaged file or a forgery, and would only
make the verification slow or blind.
"""

import math
from collections.abc import Iterator
from typing import Final

from feasibility.constants import AU
from feasibility.errors import InputError
from seqsearch.tours.records import LARGEST_M_STAR_KG, TourBody, TourLeg
from seqsearch.tours.tour import Tour, TourRules

_MAX_MJD2000: Final = 150_000.0
"""Epochs within 400 years of 2000, as asteroid tables may have them."""

_MAX_TOF_DAYS: Final = 50_000.0
_MAX_MASS_KG: Final = LARGEST_M_STAR_KG
_MAX_SPEED_M_S: Final = 1e6
_MAX_A_M: Final = 1e4 * AU
_MAX_LEGS: Final = 10_000
_MAX_IMPULSES: Final = 10_000
_SLACK_DAYS: Final = 1e-6


def check_numbers(tour: Tour) -> None:
    """Refuse a tour with numbers that no tour has.

    Raises
    ------
    InputError
        A number is not finite or out of range, an orbit is no ellipse, a leg has no
        impulse, or an impulse is not between the ends of its leg.
    """
    for problem in _problems(tour):
        raise InputError(problem)


def _problems(tour: Tour) -> Iterator[str]:
    if tour.legs and not tour.bodies:
        yield f"has {len(tour.legs)} legs and no body"
    if len(tour.legs) > _MAX_LEGS:
        yield f"has {len(tour.legs)} legs, expected at most {_MAX_LEGS}"
    yield from _of_rules(tour.rules)
    yield from _outside("start epoch", tour.t_start_mjd2000, -_MAX_MJD2000, _MAX_MJD2000)
    if not math.isfinite(tour.score):
        yield f"score {tour.score}, expected a number"
    for body in tour.bodies:
        yield from _of_body(body)
    for k, leg in enumerate(tour.legs, 1):
        yield from _of_leg(f"leg {k}: ", leg)


def _of_rules(rules: TourRules) -> Iterator[str]:
    for name, most in (("m0_kg", _MAX_MASS_KG), ("thrust_n", 1e6), ("isp_s", 1e6)):
        value = getattr(rules, name)
        if not 0.0 < value <= most:
            yield f"rules: {name} {value:g}, expected more than 0 and at most {most:g}"
    yield from _outside("rules: m_dry_kg", rules.m_dry_kg, 0.0, _MAX_MASS_KG)
    for name, least, most in (("mu_m3_s2", 1e10, 1e25), ("g0_m_s2", 1.0, 100.0)):
        yield from _outside(f"rules: {name}", getattr(rules, name), least, most)
    for body in rules.unscored or ():
        yield from _of_body(body)


def _of_body(body: TourBody) -> Iterator[str]:
    label = f"body {body.id}: "
    if not 0.0 <= body.e < 1.0:
        yield f"{label}eccentricity {body.e:g}, expected an ellipse, 0 <= e < 1"
    if not 0.0 < body.a_m <= _MAX_A_M:
        yield f"{label}semi-major axis {body.a_m:g} m, expected more than 0"
    yield from _outside(f"{label}epoch", body.epoch_mjd2000, -_MAX_MJD2000, _MAX_MJD2000)
    for name in ("i_rad", "node_rad", "argp_rad", "mean_anomaly_rad"):
        yield from _outside(f"{label}{name}", getattr(body, name), -100.0, 100.0)


def _of_leg(label: str, leg: TourLeg) -> Iterator[str]:
    yield from _outside(f"{label}departure", leg.t_dep_mjd2000, -_MAX_MJD2000, _MAX_MJD2000)
    if not 0.0 < leg.tof_days <= _MAX_TOF_DAYS:
        yield f"{label}time of flight {leg.tof_days:g} days, expected 0 to {_MAX_TOF_DAYS:g}"
    for name in ("m0_kg", "m_final_kg", "m_star_kg"):
        value = getattr(leg, name)
        if not 0.0 < value <= _MAX_MASS_KG:
            yield f"{label}{name} {value:g}, expected more than 0"
    yield from _outside(f"{label}dropped_kg", leg.dropped_kg, 0.0, _MAX_MASS_KG)
    for name in ("dep_velocity_m_s", "arr_velocity_m_s"):
        for value in getattr(leg, name):
            yield from _outside(f"{label}{name}", value, -_MAX_SPEED_M_S, _MAX_SPEED_M_S)
    for name in ("dep_body_state", "arr_body_state"):
        for k, value in enumerate(getattr(leg, name) or ()):
            most = _MAX_A_M if k < 3 else _MAX_SPEED_M_S
            yield from _outside(f"{label}{name}", value, -most, most)
    if not 1 <= len(leg.impulses) <= _MAX_IMPULSES:
        yield f"{label}{len(leg.impulses)} impulses, expected 1 to {_MAX_IMPULSES}"
    before = leg.t_dep_mjd2000 - _SLACK_DAYS
    for i, impulse in enumerate(leg.impulses, 1):
        here = f"{label}impulse {i}: "
        if not before <= impulse.t_mjd2000 <= leg.t_arr_mjd2000 + _SLACK_DAYS:
            yield f"{here}epoch {impulse.t_mjd2000:g} is not in order between the leg's ends"
        before = impulse.t_mjd2000
        for name in ("mass_before_kg", "mass_after_kg"):
            yield from _outside(f"{here}{name}", getattr(impulse, name), 0.0, _MAX_MASS_KG)
        for value in (*impulse.dv_m_s, *impulse.throttle):
            yield from _outside(f"{here}component", value, -_MAX_SPEED_M_S, _MAX_SPEED_M_S)


def _outside(label: str, value: float, least: float, most: float) -> Iterator[str]:
    if not least <= value <= most:
        yield f"{label} {value:g}, expected {least:g} to {most:g}"

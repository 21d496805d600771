"""Pruners named in a configuration or on the command line."""

from collections.abc import Callable
from typing import Final

from feasibility import AllOf, InputError, LambertPruner, Mima2Pruner, MimaPruner, Pruner

_BY_NAME: Final[dict[str, Callable[..., Pruner]]] = {
    "lambert": LambertPruner,
    "mima": MimaPruner,
    "mima2": Mima2Pruner,
}


def parse_pruner(spec: str) -> AllOf:
    """Build pruners from a specification.

    Parameters
    ----------
    spec : str
        Comma-separated names, each with an optional parameter after a colon:
        ``"lambert:1.3,mima2:0.97"``. ``"none"`` keeps every leg. The parameter
        is the factor of `LambertPruner` or the margin of the MIMA pruners.

    Raises
    ------
    InputError
        Unknown name, or a parameter that is no positive number.
    """
    if spec.strip() == "none":
        return AllOf()
    return AllOf(*(_parse_one(part.strip(), spec) for part in spec.split(",")))


def _parse_one(part: str, spec: str) -> Pruner:
    name, colon, parameter = part.partition(":")
    if name not in _BY_NAME:
        raise InputError(
            f"pruner {spec!r}: unknown pruner {name!r}; known are none, {', '.join(_BY_NAME)}"
        )
    if not colon:
        return _BY_NAME[name]()
    try:
        value = float(parameter)
    except ValueError:
        value = float("nan")
    if not 0 < value < float("inf"):
        raise InputError(f"pruner {spec!r}: {parameter!r} is not a positive number")
    return _BY_NAME[name](value)

"""Pruners named in a configuration or on the command line."""

from collections.abc import Callable
from typing import Final

from feasibility import AllOf, InputError, LambertPruner, Mima2Pruner, MimaPruner, Pruner
from feasibility.classifier.predictor import LegPredictor

_BY_NAME: Final[dict[str, Callable[..., Pruner]]] = {
    "lambert": LambertPruner,
    "mima": MimaPruner,
    "mima2": Mima2Pruner,
}

_MODEL_SUFFIX: Final = ".seqmodel"
_DEFAULT_MODEL: Final = "default"


def parse_pruner(spec: str) -> AllOf:
    """Build pruners from a specification.

    Parameters
    ----------
    spec : str
        Comma-separated names, each with an optional parameter after a colon:
        ``"lambert:1.3,mima2:0.97"``. ``"none"`` keeps every leg. The parameter
        is the factor of `LambertPruner` or the margin of the MIMA pruners.
        ``"default"`` is the classifier that comes with the package, a name that
        ends in ``.seqmodel`` the file of another one; their parameter is the
        recall.

    Raises
    ------
    InputError
        Unknown name, a parameter that is no positive number, or a model that
        cannot be used.
    """
    if spec.strip() == "none":
        return AllOf()
    return AllOf(*(_parse_one(part.strip(), spec) for part in spec.split(",")))


def predictor_of(pruner: Pruner) -> LegPredictor | None:
    """Return the classifier of a pruner that has one and knows margins; None for none."""
    # Imported here, as in `_classifier_pruner`.
    from feasibility.pruners.classifier import ClassifierPruner

    parts = pruner.pruners if isinstance(pruner, AllOf) else (pruner,)
    for part in parts:
        if isinstance(part, ClassifierPruner) and part.classifier.knows_margins:
            return part.classifier
    return None


def _parse_one(part: str, spec: str) -> Pruner:
    name, colon, parameter = part.rpartition(":") if ":" in part else (part, "", "")
    is_model = name == _DEFAULT_MODEL or name.endswith(_MODEL_SUFFIX)
    make = _classifier_pruner(name) if is_model else _BY_NAME.get(name)
    if make is None:
        raise InputError(
            f"pruner {spec!r}: unknown pruner {name!r}; known are none, {', '.join(_BY_NAME)}, "
            f"default and the path of a trained model (*{_MODEL_SUFFIX})"
        )
    if not colon:
        return make()
    try:
        value = float(parameter)
    except ValueError:
        value = float("nan")
    if not 0 < value < float("inf"):
        raise InputError(f"pruner {spec!r}: {parameter!r} is not a positive number")
    return make(value)


def _classifier_pruner(path: str) -> Callable[..., Pruner]:
    # Imported here: a search without a model should not pay for the classifier's kernels.
    from feasibility.classifier.classifier import FeasibilityClassifier
    from feasibility.pruners.classifier import ClassifierPruner

    classifier = FeasibilityClassifier.load(path)

    def make(recall: float = 0.99) -> Pruner:
        return ClassifierPruner(classifier, recall)

    return make

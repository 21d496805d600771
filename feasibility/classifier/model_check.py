"""Whether a model's arrays fit together: a file may come from anywhere."""

from collections.abc import Callable, Mapping
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.views import FREE_ENDS, RENDEZVOUS, LegView
from feasibility.errors import InputError

_Arrays = Mapping[str, NDArray[Any]]

_NETS: Final = ("model", "quick", "middle", "final_mass")
"""Sections of a margin model that are nets; those for free ends have a prefix besides."""

_OPTIONAL_NETS: Final = ("middle", "final_mass")


@final
class _MisfitError(Exception):
    """What does not fit, without the name of the model."""


def check_model(artefact: Artefact) -> None:
    """Check kinds, shapes and ranges of a model's arrays, so that asking it cannot fail.

    Raises
    ------
    InputError
        An array is missing, or does not fit the others or the number of features.
    """
    try:
        _check_calibration(artefact.section("calibration"))
        if artefact.kind == "margin":
            _check_margin(artefact)
        else:
            _expect(artefact.kind in _CHECKS, "of a kind that is unknown")
            _check_paper(artefact)
    except KeyError as error:
        raise InputError(f"model of kind {artefact.kind!r}: array {error} is missing") from None
    except _MisfitError as error:
        raise InputError(f"model of kind {artefact.kind!r}: {error}") from None


def _expect(fits: object, what: str) -> None:
    if not fits:
        raise _MisfitError(what)


def _numbers(arrays: _Arrays, name: str, *shape: int | None) -> NDArray[Any]:
    """Return an array of numbers after checking its shape, None for any length."""
    array = arrays[name]
    same = array.ndim == len(shape) and all(
        wanted in (None, length) for wanted, length in zip(shape, array.shape, strict=True)
    )
    words = ", ".join("any" if length is None else str(length) for length in shape)
    _expect(
        same and array.dtype.kind in "biuf",
        f"array {name} is {array.dtype} of shape {array.shape}, expected numbers ({words})",
    )
    return array


def _one(arrays: _Arrays, name: str) -> float:
    return float(_numbers(arrays, name))


def _check_calibration(arrays: _Arrays) -> None:
    _check_scores(_numbers(arrays, "positive_scores", None), "calibration")


def _check_scores(scores: NDArray[Any], section: str) -> None:
    _expect(scores.size > 0, f"array {section}/positive_scores is empty")
    _expect(
        scores.min() >= 0.0 and scores.max() <= 1.0 and bool(np.all(np.diff(scores) >= 0.0)),
        f"array {section}/positive_scores, expected rising probabilities",
    )


def _check_margin(artefact: Artefact) -> None:
    _check_view(artefact, RENDEZVOUS)
    k = artefact.section("model")["weight_0"].shape[1]
    _expect(k == len(artefact.features), f"{len(artefact.features)} features for {k} inputs")
    if any(name.startswith(FREE_ENDS.prefix) for name in artefact.arrays):
        _check_view(artefact, FREE_ENDS)
        _check_kinds(artefact)


def _check_view(artefact: Artefact, view: LegView) -> None:
    """Check the nets for one sort of legs, and what belongs to them."""
    quick, domain, calibration, mass = (
        artefact.section(view.section(name))
        for name in ("quick", "domain", "calibration", "final_mass")
    )
    for name in _NETS:
        section = view.section(name)
        arrays = artefact.section(section)
        if arrays or name not in _OPTIONAL_NETS:
            _check_net(arrays, None)
            inputs = len(_numbers(arrays, "mean", arrays["weight_0"].shape[1]))
            std = _numbers(arrays, "std", inputs)
            _expect(bool(np.all(std > 0.0)), f"array {section}/std, expected more than zero")
            _one(arrays, "unit")
    if mass:
        k, known = len(mass["mean"]), " or ".join(str(size) for size in view.mass_sizes)
        _expect(
            k in view.mass_sizes, f"{view.section('final_mass')}: {k} inputs, expected {known}"
        )
        if "error_fit" in mass:
            _numbers(mass, "error_fit", 3)
    rows = (len(view.kinds),) if view.kinds else ()
    _numbers(quick, "settled", *rows, 2)
    middle = artefact.section(view.section("middle"))
    if middle:
        _numbers(middle, "settled", *rows, 2)
        k = len(middle["mean"])
        _expect(
            k == len(view.quick_names),
            f"{view.section('middle')}: {k} inputs, expected {len(view.quick_names)}",
        )
    low = _numbers(domain, "low", None)
    _numbers(domain, "high", len(low))
    levels = _numbers(calibration, "levels", *rows, None)
    quantiles = _numbers(calibration, "quantiles", *levels.shape)
    _expect(
        levels.shape[-1] > 1
        and bool(np.all(np.diff(levels) >= 0.0))
        and bool(np.all(np.diff(quantiles) >= 0.0)),
        f"arrays {view.section('calibration')}/levels and quantiles, expected rising numbers",
    )


def _check_kinds(artefact: Artefact) -> None:
    """Check what only nets for free ends have."""
    view = FREE_ENDS
    for name, features in (("model", view.names), ("quick", view.quick_names)):
        k = artefact.section(view.section(name))["weight_0"].shape[1]
        _expect(
            k == len(features),
            f"{view.section(name)}: {k} inputs, expected {len(features)}",
        )
    domain = artefact.section(view.section("domain"))
    _expect(domain["feature_set"].dtype.kind == "U", "array feature_set, expected a word")
    _expect(domain["feature_set"].ndim == 0, "array feature_set, expected one word")
    _numbers(domain, "low", len(view.domain_names))
    _numbers(domain, "kinds", len(view.kinds))
    scores = _numbers(
        artefact.section(view.section("calibration")), "positive_scores", len(view.kinds), None
    )
    _check_scores(scores, view.section("calibration"))


def _check_paper(artefact: Artefact) -> None:
    k = len(artefact.features)
    _expect(k > 0, "no features")
    scaler, domain = artefact.section("scaler"), artefact.section("domain")
    _numbers(scaler, "mean", k)
    std = _numbers(scaler, "std", k)
    _expect(bool(np.all(std > 0.0)), "array scaler/std, expected more than zero")
    _numbers(domain, "low", k)
    _numbers(domain, "high", k)
    _numbers(domain, "isp", 2)
    thrust = _numbers(domain, "thrust", 2)
    _expect(bool(np.all(thrust > 0.0)), "array domain/thrust, expected more than zero")
    _CHECKS[artefact.kind](artefact.section("model"), k)


def _check_net(arrays: _Arrays, k: int | None) -> None:
    """Check layers: each has as many inputs as the one before has outputs, the last two."""
    count = sum(name.startswith("weight_") for name in arrays)
    _expect(count > 0, "a net without layers")
    inputs = k
    for layer in range(count):
        weight = _numbers(arrays, f"weight_{layer}", None, inputs)
        inputs = len(_numbers(arrays, f"bias_{layer}", weight.shape[0]))
    _expect(inputs == 2, f"a net of {inputs} outputs, expected 2")


def _check_dnn(arrays: _Arrays, k: int) -> None:
    _check_net(arrays, k)
    known = ("relu", "leaky_relu", "elu")
    _expect(str(arrays["activation"]) in known, f"activation, expected {', '.join(known)}")


def _check_trees(arrays: _Arrays, k: int) -> None:
    """Check that every way down ends at a leaf: the kernel looks at no bounds."""
    left = _numbers(arrays, "left", None)
    n = len(left)
    right, feature = _numbers(arrays, "right", n), _numbers(arrays, "feature", n)
    _numbers(arrays, "threshold", n)
    _numbers(arrays, "value", n)
    root = _numbers(arrays, "root", None)
    _one(arrays, "base")
    for name in ("left", "right", "feature", "root"):
        _expect(arrays[name].dtype.kind in "iu", f"array {name}, expected whole numbers")
    inner = left >= 0
    children = np.concatenate([left[inner], right[inner]])
    inside = children.size == 0 or (children.min() >= 0 and children.max() < n)
    _expect(inside, f"children of nodes, expected 0 to {n - 1}")
    roots_inside = root.size > 0 and root.min() >= 0 and root.max() < n
    _expect(roots_inside, f"array root, expected 0 to {n - 1}")
    # A node with one parent at most, and roots without any, are no way in circles.
    parents = np.bincount(children, minlength=n)
    _expect(parents.max() <= 1 and not parents[root].any(), "nodes in circles, expected trees")
    asked = feature[inner]
    _expect(
        asked.size == 0 or (asked.min() >= 0 and asked.max() < k),
        f"array feature, expected 0 to {k - 1}",
    )


def _check_knn(arrays: _Arrays, k: int) -> None:
    rows = _numbers(arrays, "rows", None, k)
    _numbers(arrays, "label", len(rows))
    neighbours = _one(arrays, "neighbours")
    _expect(1 <= neighbours <= len(rows), f"neighbours {neighbours:g}, expected 1 to {len(rows)}")
    known = ("uniform", "distance")
    _expect(str(arrays["weighting"]) in known, f"weighting, expected {' or '.join(known)}")


def _check_svm(arrays: _Arrays, k: int) -> None:
    vectors = _numbers(arrays, "vectors", None, k)
    _numbers(arrays, "coefficients", len(vectors))
    _numbers(arrays, "sigmoid", 2)
    _one(arrays, "intercept")
    _one(arrays, "gamma")


_CHECKS: Final[dict[str, Callable[[_Arrays, int], None]]] = {
    "dnn": _check_dnn,
    "ensemble": _check_trees,
    "knn": _check_knn,
    "svm": _check_svm,
    "tree": _check_trees,
}

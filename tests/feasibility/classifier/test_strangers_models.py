"""Model files from elsewhere: too large, of wrong shapes, in circles; one line names the file."""

import dataclasses
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

import feasibility
from feasibility import FeasibilityClassifier, InputError
from feasibility.classifier import artefact as module
from feasibility.classifier.artefact import Artefact
from feasibility.classifier.model_check import check_model
from feasibility.classifier.paper.features import FEATURE_SET

DEFAULT = Path(feasibility.__file__).parent / "classifier" / "default.seqmodel"


@pytest.fixture(scope="module")
def default():
    return Artefact.load(DEFAULT)


def trees(**changes):
    model = {
        "feature": np.array([0, 1, 0, 0, 0]),
        "threshold": np.zeros(5),
        "left": np.array([1, 3, -1, -1, -1]),
        "right": np.array([2, 4, -1, -1, -1]),
        "value": np.zeros(5),
        "root": np.array([0]),
        "base": np.array(0.5),
    }
    return paper("tree", model | changes)


def paper(kind, model):
    arrays = {f"model/{name}": array for name, array in model.items()}
    arrays |= {f"scaler/{name}": np.ones(2) for name in ("mean", "std")}
    arrays |= {f"domain/{name}": np.ones(2) for name in ("low", "high", "isp", "thrust")}
    arrays["calibration/positive_scores"] = np.array([0.2, 0.9])
    return Artefact(kind, FEATURE_SET, ("m0", "tof"), ("kg", "s"), arrays, {}, {}, {})


KNN = {
    "rows": np.zeros((3, 2)),
    "label": np.zeros(3),
    "neighbours": np.array(2),
    "weighting": np.array("uniform"),
}
SVM = {
    "vectors": np.zeros((3, 2)),
    "coefficients": np.zeros(3),
    "intercept": np.array(0.0),
    "gamma": np.array(1.0),
    "sigmoid": np.zeros(2),
}
DNN = {
    "weight_0": np.zeros((4, 2)),
    "bias_0": np.zeros(4),
    "weight_1": np.zeros((2, 4)),
    "bias_1": np.zeros(2),
    "activation": np.array("relu"),
}


def test_good_models_pass(default):
    for artefact in (default, trees(), paper("knn", KNN), paper("svm", SVM), paper("dnn", DNN)):
        check_model(artefact)


MISFITS = {
    "a child outside": (trees(left=np.array([1, 9, -1, -1, -1])), "children of nodes"),
    "a circle": (trees(right=np.array([2, 0, -1, -1, -1])), "nodes in circles"),
    "two parents": (trees(right=np.array([1, 4, -1, -1, -1])), "nodes in circles"),
    "a negative child": (trees(right=np.array([-7, 4, -1, -1, -1])), "children of nodes"),
    "a root outside": (trees(root=np.array([5])), "array root"),
    "a feature outside": (trees(feature=np.array([0, 2, 0, 0, 0])), "array feature"),
    "broken nodes": (trees(left=np.array([1.0, 3, -1, -1, -1])), "left, expected whole numbers"),
    "too few values": (trees(value=np.zeros(4)), r"array value .*\(5\)"),
    "neighbours": (paper("knn", KNN | {"neighbours": np.array(4)}), "neighbours 4, expected 1"),
    "labels": (paper("knn", KNN | {"label": np.zeros(2)}), "array label"),
    "weighting": (paper("knn", KNN | {"weighting": np.array("x")}), "weighting"),
    "words": (paper("svm", SVM | {"vectors": np.array([["a", "b"]])}), "array vectors is <U1"),
    "layers": (paper("dnn", DNN | {"weight_1": np.zeros((2, 5))}), r"weight_1 .*\(any, 4\)"),
    "outputs": (
        paper("dnn", DNN | {"weight_1": np.zeros((3, 4)), "bias_1": np.zeros(3)}),
        "3 outputs",
    ),
    "activation": (paper("dnn", DNN | {"activation": np.array("tanh")}), "activation"),
    "kind": (paper("oracle", {}), "of a kind that is unknown"),
    "missing": (paper("svm", {}), "array 'vectors' is missing"),
}


@pytest.mark.parametrize("name", MISFITS)
def test_arrays_that_do_not_fit_together_are_refused(tmp_path, name):
    artefact, message = MISFITS[name]
    path = tmp_path / "strange.seqmodel"
    artefact.save(path)
    with pytest.raises(InputError, match=message) as caught:
        FeasibilityClassifier.load(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("model/weight_1", np.zeros((256, 255), np.float32), "array weight_1"),
        ("quick/std", np.zeros(40), "array quick/std, expected more than zero"),
        ("quick/settled", np.zeros(3), "array settled"),
        ("free_middle/settled", np.zeros(2), "array settled"),
        ("free_middle/mean", np.zeros(3), "array mean"),
        ("domain/high", np.zeros(7), "array high"),
        ("calibration/positive_scores", np.array([]), "positive_scores is empty"),
        ("calibration/positive_scores", np.array([0.5, 0.2]), "rising probabilities"),
        ("calibration/positive_scores", np.array([0.5, 2.0]), "rising probabilities"),
        ("calibration/levels", np.zeros(3), "array quantiles"),
    ],
)
def test_a_margin_model_that_does_not_fit_is_refused(default, tmp_path, name, array, message):
    path = tmp_path / "strange.seqmodel"
    dataclasses.replace(default, arrays={**default.arrays, name: array}).save(path)
    with pytest.raises(InputError, match=message):
        FeasibilityClassifier.load(path)


def zipped(path, members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def signed(manifest):
    text = json.dumps(manifest).encode()
    return {"manifest.json": text, "manifest.sha256": module._sha256(text)}


def test_what_unpacks_to_too_much_is_refused_before_it_is_unpacked(tmp_path):
    path = tmp_path / "bomb.seqmodel"
    zipped(path, {"manifest.json": "{}", "model/big.npy": bytes(300 << 20)})
    assert path.stat().st_size < 1 << 20
    with pytest.raises(InputError, match=r"bomb.seqmodel: 2 members of 300 MiB, expected"):
        Artefact.load(path)
    zipped(path, {f"{k}": "" for k in range(1100)})
    with pytest.raises(InputError, match="1100 members"):
        Artefact.load(path)


def npy(header, content=b""):
    text = header.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + content


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (npy("{'descr': '<f8', 'fortran_order': False, 'shape': (10**12,), }"), "not an array"),
        (npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"), "does not"),
        (npy("{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }"), "does not fit"),
        (npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", bytes(8)), "of type obj"),
        (b"nothing", "not an array"),
    ],
)
def test_headers_of_arrays_that_lie_are_refused(tmp_path, content, message):
    manifest = {
        **{"format": module.FORMAT, "format_version": 1, "kind": "dnn", "feature_set": "x"},
        **{"features": [], "units": [], "config": {}, "metrics": {}, "provenance": {}},
        "arrays": {"model/w": module._sha256(content)},
    }
    path = tmp_path / "lie.seqmodel"
    zipped(path, {**signed(manifest), "model/w.npy": content})
    with pytest.raises(InputError, match=f"lie.seqmodel: model/w: .*{message}|{message}"):
        Artefact.load(path)


def test_numbers_that_are_not_finite_are_refused(default, tmp_path):
    array = np.array(default.arrays["model/mean"])
    array[3] = np.nan
    path = tmp_path / "nan.seqmodel"
    dataclasses.replace(default, arrays={**default.arrays, "model/mean": array}).save(path)
    with pytest.raises(InputError, match=r"model/mean: not an array .*not finite"):
        Artefact.load(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"features": 3}, "no features"),
        ({"features": [1]}, "expected words"),
        ({"units": ["m"]}, "0 features and 1 units"),
        ({"arrays": ["x"]}, "no arrays"),
        ({"format_version": "1"}, "format version '1'"),
        ({"format_version": -1}, "format version -1"),
        ({"format": "other"}, "of another format"),
    ],
)
def test_a_manifest_of_wrong_types_is_refused(tmp_path, change, message):
    manifest = {
        **{"format": module.FORMAT, "format_version": 1, "kind": "dnn", "feature_set": "x"},
        **{"features": [], "units": [], "config": {}, "metrics": {}, "provenance": {}},
        "arrays": {},
    }
    path = tmp_path / "strange.seqmodel"
    zipped(path, signed(manifest | change))
    with pytest.raises(InputError, match=message):
        Artefact.load(path)
    # Without the change it is read.
    zipped(path, signed(manifest))
    assert Artefact.load(path).features == ()


def test_a_manifest_that_is_nested_deeply_is_refused(tmp_path):
    path = tmp_path / "deep.seqmodel"
    zipped(path, {"manifest.json": 100_000 * "[", "manifest.sha256": ""})
    with pytest.raises(InputError, match=r"deep\.seqmodel"):
        Artefact.load(path)

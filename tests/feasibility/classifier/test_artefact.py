"""Model files: what is written is read, and damage of any kind is met with one line."""

import io
import json
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from feasibility import InputError
from feasibility.classifier import artefact as module
from feasibility.classifier.artefact import Artefact

ARRAYS = {
    "model/weight_0": np.random.default_rng(0).normal(size=(4, 3)).astype(np.float32),
    "model/activation": np.array("relu"),
    "model/empty": np.zeros((0, 3)),
    "scaler/mean": np.arange(3.0),
}
MODEL = Artefact(
    kind="dnn",
    feature_set="some-features",
    features=("a", "b", "c"),
    units=("m", "", "rad"),
    arrays=ARRAYS,
    config={"layers": 1},
    metrics={"auc": 0.5},
    provenance={"seed": 0},
)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "small.seqmodel"
    MODEL.save(path)
    return path


def test_what_is_written_is_read(path):
    read = Artefact.load(path)
    for name in ("kind", "feature_set", "features", "units", "config", "metrics", "provenance"):
        assert getattr(read, name) == getattr(MODEL, name)
    assert read.arrays.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert read.arrays[name].dtype == array.dtype
        assert np.array_equal(read.arrays[name], array)
    assert list(read.section("scaler")) == ["mean"]


def test_the_same_model_gives_the_same_file(path, tmp_path):
    Artefact.load(path).save(tmp_path / "again.seqmodel")
    assert (tmp_path / "again.seqmodel").read_bytes() == path.read_bytes()


@settings(max_examples=60)
@given(share=st.floats(0, 0.999))
def test_a_truncated_file_is_refused(path, tmp_path_factory, share):
    content = path.read_bytes()
    short = tmp_path_factory.mktemp("short") / "short.seqmodel"
    short.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=r"short\.seqmodel"):
        Artefact.load(short)


@settings(max_examples=150)
@given(data=st.data())
def test_a_flipped_bit_is_refused_or_changes_nothing(path, tmp_path_factory, data):
    content = bytearray(path.read_bytes())
    position = data.draw(st.integers(0, len(content) - 1))
    content[position] ^= 1 << data.draw(st.integers(0, 7))
    changed = tmp_path_factory.mktemp("changed") / "changed.seqmodel"
    changed.write_bytes(content)
    try:
        read = Artefact.load(changed)
    except InputError:
        return
    # Time stamps and the like carry nothing.
    assert all(np.array_equal(read.arrays[name], array) for name, array in ARRAYS.items())
    assert read.features == MODEL.features
    assert read.config == MODEL.config


def rewritten(path, folder, change):
    """Return a copy of the archive whose members `change` has had its hands on."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    copy = folder / "copy.seqmodel"
    with zipfile.ZipFile(copy, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return copy


def edit_manifest(members, **changes):
    manifest = json.loads(members["manifest.json"]) | changes
    members["manifest.json"] = json.dumps(manifest).encode()


def replace_array(members):
    stream = io.BytesIO()
    np.save(stream, np.zeros((4, 3), dtype=np.float32))
    members["model/weight_0.npy"] = stream.getvalue()


def put_a_pickle(members):
    stream = io.BytesIO()
    np.save(stream, np.array([{}], dtype=object), allow_pickle=True)
    content = stream.getvalue()
    members["model/weight_0.npy"] = content
    manifest = json.loads(members["manifest.json"])
    manifest["arrays"]["model/weight_0"] = module._sha256(content)
    members["manifest.json"] = json.dumps(manifest).encode()
    members["manifest.sha256"] = module._sha256(members["manifest.json"]).encode()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: edit_manifest(m, metrics={"auc": 0.99}), "checksum"),
        (lambda m: edit_manifest(m, format_version=2), "format version 2.*up to 1"),
        (lambda m: edit_manifest(m, format="other"), "other"),
        (lambda m: m.update({"manifest.json": b"{"}), "JSON"),
        (lambda m: m.update({"manifest.json": b"[]"}), "damaged"),
        (replace_array, "model/weight_0 does not match"),
        (put_a_pickle, "not an array"),
        (lambda m: m.pop("model/weight_0.npy"), "damaged"),
        (lambda m: m.pop("manifest.json"), "damaged"),
    ],
)
def test_a_tampered_or_newer_file_is_refused(path, tmp_path, change, message):
    copy = rewritten(path, tmp_path, change)
    with pytest.raises(InputError, match=message) as caught:
        Artefact.load(copy)
    assert str(copy) in str(caught.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        Artefact.load(tmp_path / "none.seqmodel")
    with pytest.raises(InputError, match="cannot be read"):
        Artefact.load(tmp_path)

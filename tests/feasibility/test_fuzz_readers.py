"""Damaged files of every kind: each is read or refused in one line, soon, and never read wrong.

All mutations are seeded; a failure names the number of its mutation.
"""

import dataclasses
import io
import json
import signal
import warnings
import zipfile
from contextlib import contextmanager

import numpy as np
import pytest

from feasibility import FeasibilityClassifier, InputError
from feasibility.classifier import artefact as artefacts
from feasibility.classifier.artefact import Artefact
from feasibility.classifier.paper.features import FEATURE_SET, FEATURES
from feasibility.dataset import builtin_protocols, read_dataset, read_protocol
from feasibility.dataset.storage import METADATA, shard_path, write_metadata, write_shard
from feasibility.orbits import read_catalogue
from feasibility.spacecraft.spacecraft_file import EXAMPLE, read_spacecraft
from tests.helpers.labelled import labelled_dataset

MUTATIONS = 1000
SECONDS = 20
NUMBERS = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "0", "-1", "1e999", "9" * 30),
    *("9" * 400, "0x10", "1_000", "true", '""', "[]", "{}", "null", "1979-05-27", "2461000.5"),
)


@contextmanager
def alarm(what):
    """Fail where something takes too long."""

    def ring(signum, frame):
        raise TimeoutError(what)

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def read_or_refused(read, path, what):
    """Return what was read, None where it was refused as it should be."""
    try:
        with alarm(what), warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            return read(path)
    except InputError as error:
        message = str(error)
    except BaseException as error:
        raise AssertionError(f"{what}: {type(error).__name__}: {error}") from error
    assert "\n" not in message, (what, message)
    assert len(message) < 2000, (what, message)
    return None


def damaged(data, rng):
    """Return bytes with some flipped, cut, repeated, emptied or made random."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        if not data:
            break
        begin = int(rng.integers(len(data)))
        end = min(len(data), begin + int(rng.integers(1, 40)))
        kind = rng.integers(6)
        if kind == 0:
            data[begin] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            del data[begin:]
        elif kind == 2:
            del data[begin:end]
        elif kind == 3:
            data[begin:begin] = data[begin:end]
        elif kind == 4:
            data[begin:end] = bytes(end - begin)
        else:
            data[begin:end] = rng.bytes(end - begin)
    return bytes(data)


def rewritten(text, rng):
    """Return a text with lines swapped, repeated or left out and words made absurd."""
    lines = text.split("\n")
    for _ in range(rng.integers(1, 4)):
        one, two = (int(k) for k in rng.integers(len(lines), size=2))
        kind = rng.integers(5)
        if kind == 0:
            lines[one], lines[two] = lines[two], lines[one]
        elif kind == 1 and len(lines) > 2:
            del lines[one]
        elif kind == 2:
            lines.insert(one, lines[two])
        else:
            words = lines[one].split(" ")
            words[int(rng.integers(len(words)))] = str(rng.choice(NUMBERS))
            lines[one] = " ".join(words)
    return "\n".join(lines)


def mutated_text(text, rng):
    return damaged(text.encode(), rng) if rng.integers(2) else rewritten(text, rng).encode()


def mutated_json(plain, rng):
    """Return JSON with one entry, at any depth, left out or replaced."""
    plain = json.loads(json.dumps(plain))
    place = plain
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        if not keys:
            return plain
        key = keys[int(rng.integers(len(keys)))]
        inner = place[key]
        if isinstance(inner, dict | list) and inner and rng.integers(3):
            place = inner
            continue
        if rng.integers(2):
            del place[key]
        else:
            absurd = [None, -1, 0, 10**30, 1e308, "x", [], {}, [1, "a"], True, {"a": {}}, 2.5]
            place[key] = absurd[int(rng.integers(len(absurd)))]
        return plain


ROWS = [f"{k} 54800 2.{k} 0.{k} {k}.5 {30 * k} {20 * k} {10 * k}" for k in range(1, 10)]
TABLES = (
    "ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)\n" + "\n".join(ROWS) + "\n",
    "id,epoch,a,e,i,om,w,ma\n" + "\n".join(row.replace(" ", ",") for row in ROWS),
    "# id epoch_jd a_km e i_rad node_rad argp_rad M_rad mass_kg\n"
    "1 2454800.5 373994676.75 0.1 0.1 1.7 3.4 5.2 1e13\n",
    "Num\tEpoch\ta\te\ti\tw\tNode\tM\tName\n---\t---\n1\t54800\t2.5\t.1\t7\t2\t1\t3\tTwo Words\n",
    "# Name Epoch (MJD) a (AU) e i (deg) LAN (deg) arg. periap. (deg) mean anomaly (deg)\n"
    "'1580'  54800.0  2.5e+00  1.0e-01  7.0e+00  1.0e+02  2.0e+02  3.0e+02\n",
    "00003    3.4   0.15 K205V 300.00000  200.00000  100.00000    7.00000  0.1000000  0.21406009"
    "   2.5000000  0 MPO492748  6751 115 1801-2019 0.60 M-v 30h Williams   0000      (3) Juno\n",
    "Target body name: 3 Juno  {source: x}\n   JDTDB, Date, EC, QR, IN, OM, W, Tp, N, MA, TA, A,\n"
    "$$SOE\n2454800.5, A.D. 2008, 0.1, 2.25, 7, 100, 200, 2.4E6, .2, 300, 9, 2.5,\n$$EOE\n",
)


@pytest.mark.slow
def test_tables(tmp_path):
    path = tmp_path / "table.txt"
    read = 0
    for k in range(MUTATIONS):
        rng = np.random.default_rng([1, k])
        path.write_bytes(mutated_text(TABLES[k % len(TABLES)], rng))
        catalogue = read_or_refused(read_catalogue, path, f"table, mutation {k}")
        if catalogue is not None:
            read += 1
            assert np.isfinite(catalogue.states(0.0)).all(), k
    assert 0.05 * MUTATIONS < read < 0.95 * MUTATIONS


@pytest.mark.slow
def test_toml(tmp_path):
    path = tmp_path / "file.toml"
    texts = [(EXAMPLE, read_spacecraft)]
    texts += [
        (text, lambda path: read_protocol(str(path))) for text in builtin_protocols().values()
    ]
    read = 0
    for k in range(MUTATIONS):
        rng = np.random.default_rng([2, k])
        text, reader = texts[k % len(texts)]
        path.write_bytes(mutated_text(text, rng))
        read += read_or_refused(reader, path, f"TOML, mutation {k}") is not None
    assert 0.05 * MUTATIONS < read < 0.95 * MUTATIONS


def small_models():
    rng = np.random.default_rng(0)
    names = tuple(feature.name for feature in FEATURES[:3])
    shared = {f"scaler/{name}": np.ones(3) for name in ("mean", "std")}
    shared |= {"domain/low": np.full(3, -1e9), "domain/high": np.full(3, 1e9)}
    shared |= {"domain/isp": np.array([2e3, 4e3]), "domain/thrust": np.array([0.3, 0.3])}
    shared["calibration/positive_scores"] = np.array([0.2, 0.9])
    models = {
        "dnn": {
            "weight_0": rng.normal(size=(4, 3)),
            "bias_0": np.zeros(4),
            "weight_1": rng.normal(size=(2, 4)),
            "bias_1": np.zeros(2),
            "activation": np.array("relu"),
        },
        "tree": {
            "feature": np.array([0, 1, 0, 0, 0]),
            "threshold": np.ones(5),
            "left": np.array([1, 3, -1, -1, -1]),
            "right": np.array([2, 4, -1, -1, -1]),
            "value": np.full(5, 0.5),
            "root": np.array([0]),
            "base": np.array(0.25),
        },
        "knn": {
            "rows": rng.normal(size=(9, 3)),
            "label": np.ones(9),
            "neighbours": np.array(3),
            "weighting": np.array("distance"),
        },
        "svm": {
            "vectors": rng.normal(size=(5, 3)),
            "coefficients": np.ones(5),
            "intercept": np.array(0.1),
            "gamma": np.array(0.2),
            "sigmoid": np.array([1.0, 0.0]),
        },
    }
    for kind, model in models.items():
        arrays = {f"model/{name}": array for name, array in model.items()} | shared
        yield Artefact(kind, FEATURE_SET, names, ("", "", ""), arrays, {}, {}, {})


def mutated_array(array, rng):
    if array.dtype.kind == "U":
        return np.array("x")
    kind = rng.integers(4)
    if kind == 0:
        return np.concatenate([array.reshape(-1)] * 2)[: int(rng.integers(2 * array.size + 1))]
    if kind == 1:
        return array[None]
    changed = np.array(array).reshape(-1)
    value = rng.choice([-1, 0, 1, 7, 10**9, -(10**9)])
    if array.dtype.kind == "f" and kind == 3:
        value = rng.choice([np.nan, np.inf, 1e300, -1e300, 5e-324])
    changed[int(rng.integers(changed.size))] = value
    return changed.reshape(array.shape)


def signed_again(content, rng):
    """Return a model's file whose manifest was changed, with a checksum that is right."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    text = json.dumps(mutated_json(json.loads(members["manifest.json"]), rng)).encode()
    members |= {"manifest.json": text, "manifest.sha256": artefacts._sha256(text).encode()}
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, member in members.items():
            archive.writestr(name, member)
    return stream.getvalue()


@pytest.mark.slow
def test_models(tmp_path):
    path = tmp_path / "model.seqmodel"
    legs = labelled_dataset().legs.take(np.arange(20))
    models = list(small_models())
    read = 0
    for k in range(MUTATIONS):
        rng = np.random.default_rng([3, k])
        model = models[k % len(models)]
        way = k // len(models) % 3
        if way == 0:
            names = list(model.arrays)
            name = names[int(rng.integers(len(names)))]
            arrays = {**model.arrays, name: mutated_array(model.arrays[name], rng)}
            dataclasses.replace(model, arrays=arrays).save(path)
        else:
            model.save(path)
            content = path.read_bytes()
            path.write_bytes(damaged(content, rng) if way == 1 else signed_again(content, rng))

        def ask(path):
            with np.errstate(all="ignore"):
                return FeasibilityClassifier.load(path).feasible_probability(legs)

        probability = read_or_refused(ask, path, f"model, mutation {k}")
        if probability is not None:
            read += 1
            assert probability.shape == (20,), k
    assert 0.02 * MUTATIONS < read < 0.95 * MUTATIONS


@pytest.mark.slow
def test_datasets(tmp_path):
    pytest.importorskip("pyarrow")
    original = labelled_dataset(60)
    metadata = {
        **original.metadata,
        "protocol": original.metadata["protocol"] | {"legs_per_shard": 30},
        "checksums": "sha256",
    }
    for shard in range(2):
        rows = slice(30 * shard, 30 * shard + 30)
        part = {name: column[rows] for name, column in original.columns.items()}
        write_shard(shard_path(tmp_path, shard), part)
    write_metadata(tmp_path, metadata)
    files = [shard_path(tmp_path, 0), shard_path(tmp_path, 1), tmp_path / METADATA]
    intact = {path: path.read_bytes() for path in files}
    known = read_dataset(tmp_path).metadata
    read = 0
    for k in range(MUTATIONS):
        rng = np.random.default_rng([4, k])
        path = files[k % 3]
        record = json.loads(intact[files[2]])
        old = path == files[2] and k % 2 == 0
        if old:
            # As older versions wrote it, without a checksum: numbers may be others, never types.
            del record["sha256"]
            path.write_text(json.dumps(mutated_json(record, rng)))
        elif path == files[2]:
            path.write_bytes(mutated_text(intact[path].decode(), rng))
        else:
            path.write_bytes(damaged(intact[path], rng))

        def use(folder):
            dataset = read_dataset(folder)
            return dataset, dataset.flyable, dataset.labelled, len(dataset.legs), repr(dataset)

        found = read_or_refused(use, tmp_path, f"dataset, mutation {k}")
        path.write_bytes(intact[path])
        if found is not None:
            read += 1
            for name, column in original.columns.items():
                np.testing.assert_array_equal(found[0].columns[name], column, err_msg=f"{k}")
            if not old:
                assert found[0].metadata == known, k
    assert read > 0

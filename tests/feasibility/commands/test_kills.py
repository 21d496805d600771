"""Datasets and models whose making is killed at any moment come out as undisturbed ones do."""

import numpy as np
import pytest

from feasibility import FeasibilityClassifier
from feasibility.dataset import read_dataset
from tests.helpers.killing import command, finished, killed_often

pytest.importorskip("torch")
pytest.importorskip("pyarrow")

CRAFT = """
name = "probe"
[spacecraft]
wet_mass_kg = 2000.0
dry_mass_kg = 800.0
thrust_n = 0.3
isp_s = 3000.0
"""


def _disturbed(line, whole, rng, kills, check):
    """Kill what makes a file or folder again and again, and check that it is like `whole`."""
    # Kernels compiled in this process may differ in the last bits from those of the cache.
    finished(line(whole.with_name(f"first-{whole.name}")))
    whole_s = finished(line(whole))
    count, k = 0, 0
    while count < kills and k < 4 * kills:
        out = whole.with_name(f"{k}-{whole.name}")
        count += killed_often(lambda out=out: line(out), whole_s, 3, rng)
        check(out)
        k += 1
    return count


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """A dataset whose making was killed now and then, and how often."""
    path = tmp_path_factory.mktemp("data") / "search"
    rng = np.random.default_rng(2)

    def line(out):
        return command("feasibility", "generate", "search", "--legs", 3000, "--out", out)

    def check(out):
        assert _same_rows(out, path)

    return path, _disturbed(line, path, rng, 6, check)


def _same_rows(one, other):
    one, other = read_dataset(one).columns, read_dataset(other).columns
    assert one.keys() == other.keys()
    return all(
        np.array_equal(one[name], other[name], equal_nan=one[name].dtype.kind == "f")
        for name in one
        if name != "seconds"
    )


@pytest.mark.slow
def test_killed_datasets_are_the_same(dataset):
    assert dataset[1] >= 6


@pytest.mark.slow
def test_killed_trainings_end_with_the_same_model(dataset, tmp_path):
    rng = np.random.default_rng(3)
    legs = read_dataset(dataset[0]).legs
    whole = tmp_path / "m.seqmodel"

    def line(out):
        return command(
            "feasibility", "train", dataset[0], "--model", "margin", "--epochs", 6, "--out", out
        )

    def check(out):
        margins = [FeasibilityClassifier.load(path).margin(legs) for path in (out, whole)]
        np.testing.assert_array_equal(*margins)

    assert _disturbed(line, whole, rng, 6, check) >= 6


@pytest.mark.slow
def test_killed_retrainings_end_with_the_same_model(dataset, tmp_path):
    rng = np.random.default_rng(4)
    legs = read_dataset(dataset[0]).legs
    whole = tmp_path / "m.seqmodel"
    (tmp_path / "probe.toml").write_text(CRAFT)
    counts = ["--legs", 400, "--test-legs", 200, "--general-legs", 200, "--general-test-legs", 100]

    def line(out):
        fixed = [tmp_path / "probe.toml", "--out", out, *counts, "--epochs", 3]
        return command("feasibility", "retrain", *fixed)

    def check(out):
        margins = [FeasibilityClassifier.load(path).margin(legs) for path in (out, whole)]
        np.testing.assert_array_equal(*margins)

    assert _disturbed(line, whole, rng, 6, check) >= 6

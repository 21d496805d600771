"""Hard examples: the legs of a protocol that a model is most unsure of, as a dataset like any."""

import msgspec
import numpy as np

from feasibility import FeasibilityClassifier
from feasibility.dataset import read_dataset, read_protocol
from feasibility.dataset.generate import begin
from feasibility.dataset.protocol import CatalogueTable
from feasibility.learning.margin.hard_examples import harder


def few(protocol):
    table = CatalogueTable(synthetic_bodies=1000)
    return msgspec.structs.replace(protocol, catalogue=table, legs_per_shard=40)


def test_a_dataset_of_hard_examples_is_harder_and_can_be_completed(tmp_path):
    easy = few(read_protocol("search"))
    hard = harder(easy, "default", factor=4)
    datasets = {}
    for name, protocol in (("easy", easy), ("hard", hard)):
        begin(protocol, 80, tmp_path / name, seed=3).run()
        datasets[name] = read_dataset(tmp_path / name)
    classifier = FeasibilityClassifier.load("default")
    doubt, relevant = {}, {}
    for name, made in datasets.items():
        heaviest = classifier.max_initial_mass(made.legs)
        near = (heaviest > 0.55 * 800.0) & (heaviest < 1.82 * 2000.0)
        relevant[name] = near.mean()
        doubt[name] = np.median(classifier.margin_error(made.legs)[near])
    assert relevant["hard"] > 1.5 * relevant["easy"]
    assert doubt["hard"] > 1.2 * doubt["easy"]
    assert datasets["hard"].labelled.mean() > 0.8
    assert datasets["hard"].metadata["protocol"]["sampler"]["kind"] == "hard-examples"
    # The same settings find nothing missing; a lost shard comes back the same.
    assert begin(hard, 80, tmp_path / "hard", seed=3).legs_missing == 0
    lost = next((tmp_path / "hard").glob("*00001.parquet"))
    lost.unlink()
    begin(hard, 80, tmp_path / "hard", seed=3).run()
    again = read_dataset(tmp_path / "hard").columns
    for name in ("tof_days", "m0_kg", "m_star_kg", "dep_id"):
        np.testing.assert_array_equal(again[name], datasets["hard"].columns[name])

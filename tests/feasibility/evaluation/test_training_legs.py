"""A model that is judged on the legs that it was trained on is found out."""

import dataclasses

import pytest

from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.commands.cli import main
from feasibility.evaluation.training_legs import trained_on
from tests.helpers.labelled import labelled_dataset, write_dataset


@pytest.fixture(scope="module")
def default():
    return FeasibilityClassifier.load("default").artefact


def learned_from(default, *metadata, key="datasets"):
    value = list(metadata) if key == "datasets" else metadata[0]
    return dataclasses.replace(default, provenance={key: value})


@pytest.mark.parametrize("key", ["datasets", "dataset"])
def test_the_same_protocol_catalogue_and_seed_give_the_same_legs(default, key):
    metadata = labelled_dataset().metadata
    model = learned_from(default, metadata, key=key)
    assert trained_on(model, metadata)
    assert trained_on(model, {**metadata, "legs": 7})
    protocol = {**metadata["protocol"], "name": "x", "propellant": False}
    assert trained_on(model, {**metadata, "protocol": protocol})
    assert not trained_on(model, {**metadata, "seed": 1})
    assert not trained_on(model, {**metadata, "protocol": {**protocol, "boundary_share": 0.1}})
    catalogue = {**metadata["catalogue"], "bodies": 41}
    assert not trained_on(model, {**metadata, "catalogue": catalogue})


def test_models_without_that_knowledge_are_not_suspected(default):
    metadata = labelled_dataset().metadata
    assert not trained_on(dataclasses.replace(default, provenance={}), metadata)
    odd = dataclasses.replace(default, provenance={"datasets": [3, {}, {"protocol": 1}]})
    assert not trained_on(odd, metadata)


def test_the_command_warns_in_one_line(default, tmp_path, capsys):
    pytest.importorskip("pyarrow")
    dataset = labelled_dataset(300)
    folder = write_dataset(dataset, tmp_path / "data")
    model = tmp_path / "mine.seqmodel"
    for metadata, count in ((dataset.metadata, 1), ({**dataset.metadata, "seed": 5}, 0)):
        learned_from(default, dict(metadata)).save(model)
        assert main(["evaluate", str(model), str(folder), "--alone"]) == 0
        error = capsys.readouterr().err
        assert error.count("feasibility: warning: ") == error.count("\n") == count


def test_the_version_is_told(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out.startswith("feasibility 0.")

"""The net for the mass at arrival: trained on top of a margin model, which it leaves alone."""

import dataclasses

import numpy as np
import pytest

from feasibility import FeasibilityClassifier, InputError, Legs
from feasibility.classifier.margin.features import margin_features
from feasibility.classifier.margin.final_mass import (
    FINAL_MASS_INPUTS,
    final_mass_inputs,
    full_thrust_velocity,
)
from feasibility.commands.cli import main
from feasibility.dataset import Dataset
from feasibility.sims_flanagan import optimise
from feasibility.sims_flanagan.fast.compilation import sample_leg
from tests.helpers.labelled import labelled_dataset

SHARE = 0.8
"""Of the velocity change at m*: what the made-up final masses below cost."""


@pytest.fixture(scope="module")
def default():
    return FeasibilityClassifier.load("default")


@pytest.fixture(scope="module")
def flown(default):
    """Legs whose final mass is known by a rule that the bounds do not have."""
    dataset = labelled_dataset()
    legs = dataset.legs
    margin = default.margin(legs)
    change = SHARE * full_thrust_velocity(legs, np.maximum(np.log(margin), 0.0))
    m_final = np.where(margin > 1.0, legs.m0 * np.exp(-change / legs.exhaust_velocity), np.nan)
    return Dataset({**dataset.columns, "m_final_kg": m_final}, dataset.metadata)


def trained(artefact, dataset, epochs=4):
    pytest.importorskip("torch")
    from feasibility.learning.margin.train_final_mass import FINAL_MASS_RECIPE, train_final_mass

    recipe = dataclasses.replace(
        FINAL_MASS_RECIPE, epochs=epochs, batch=50, device="cpu", threads=1
    )
    return train_final_mass(artefact, [dataset], recipe)


def test_the_net_learns_final_masses_and_leaves_the_margins_alone(default, flown):
    model = trained(default.artefact, flown)
    rows = np.flatnonzero(np.isfinite(flown.columns["m_final_kg"]))
    legs, truth = flown.legs.take(rows), flown.columns["m_final_kg"][rows]
    assert len(rows) > 300
    told = FeasibilityClassifier(model).predict(legs)
    assert np.median(np.abs(told.final_mass / truth - 1.0)) < 0.01
    before = default.predict(legs)
    np.testing.assert_array_equal(told.margin, before.margin)
    np.testing.assert_array_equal(told.probability, before.probability)
    assert model.metrics["final_mass"]["median_relative_error"] < 0.01
    others = {k for k in default.artefact.arrays if not k.startswith("final_mass/")}
    assert others == {k for k in model.arrays if not k.startswith("final_mass/")}


def test_a_model_without_that_net_answers_by_the_bounds(default, flown):
    arrays = {k: v for k, v in default.artefact.arrays.items() if not k.startswith("final_mass/")}
    bounds = FeasibilityClassifier(dataclasses.replace(default.artefact, arrays=arrays))
    legs = flown.legs
    told = bounds.predict(legs)
    flyable = told.margin >= 1.0
    least = legs.m0 * np.exp(
        -full_thrust_velocity(legs, np.log(np.maximum(told.margin, 1.0))) / legs.exhaust_velocity
    )
    assert flyable.mean() > 0.2
    assert (told.final_mass[flyable] >= least[flyable] * (1 - 1e-12)).all()
    assert (told.final_mass[flyable] < legs.m0[flyable]).all()


def test_the_inputs_have_names_and_do_not_depend_on_the_scale_of_masses(flown):
    legs = flown.legs.take(np.arange(50))
    X, _ = margin_features(legs)
    log_margin = np.linspace(-0.5, 4.0, 50)
    inputs = final_mass_inputs(legs, X, log_margin)
    assert inputs.shape == (50, len(FINAL_MASS_INPUTS))
    assert np.isfinite(inputs).all()
    doubled = Legs(
        legs.rv_dep, legs.rv_arr, legs.tof_days, 2 * legs.m0, 2 * legs.thrust, legs.isp, 0.0
    )
    np.testing.assert_allclose(final_mass_inputs(doubled, X, log_margin), inputs, rtol=1e-12)


def test_the_default_model_knows_what_a_leg_costs(default):
    leg = sample_leg()
    solved = optimise(leg)
    assert default.final_mass(leg) == pytest.approx(solved.m_final, rel=0.01)


def test_a_model_that_starts_from_another_keeps_its_final_masses(default, flown):
    pytest.importorskip("torch")
    from feasibility.learning.margin.train import MarginRecipe, train_margin

    recipe = MarginRecipe(epochs=0, batch=100, device="cpu", threads=1)
    model = train_margin([flown], recipe, start=default.artefact)
    legs = flown.legs.take(np.arange(50))
    np.testing.assert_array_equal(
        FeasibilityClassifier(model).final_mass(legs), default.final_mass(legs)
    )


def test_hardly_a_leg_with_propellant_is_an_error(default):
    with pytest.raises(InputError, match="minimum propellant"):
        trained(default.artefact, labelled_dataset())


def test_the_command_adds_the_net_to_a_model(flown, tmp_path, monkeypatch, capsys):
    pytest.importorskip("torch")
    monkeypatch.setattr("feasibility.dataset.read_dataset", lambda _: flown)
    out = tmp_path / "whole.seqmodel"
    arguments = ["train", "a", "--model", "final-mass", "--out", str(out), "--epochs", "2"]
    settings = ["--set=batch=100", "--set=threads=1", "--device", "cpu"]
    assert main([*arguments, *settings, "--start", "default"]) == 0
    assert "relative error" in capsys.readouterr().out
    assert FeasibilityClassifier.load(out).artefact.metrics["final_mass"]["legs"] > 300
    assert not list(tmp_path.glob("*.checkpoint"))
    assert main(arguments) == 2
    assert "--start" in capsys.readouterr().err
    assert main([*arguments, "--start", "default", "--balance", "adasyn"]) == 2

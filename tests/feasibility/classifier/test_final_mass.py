"""The net for the mass at arrival: trained on top of a margin model, which it leaves alone."""

import dataclasses

import numpy as np
import pytest

from feasibility import FeasibilityClassifier, InputError, Legs
from feasibility.classifier.margin.features import margin_features
from feasibility.classifier.margin.final_mass import (
    BOUND_INPUTS,
    FINAL_MASS_INPUTS,
    final_mass_inputs,
    full_thrust_velocity,
)
from feasibility.commands.cli import main
from feasibility.constants import AU
from feasibility.dataset import Dataset
from feasibility.orbits import classical_to_cartesian
from feasibility.sims_flanagan import optimise, solve_max_initial_mass
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


def solved_legs(n, seed):
    """Return Earth-like to Mars-like legs of 300 to 800 days, lighter than m*, and the truth."""
    rng = np.random.default_rng(seed)
    orbits = np.zeros((2, n, 6))
    orbits[..., 0] = AU * np.array([1.0, 1.52])[:, None]
    orbits[..., 1] = np.array([0.017, 0.093])[:, None]
    orbits[1, :, 2] = np.radians(1.85)
    orbits[..., 3:] = rng.uniform(0.0, 2 * np.pi, (2, n, 3))
    ends = (classical_to_cartesian(half) for half in orbits)
    legs = Legs(*ends, rng.uniform(300.0, 800.0, n), 100.0, 0.3, 3000.0, 0.0)
    heaviest = solve_max_initial_mass(legs)
    legs = legs.with_m0(heaviest.m0 / np.exp(rng.uniform(0.0, np.log(10.0), n)))
    solved = optimise(legs, guess=heaviest)
    assert solved.converged.all()
    return legs, solved.m_final


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


def test_errors_of_final_masses_are_as_large_as_the_model_says(default):
    legs, truth = solved_legs(60, seed=11)
    told = default.predict(legs)
    np.testing.assert_array_equal(told.final_mass_error, default.final_mass_error(legs))
    miss = np.abs(told.final_mass - truth)
    assert np.median(miss / truth) < 0.005
    within = (miss < told.final_mass_error).mean()
    assert 0.5 < within < 0.9
    # Where it is less sure it is more often wrong.
    unsure = told.final_mass_error / truth > np.median(told.final_mass_error / truth)
    assert np.median((miss / truth)[unsure]) > np.median((miss / truth)[~unsure])


def test_the_error_is_nan_where_there_is_no_flight_to_be_wrong_about(default):
    leg = sample_leg()
    heavy = leg.with_m0(3.0 * default.max_initial_mass(leg))
    assert np.isnan(default.final_mass_error(heavy)).all()
    nearly = leg.with_m0(1.001 * default.max_initial_mass(leg))
    assert np.isfinite(default.final_mass_error(nearly)).all()
    arrays = {k: v for k, v in default.artefact.arrays.items() if not k.startswith("final_mass/")}
    bounds = FeasibilityClassifier(dataclasses.replace(default.artefact, arrays=arrays))
    assert np.isnan(bounds.final_mass_error(leg)).all()
    assert np.isfinite(bounds.final_mass(leg)).all()


def test_models_from_before_the_hint_still_answer(default, flown):
    k = len(BOUND_INPUTS)
    old = dict(default.artefact.arrays)
    del old["final_mass/error_fit"]
    for name in ("mean", "std", "weight_0"):
        old[f"final_mass/{name}"] = old[f"final_mass/{name}"][..., :k]
    classifier = FeasibilityClassifier(dataclasses.replace(default.artefact, arrays=old))
    told = classifier.predict(flown.legs)
    assert np.isfinite(told.final_mass).all()
    flyable = told.margin > 1.0
    assert (told.final_mass_error[flyable] > 0.0).all()


def test_a_net_of_other_inputs_is_refused_also_in_memory(default):
    arrays = dict(default.artefact.arrays)
    for name in ("mean", "std", "weight_0"):
        arrays[f"final_mass/{name}"] = arrays[f"final_mass/{name}"][..., :50]
    with pytest.raises(InputError, match="final_mass: 50 inputs, expected 84 or 96"):
        FeasibilityClassifier(dataclasses.replace(default.artefact, arrays=arrays))
    arrays = {**default.artefact.arrays, "model/std": np.zeros(80)}
    with pytest.raises(InputError, match="std, expected more than zero"):
        FeasibilityClassifier(dataclasses.replace(default.artefact, arrays=arrays))


def test_no_more_is_burnt_than_full_thrust_all_the_time_burns(default):
    legs, _ = solved_legs(20, seed=3)
    for factor in (0.2, 1.0, 5.0):
        some = legs.with_m0(factor * legs.m0)
        most = some.m0 - some.thrust * some.tof_s / some.exhaust_velocity
        assert (default.final_mass(some) >= np.maximum(most, 0.0)).all()

"""`check_predictor`: what honours the contract passes, and each breach is named."""

import doctest
import threading
from dataclasses import dataclass, field

import numpy as np
import pytest

from feasibility import FeasibilityClassifier, check_predictor
from feasibility.classifier import predictor as module
from feasibility.classifier.check import PredictorContractError
from feasibility.orbits.varied_legs import varied_legs
from tests.helpers.labelled import labelled_dataset
from tests.helpers.predictors import Toy


def _unknown(legs):
    return np.full(len(legs), np.nan)


def _ones(legs):
    return np.ones(len(legs))


@dataclass(frozen=True)
class _By:
    """A predictor made of functions, for the tests of the check."""

    margin_function: object = _unknown
    mass_function: object = _unknown

    def margin(self, legs, /):
        return self.margin_function(legs)

    def final_mass(self, legs, /):
        return self.mass_function(legs)


@dataclass(frozen=True)
class _Quick(_By):
    quick_function: object = _unknown

    def quick_margin(self, legs, /):
        return self.quick_function(legs)


class _NoMass:
    def margin(self, legs, /):
        return _unknown(legs)


def _position(legs):
    return 1.0 + np.arange(len(legs)) % 2


def _relative(legs):
    return legs.m0 / (legs.m0.mean() if len(legs) else 1.0)


def _spoil(legs):
    legs.m0.flags.writeable = True
    legs.m0[:] *= 0.5
    return np.ones(len(legs))


def _short(legs):
    return np.ones(len(legs) // 2)


def _column(legs):
    return np.ones((len(legs), 1))


def _single(legs):
    return np.ones(len(legs), dtype=np.float32)


def _list(legs):
    return [1.0] * len(legs)


def _last(legs):
    return legs.m0 / legs.m0[-1]


def _zeros(legs):
    return np.zeros(len(legs))


def _infinite(legs):
    return np.where(legs.m0 > np.inf, 1.0, np.inf)


def _negative(legs):
    return -legs.m_dry


def _gains(legs):
    return 1.01 * legs.m0


def _keeps(legs):
    return legs.m0.copy()


class _Fickle(_By):
    calls = 0

    def margin(self, legs, /):
        _Fickle.calls += 1
        return np.full(len(legs), float(_Fickle.calls))


class _MainThreadOnly(_By):
    def margin(self, legs, /):
        here = threading.current_thread() is threading.main_thread()
        return np.full(len(legs), 1.0 if here else 2.0)


@dataclass
class _Forgetful:
    value: float = field(default=1.5)

    def margin(self, legs, /):
        return np.full(len(legs), self.value)

    def final_mass(self, legs, /):
        return _unknown(legs)

    def __getstate__(self):
        return {"value": 2.0}


def test_the_default_model_and_a_toy_honour_the_contract():
    model = FeasibilityClassifier.load("default")
    for predictor in (model, Toy()):
        check_predictor(predictor)
        check_predictor(predictor, rng=np.random.default_rng(5))
        check_predictor(predictor, labelled_dataset(300, seed=2).legs)


def test_to_know_nothing_is_legal_and_so_are_the_ends_of_the_range():
    check_predictor(_By())
    check_predictor(_Quick(), varied_legs(np.random.default_rng(1)).take([0]))
    check_predictor(_By(_ones, _zeros))
    check_predictor(_By(_ones, _keeps))


@pytest.mark.parametrize(
    ("predictor", "message"),
    [
        (_NoMass(), "_NoMass: has no method final_mass"),
        (_By(_short), "_By.margin: returned shape (32,) on 64 legs, expected (64,)"),
        (_By(_column), "shape (64, 1)"),
        (_By(_ones, _single), "_By.final_mass: returned dtype float32"),
        (_By(_list), "list"),
        (_By(_last), "raised IndexError on no legs"),
        (_By(_position), "margin: not row-wise: a leg gets another answer when the legs are rev"),
        (_By(_ones, _relative), "final_mass: not row-wise"),
        (_Quick(_ones, _zeros, _position), "quick_margin: not row-wise"),
        (_By(_spoil), "changed the legs"),
        (_Fickle(), "two calls"),
        (_MainThreadOnly(), "threads ask at once"),
        (_By(_zeros), "margin: returned 0 for leg 0, expected a finite number above 0, or NaN"),
        (_By(_infinite), "returned inf for leg 0"),
        (_Quick(_ones, _zeros, _negative), "quick_margin: returned -"),
        (_By(_ones, _negative), "final_mass: returned -"),
        (_By(_ones, _gains), "expected 0 to the initial mass, or NaN"),
        (_By(lambda legs: np.ones(len(legs))), "not picklable"),
        (_Forgetful(), "restored copy"),
    ],
)
def test_each_breach_of_the_contract_is_named_in_one_line(predictor, message):
    with pytest.raises(PredictorContractError) as caught:
        check_predictor(predictor)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_model_that_knows_no_margins_is_told_so():
    class NoMargins(_By):
        def margin(self, legs, /):
            raise ValueError("this model\nknows no margins")

    with pytest.raises(PredictorContractError, match="ValueError on 64 legs: this model knows no"):
        check_predictor(NoMargins())


def test_the_example_of_the_documentation_runs():
    assert doctest.testmod(module).failed == 0

"""The pruners and the check of their contract."""

import pickle
import time
from dataclasses import dataclass, field

import numpy as np
import pytest

from feasibility.errors import InputError
from feasibility.orbits.lambert import lambert_delta_v
from feasibility.orbits.mima import mima, mima2
from feasibility.orbits.varied_legs import varied_legs
from feasibility.pruners import (
    AllOf,
    KeepAll,
    LambertPruner,
    Mima2Pruner,
    MimaPruner,
    Pruner,
    PrunerContractError,
    check_pruner,
    quick_check,
)
from tests.helpers.free_legs import free_legs, with_ends


@dataclass(frozen=True)
class _By:
    """A pruner made of a function, for the tests of the check."""

    function: object

    def keep(self, legs, /):
        return self.function(legs)


def _drop_all(legs):
    return np.zeros(len(legs), dtype=bool)


def _nothing_on_none(legs):
    return legs.m0 < legs.m0.max()


def _median(legs):
    return legs.m0 <= (np.median(legs.m0) if len(legs) else 0.0)


def _position(legs):
    return np.arange(len(legs)) % 2 == 0


def _unique(legs):
    return np.array([np.sum(legs.m0 == m) == 1 for m in legs.m0], dtype=bool)


def _spoil(legs):
    legs.m0.flags.writeable = True
    legs.m0[:] *= 0.5
    return np.ones(len(legs), dtype=bool)


class _Alternating:
    def __init__(self):
        self.calls = 0

    def keep(self, legs, /):
        self.calls += 1
        return np.full(len(legs), self.calls % 2 == 0)


@dataclass
class _Forgetful:
    limit: float = field(default=1000.0)

    def keep(self, legs, /):
        return legs.m0 < self.limit

    def __getstate__(self):
        return {"limit": 0.0}


SHIPPED = [
    KeepAll(),
    LambertPruner(),
    MimaPruner(),
    Mima2Pruner(margin=0.9, max_revs=1),
    AllOf(LambertPruner(), MimaPruner(margin=0.9), Mima2Pruner()),
    AllOf(),
]


@pytest.mark.parametrize("pruner", SHIPPED, ids=lambda p: p.name)
def test_shipped_pruners_honour_the_contract(pruner):
    assert isinstance(pruner, Pruner)
    check_pruner(pruner)
    assert pickle.loads(pickle.dumps(pruner)) == pruner


def test_keeping_or_dropping_everything_is_legal():
    check_pruner(_By(_drop_all))
    check_pruner(KeepAll(), varied_legs(np.random.default_rng(5)).take([0]))


@pytest.mark.parametrize(
    ("pruner", "message"),
    [
        (_By(lambda legs: np.ones(len(legs) + 1, bool)), "shape"),
        (_By(lambda legs: np.ones(len(legs))), "dtype float64"),
        (_By(lambda legs: [True] * len(legs)), "list"),
        (_By(_position), "not row-wise"),
        (_By(_median), "not row-wise"),
        (_By(_unique), "not row-wise"),
        (_By(_nothing_on_none), "no legs"),
        (_By(_spoil), "changed the legs"),
        (_Alternating(), "two calls"),
        (_By(lambda legs: np.ones(len(legs), bool)), "not picklable"),
        (_Forgetful(), "restored copy"),
    ],
)
def test_each_breach_of_the_contract_is_named_in_one_line(pruner, message):
    with pytest.raises(PrunerContractError) as caught:
        check_pruner(pruner)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_quick_check_finds_most_breaches():
    for pruner in (
        _By(lambda legs: np.ones(len(legs) + 1, bool)),
        _By(lambda legs: np.ones(len(legs))),
        _By(lambda legs: [True] * len(legs)),
        _By(_position),
        _By(_median),
        _By(_spoil),
        _Alternating(),
        AllOf(KeepAll(), AllOf(_By(_position))),
    ):
        with pytest.raises(PrunerContractError) as caught:
            quick_check(pruner)
        assert "\n" not in str(caught.value)


def test_a_quick_check_of_a_fast_pruner_takes_no_time_and_ours_are_not_asked():
    class Broken(BaseException):
        """Not caught by anything that asks a pruner."""

    def refuse(_):
        raise Broken

    began = time.process_time()
    quick_check(_By(_drop_all))
    assert time.process_time() - began < 0.05
    for pruner in SHIPPED:
        quick_check(pruner)
    with pytest.raises(Broken):
        quick_check(AllOf(_By(refuse)))


def test_a_model_that_refuses_no_legs_is_not_asked_about_none():
    picky = _By(_nothing_on_none)
    with pytest.raises(ValueError, match="zero-size"):
        picky.keep(varied_legs(np.random.default_rng(1)).take(np.arange(0)))
    legs = varied_legs(np.random.default_rng(1))
    assert not AllOf(_By(_drop_all), picky).keep(legs).any()
    assert AllOf(picky).keep(legs.take(np.arange(0))).shape == (0,)


def test_a_bare_scikit_learn_model_is_a_pruner():
    tree = pytest.importorskip("sklearn.tree")

    class Plain:
        def __init__(self, model):
            self.model = model

        def keep(self, legs, /):
            return self.model.predict(np.column_stack([legs.tof_days, legs.m0])).astype(bool)

    legs = varied_legs(np.random.default_rng(1))
    inputs = np.column_stack([legs.tof_days, legs.m0])
    pruner = Plain(tree.DecisionTreeClassifier().fit(inputs, legs.tof_days < 300.0))
    quick_check(pruner)
    np.testing.assert_array_equal(AllOf(pruner).keep(legs), legs.tof_days < 300.0)
    assert not AllOf(_By(_drop_all), pruner).keep(legs).any()


def test_mima_pruners_compare_with_the_initial_mass():
    legs = varied_legs(np.random.default_rng(3))
    arguments = (legs.rv_dep, legs.rv_arr, legs.tof_s, legs.thrust, legs.exhaust_velocity)
    for pruner, mass in ((MimaPruner, mima), (Mima2Pruner, mima2)):
        kept = pruner(margin=1.2).keep(legs)
        assert 0 < kept.sum() < len(legs)
        np.testing.assert_array_equal(kept, mass(*arguments) >= 1.2 * legs.m0)


def test_lambert_pruner_respects_engine_and_dry_mass():
    legs = varied_legs(np.random.default_rng(3))
    kept = LambertPruner(factor=0.7).keep(legs)
    assert 0 < kept.sum() < len(legs)
    need = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s)
    left = legs.m0 - legs.thrust * legs.tof_s / legs.exhaust_velocity
    with np.errstate(invalid="ignore"):
        gives = np.where(left > 0, legs.exhaust_velocity * np.log(legs.m0 / left), np.inf)
    fits = legs.m0 * np.exp(-need / legs.exhaust_velocity) >= legs.m_dry
    np.testing.assert_array_equal(kept, (need <= 0.7 * gives) & fits)


def test_all_of_asks_only_about_survivors_and_counts_by_name():
    legs = varied_legs(np.random.default_rng(3))
    asked = []

    class Recording:
        name = "mima"

        def keep(self, legs, /):
            asked.append(len(legs))
            return legs.tof_days < 300

    first = MimaPruner(margin=0.5)
    both = AllOf(first, Recording())
    found = both.survivors(legs)
    mask, pruned = found.mask, found.pruned
    survivors = first.keep(legs)
    np.testing.assert_array_equal(mask, survivors & (legs.tof_days < 300))
    assert asked == [survivors.sum()]
    assert pruned == {"mima": (~survivors).sum(), "mima-2": survivors.sum() - mask.sum()}
    assert both.pruners[0] is first


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: LambertPruner(factor=0.0),
        lambda: MimaPruner(margin=-1.0),
        lambda: Mima2Pruner(margin=float("nan")),
        lambda: Mima2Pruner(max_revs=-1),
    ],
)
def test_nonsense_parameters_are_input_errors(wrong):
    with pytest.raises(InputError):
        wrong()


def test_legs_with_free_ends_are_judged_with_lambert_s_excess_cut_to_the_bounds():
    legs = free_legs(40, 1, far=0.2)
    for pruner in (LambertPruner(), MimaPruner(), Mima2Pruner()):
        rest = pruner.keep(legs)
        some = pruner.keep(with_ends(legs, 1000.0, 1000.0))
        assert (some | ~rest).mean() > 0.9
        assert pruner.keep(with_ends(legs, np.inf, np.inf)).all()
        assert some.sum() > rest.sum()

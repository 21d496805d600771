"""The audit: its estimates against brute force, its samples, and that it changes no search."""

import copy
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from feasibility import Legs
from seqsearch import search
from seqsearch.core.candidates import Candidates
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.deadline import Deadline
from seqsearch.pruning.audit import RankSample
from seqsearch.pruning.audit_estimate import AuditEstimate, RankAudit, Stratum, share_interval
from seqsearch.runs.run_folder import candidates_csv
from tests.helpers.problems import small_problem, small_settings

PROBLEM = SimpleNamespace(min_stay_days=30.0)
START = Nodes.at_start(np.zeros(1, dtype=np.intp), np.zeros(1), np.full(1, 2000.0))


def _stratum(candidates, solved, flyable, label="x"):
    return Stratum(label=label, candidates=candidates, solved=solved, flyable=flyable)


@given(found=st.integers(0, 40), kept=st.integers(0, 40), weight=st.floats(1.0, 1e5))
def test_with_one_weight_the_interval_is_that_of_clopper_and_pearson(found, kept, weight):
    part, rest = _stratum(40 * weight, 40, found), _stratum(40 * weight, 40, kept)
    if found + kept == 0:
        assert share_interval([part], [rest]) == (0.0, 1.0)
        return
    exact = binomtest(found, found + kept).proportion_ci(0.95, method="exact")
    assert share_interval([part], [rest]) == pytest.approx(tuple(exact), abs=1e-9)


def test_more_solves_tighten_the_interval_and_hopeless_millions_widen_it():
    kept = _stratum(30_000, 100, 80)
    near = _stratum(1000, 50, 5)
    few = share_interval([near, _stratum(1e6, 100, 0)], [kept])
    many = share_interval([near, _stratum(1e6, 10_000, 0)], [kept])
    none = share_interval([near], [kept])
    assert few[1] > 2 * many[1]
    assert many[1] >= none[1]
    assert few[0] == many[0] == none[0] > 0


def test_a_far_stratum_is_a_tripwire():
    near, kept = _stratum(1000, 50, 5), _stratum(30_000, 100, 80)
    quiet = replace(_stratum(1e6, 100, 0), far=True)
    without = AuditEstimate.of([RankAudit(pruned=(near,), kept=(kept,))])
    calm = AuditEstimate.of([RankAudit(pruned=(near, quiet), kept=(kept,))])
    assert calm.interval == without.interval
    assert calm.interval_unconditional[1] > 2 * calm.interval[1]
    tripped = replace(quiet, flyable=1)
    alarm = AuditEstimate.of([RankAudit(pruned=(near, tripped), kept=(kept,))])
    assert alarm.interval == alarm.interval_unconditional
    assert alarm.false_prune_rate > 10 * calm.false_prune_rate
    assert alarm.far_found == 1


def test_nothing_pruned_and_nothing_flyable():
    nothing = AuditEstimate.of([RankAudit(pruned=(), kept=(_stratum(100, 50, 40),))])
    assert nothing.false_prune_rate == 0
    assert nothing.interval == (0.0, 0.0)
    hopeless = AuditEstimate.of([RankAudit(pruned=(_stratum(100, 50, 0),), kept=())])
    assert np.isnan(hopeless.false_prune_rate)
    assert hopeless.interval == (0.0, 1.0)
    assert "none of 50" in hopeless.one_line()


@settings(max_examples=12)
@given(
    sizes=st.lists(st.integers(200, 30_000), min_size=4, max_size=4),
    rates=st.lists(st.sampled_from([0.0, 1e-3, 0.01, 0.1, 0.5]), min_size=3, max_size=3),
    ranks=st.integers(1, 5),
    seed=st.integers(0, 2**32),
)
def test_estimates_hold_against_brute_force(sizes, rates, ranks, seed):
    """Draw strata again and again from a population that is known."""
    rng = np.random.default_rng(seed)
    flyable = [[rng.binomial(n, p) for n, p in zip(sizes, [*rates, 0.7], strict=True)]]
    flyable *= ranks
    lost = sum(sum(rank[:3]) for rank in flyable)
    truth = lost / (lost + sum(rank[3] for rank in flyable))
    solves = (60, 40, 40, 60)
    estimates = []
    for _ in range(300):
        audits = []
        for rank in flyable:
            strata = tuple(
                _stratum(size, n, int(rng.hypergeometric(good, size - good, n)))
                for size, good, n in zip(sizes, rank, solves, strict=True)
            )
            audits.append(RankAudit(pruned=strata[:3], kept=strata[3:]))
        estimates.append(AuditEstimate.of(audits))
    covered = np.mean([e.interval[0] <= truth <= e.interval[1] for e in estimates])
    # 0.95 less what chance does to 300 trials.
    assert covered >= 0.9
    pruned = np.array([e.flyable_pruned for e in estimates])
    assert abs(pruned.mean() - lost) <= 5 * pruned.std() / np.sqrt(len(pruned)) + 1e-9


@dataclass(frozen=True)
class _ByTof:
    """A toy in which the flight time is the margin in percent."""

    def margin(self, legs, /):
        return np.where(legs.tof_days < 10.0, np.nan, legs.tof_days / 100.0)

    def final_mass(self, legs, /):
        return legs.m0


class _ToyOptimiser:
    """Flies what has a margin of 0.95; remembers the flight times that it was asked for."""

    def __init__(self):
        self.asked = None

    def solve_all(self, hops, solver, deadline):
        if deadline.passed():
            return None
        self.asked = hops.legs[0].tof_days
        masses = SimpleNamespace(m_final=hops.legs[0].m0)
        return SimpleNamespace(flyable=self.asked >= 95.0, solutions=(masses,))


def _candidates(tof_days):
    n = len(tof_days)
    circle = np.tile([1.5e11, 0, 0, 0, 3e4, 0], (n, 1))
    legs = Legs(circle, circle, tof_days, 2000.0, 0.3, 3000.0, 800.0, t_dep_mjd2000=np.zeros(n))
    return Candidates(np.zeros(n, dtype=np.intp), np.arange(n), Hops((legs,), (np.zeros(n),)))


def _solve(blocks, solves=40, predictor=None, seed=0, optimiser=None, limit_s=None):
    sample = RankSample(np.random.default_rng(seed), 3, solves, predictor)
    for block in blocks:
        sample.offer(block, block.hops.legs[0].tof_days >= 97.0)
    return sample.solve(
        PROBLEM,
        START,
        optimiser or _ToyOptimiser(),
        "toy",
        Deadline(limit_s),
        lambda nodes: nodes.t_arr_mjd2000 < 96.0,
    )


def _tofs(n, seed=5):
    return np.random.default_rng(seed).uniform(5.0, 105.0, n)


@given(cuts=st.lists(st.integers(1, 999), min_size=1, max_size=4))
@settings(max_examples=10)
def test_the_sample_does_not_depend_on_blocks(cuts):
    parts = np.split(_tofs(1000), sorted(cuts))
    whole, split = _ToyOptimiser(), _ToyOptimiser()
    first = _solve([_candidates(_tofs(1000))], predictor=_ByTof(), optimiser=whole)
    second = _solve(
        [_candidates(part) for part in parts if len(part)], predictor=_ByTof(), optimiser=split
    )
    assert first == second
    np.testing.assert_array_equal(whole.asked, split.asked)


def test_strata_follow_the_predicted_margin():
    tof = np.concatenate([_tofs(1000), np.full(3000, 20.0)])
    audit = _solve([_candidates(tof)], solves=120, predictor=_ByTof())
    strata = {stratum.label: stratum for stratum in audit.pruned}
    counts = {
        "below 0.9": ((tof >= 10) & (tof < 90)).sum(),
        "0.9 to 0.97": ((tof >= 90) & (tof < 97)).sum(),
        "unknown": (tof < 10).sum(),
    }
    assert {label: s.candidates for label, s in strata.items()} == counts
    assert sum(s.solved for s in audit.pruned) == 120
    assert [s.label for s in audit.pruned if s.flyable] == ["0.9 to 0.97"]
    assert [s.label for s in audit.pruned if s.far] == ["below 0.9"]
    near = strata["0.9 to 0.97"]
    assert 0 < near.contenders < near.flyable
    assert audit.kept[0].solved == audit.kept[0].flyable == 60


def test_a_rank_beyond_what_is_thinned_out_is_weighted():
    tof = np.tile(_tofs(1000), 40)
    rates = []
    for seed in range(20):
        audit = _solve([_candidates(t) for t in np.split(tof, 8)], 200, _ByTof(), seed)
        total = sum(stratum.candidates for stratum in audit.pruned)
        assert total == pytest.approx((tof < 97).sum())
        rates.append(AuditEstimate.of([audit]).false_prune_rate)
    truth = ((tof >= 95) & (tof < 97)).sum() / (tof >= 95).sum()
    assert np.mean(rates) == pytest.approx(truth, abs=4 * np.std(rates) / np.sqrt(20))


def test_without_a_predictor_the_sample_is_plain():
    audit = _solve([_candidates(_tofs(500))])
    assert [stratum.solved for stratum in audit.pruned] == [40]


def test_few_candidates_are_all_solved():
    audit = _solve([_candidates(np.array([20.0, 95.5, 96.5, 99.0]))], predictor=_ByTof())
    estimate = AuditEstimate.of([audit])
    assert estimate.flyable_pruned == 2
    assert estimate.flyable_kept == 1
    assert estimate.contenders == 1


def test_candidates_may_be_thinned_out_before_they_are_made():
    tof = _tofs(200_000)
    sample = RankSample(np.random.default_rng(2), 0, 200, _ByTof())
    for part in np.split(tof, 10):
        some = part[sample.thin(len(part), len(tof))]
        sample.offer(_candidates(some), some >= 97.0)
    audit = sample.solve(
        PROBLEM, START, _ToyOptimiser(), "toy", Deadline(None), lambda n: n.row < 0
    )
    for strata, count in ((audit.pruned, (tof < 97).sum()), (audit.kept, (tof >= 97).sum())):
        # Ten thousand of two hundred thousand are looked at: some percent off.
        assert sum(stratum.candidates for stratum in strata) == pytest.approx(count, rel=0.15)


def test_a_deadline_leaves_no_biased_sample():
    assert _solve([_candidates(_tofs(100))], limit_s=1e-9) is None


def test_the_stream_of_the_search_is_not_advanced():
    rng = np.random.default_rng(1)
    before = copy.deepcopy(rng.bit_generator.state)
    RankSample(rng, 0, 10, None).offer(_candidates(_tofs(50)), np.zeros(50, dtype=bool))
    assert rng.bit_generator.state == before


def test_what_was_tried_is_listed_one_by_one():
    settings = small_settings(pruner="default:0.99", audit={"per_rank": 20})
    counters = search(small_problem(), settings=settings, max_solves=300).counters
    audits = [record.audit for record in counters if record.audit is not None]
    assert audits
    for audit in audits:
        for side, kept in ((audit.pruned, False), (audit.kept, True)):
            hops = [hop for hop in audit.hops if hop.kept == kept]
            assert len(hops) == sum(stratum.solved for stratum in side)
            assert sum(hop.flyable for hop in hops) == sum(stratum.flyable for stratum in side)
            assert all(hop.tof_days > 0 for hop in hops)
        known = [hop for hop in audit.hops if hop.margin is not None]
        near = [hop for hop in known if not hop.kept and 0.9 <= hop.margin < 0.97]
        assert len(near) == sum(s.solved for s in audit.pruned if s.label == "0.9 to 0.97")
    table = candidates_csv(counters).splitlines()
    assert len(table) == 1 + sum(len(audit.hops) for audit in audits)
    assert table[0] == "pass,rank,kept,tof_days,predicted_margin,flyable"

"""Checkpoints: a search that goes on ends as if it had never stopped, whatever stopped it."""

import os
import shutil
import signal
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pytest

from feasibility import InputError, Mima2Pruner
from feasibility.runtime.workers import worker_pool
from seqsearch import search
from seqsearch.beam.state import SearchState
from seqsearch.runs.checkpoint import FOLDER, Checkpoints, Origin, catalogue_digest
from tests.helpers.problems import small_problem, small_settings

SETTINGS = small_settings(
    pruner="mima2:0.97",
    beam_width=3,
    starts=6,
    start_epochs=2,
    tof_days_step=40,
    solves_per_rank=40,
    audit={"per_rank": 6},
    passes=2,
)
SEED = 4


@pytest.fixture(scope="module")
def problem():
    return small_problem()


def _fresh(rng):
    return SearchState(settings=SETTINGS, rng_state=dict(rng.bit_generator.state))


def _origin(problem):
    return Origin(
        seed=SEED,
        time_limit_s=None,
        max_solves=None,
        config_sha256="",
        catalogue_sha256=catalogue_digest(problem.catalogue),
    )


def _run(problem, folder, **options):
    """Search from the beginning and keep checkpoints of whole ranks."""
    rng = np.random.default_rng(SEED)
    checkpoints = Checkpoints.begin(folder, _origin(problem), _fresh(rng))

    def on_rank(state):
        if not state.counters[-1].cut:
            checkpoints.save(state)

    return search(problem, settings=SETTINGS, rng=rng, on_rank=on_rank, **options)


def _resume(problem, folder, after=None, **options):
    checkpoints, state = Checkpoints.load(folder, after)
    checkpoints.discard_later()

    def on_rank(state):
        if not state.counters[-1].cut:
            checkpoints.save(state)

    rng = np.random.default_rng(0)
    return search(problem, settings=SETTINGS, rng=rng, resume=state, on_rank=on_rank, **options)


@pytest.fixture(scope="module")
def whole(problem, tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    return folder, _run(problem, folder)


def _untimed(counters):
    return [
        {key: value for key, value in vars(record).items() if not key.startswith("seconds")}
        for record in counters
    ]


def _assert_same(one, other):
    assert one.tour == other.tour
    assert _untimed(one.counters) == _untimed(other.counters)
    assert dict(one.tree.graph.nodes) == dict(other.tree.graph.nodes)
    assert list(one.tree.graph.edges) == list(other.tree.graph.edges)
    for (*_, left), (*_, right) in zip(
        one.tree.graph.edges(data="legs"), other.tree.graph.edges(data="legs"), strict=True
    ):
        for a, b in zip(left, right, strict=True):
            np.testing.assert_array_equal(a.throttles, b.throttles)


def _ranks(folder):
    files = sorted((folder / FOLDER).glob("0*.ckpt"))
    return [tuple(int(part) for part in file.stem.split("-")[2::2]) for file in files]


def test_from_every_rank_the_search_ends_as_if_it_had_not_stopped(problem, whole, tmp_path):
    folder, undisturbed = whole
    ranks = _ranks(folder)
    assert {1, 2} <= {pass_number for pass_number, _ in ranks}
    for rank in ranks:
        copy = tmp_path / "{}-{}".format(*rank)
        shutil.copytree(folder, copy)
        _assert_same(_resume(problem, copy, rank), undisturbed)
        assert _ranks(copy) == ranks


def test_a_finished_search_has_nothing_left_to_do(problem, whole, tmp_path):
    shutil.copytree(whole[0], tmp_path, dirs_exist_ok=True)
    _assert_same(_resume(problem, tmp_path), whole[1])


def test_interrupted_by_hand(problem, whole, tmp_path):
    pruner = _Interrupting(4)
    stopped = _run(problem, tmp_path, pruner=pruner)
    assert stopped.stopped == "interrupted"
    assert len(stopped.counters) < len(whole[1].counters)
    _assert_same(_resume(problem, tmp_path), whole[1])


class _Interrupting:
    """The pruner of the settings, with Ctrl-C in the middle of a rank."""

    name = "mima2"

    def __init__(self, calls):
        self.left = calls
        self.pruner = Mima2Pruner(0.97)

    def keep(self, legs, /):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
        return self.pruner.keep(legs)


def test_a_budget_of_solves_cuts_and_a_larger_one_goes_on(problem, whole, tmp_path):
    solves = sum(record.optimised for record in whole[1].counters)
    cut = _run(problem, tmp_path, max_solves=solves // 2)
    assert cut.stopped == "solve limit"
    assert sum(record.optimised for record in cut.counters) == solves // 2
    assert cut.counters[-1].cut
    _assert_same(_resume(problem, tmp_path), whole[1])


def test_time_that_was_spent_counts(problem, whole):
    _, state = Checkpoints.load(whole[0])
    assert 0 < state.spent_s < 600
    stopped = search(
        problem, settings=SETTINGS, resume=state, time_limit_s=state.spent_s, max_solves=10**9
    )
    assert stopped.stopped == "time limit"
    assert len(stopped.counters) == len(whole[1].counters)


def test_the_audit_does_not_change_the_search(problem, whole):
    settings = SETTINGS.with_(audit={"per_rank": 0})
    quiet = search(problem, settings=settings, rng=np.random.default_rng(SEED))
    assert quiet.tour == whole[1].tour
    assert dict(quiet.tree.graph.nodes) == dict(whole[1].tree.graph.nodes)
    assert all(record.audit is None for record in quiet.counters)
    assert all(record.audit is not None for record in whole[1].counters)


@pytest.mark.parametrize("kind", ["PCG64", "MT19937", "Philox", "SFC64", "PCG64DXSM"])
def test_every_random_stream_goes_on(problem, tmp_path, kind):
    rng = np.random.Generator(getattr(np.random, kind)(3))
    rng.random(7)
    Checkpoints.begin(tmp_path, _origin(problem), _fresh(rng))
    _, state = Checkpoints.load(tmp_path)
    twin = np.random.Generator(getattr(np.random, kind)(0))
    twin.bit_generator.state = state.rng_state
    np.testing.assert_array_equal(rng.random(9), twin.random(9))


def _refused(folder, *words, after=None):
    with pytest.raises(InputError) as caught:
        Checkpoints.load(folder, after)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.fixture
def copied(whole, tmp_path):
    shutil.copytree(whole[0], tmp_path, dirs_exist_ok=True)
    return tmp_path


def _third(folder):
    return sorted((folder / FOLDER).glob("0*.ckpt"))[2]


def test_a_changed_byte_is_noticed(copied):
    path = _third(copied)
    content = bytearray(path.read_bytes())
    content[-5] ^= 1
    path.write_bytes(content)
    _refused(copied, path.name, "checksum")
    # What came before is still good.
    assert Checkpoints.load(copied, (1, 1))[1].pass_number == 1


@pytest.mark.parametrize("content", [b"", b"seqsearch checkpoint 1\n", b"\x80\x04K\x01."])
def test_what_is_no_checkpoint_is_refused(copied, content):
    _third(copied).write_bytes(content)
    _refused(copied, _third(copied).name)


def test_another_version_is_refused(copied):
    path = _third(copied)
    content = path.read_bytes().replace(b"seqsearch checkpoint 3", b"seqsearch checkpoint 2")
    path.write_bytes(content)
    _refused(copied, "another version", "checkpoint 2")


def test_a_missing_rank_is_noticed(copied):
    _third(copied).unlink()
    _refused(copied, "does not follow")


def test_a_rank_of_another_run_is_noticed(copied, problem):
    other = copied / "other"
    other.mkdir()
    rng = np.random.default_rng(99)
    checkpoints = Checkpoints.begin(other, _origin(problem), _fresh(rng))
    settings = SETTINGS.with_(passes=1)
    search(problem, settings=settings, rng=rng, on_rank=checkpoints.save)
    foreign = sorted((other / FOLDER).glob("0*.ckpt"))[2]
    shutil.copy(foreign, _third(copied))
    _refused(copied, "another run")


def test_a_rank_that_is_not_there_is_named(copied):
    _refused(copied, "7:3", "0:0", after=(7, 3))


def test_no_run_folder(tmp_path):
    _refused(tmp_path, "origin.ckpt")


def _die_once(marker, hops, solver):
    from seqsearch.core.optimisation import solve_hops

    if not Path(marker).exists():
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return solve_hops(hops, solver)


class _Deadly:
    """An executor whose first batch kills its worker."""

    def __init__(self, pool, marker):
        self.pool = pool
        self.marker = str(marker)

    def submit(self, fn, /, *args):
        return self.pool.submit(_die_once, self.marker, *args)


def test_a_killed_worker_does_not_lose_the_run(problem, whole, tmp_path):
    with worker_pool(2) as pool:
        found = search(
            problem,
            settings=SETTINGS,
            rng=np.random.default_rng(SEED),
            executor=_Deadly(pool, tmp_path / "died"),
        )
        assert pool.mended == 1
    _assert_same(found, whole[1])


def test_a_foreign_pool_that_breaks_loses_no_finished_rank(problem, whole, tmp_path):
    (tmp_path / "died").touch()
    with ProcessPoolExecutor(1) as pool:
        executor = _Deadly(pool, tmp_path / "died")
        rng = np.random.default_rng(SEED)
        checkpoints = Checkpoints.begin(tmp_path, _origin(problem), _fresh(rng))

        def on_rank(state):
            checkpoints.save(state)
            (tmp_path / "died").unlink(missing_ok=True)

        with pytest.raises(BrokenProcessPool):
            search(problem, settings=SETTINGS, rng=rng, executor=executor, on_rank=on_rank)
    _assert_same(_resume(problem, tmp_path), whole[1])

"""A Dask cluster as an executor: calls, shared values, lost workers, clusters of no use."""

import shutil
import sys
import time
import uuid
from concurrent.futures import wait
from pathlib import Path

import pytest

import feasibility
from feasibility import InputError, MissingDependencyError
from feasibility.runtime import cluster as module
from feasibility.runtime.cluster import cluster, crew, shared, source_digest
from feasibility.runtime.workers import WorkersLostError
from tests.helpers.clusters import running_cluster

pytest.importorskip("distributed")

PACKAGES = ("feasibility",)
SECONDS = 60


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    with running_cluster(tmp_path_factory.mktemp("cluster"), 2) as there:
        yield there


@pytest.fixture
def executor(running):
    with cluster(running.address, PACKAGES) as there:
        yield there


def test_calls_and_their_errors_come_back(executor):
    assert [executor.submit(pow, 2, k).result(SECONDS) for k in range(3)] == [1, 2, 4]
    assert executor.submit(sorted, [1, 2], reverse=True).result(SECONDS) == [2, 1]
    with pytest.raises(ValueError, match="invalid literal"):
        executor.submit(int, "x").result(SECONDS)
    assert executor.threads == 2


def test_the_same_call_twice_is_two_calls(executor):
    calls = [executor.submit(_a_new_object) for _ in range(4)]
    assert len({call.result(SECONDS) for call in calls}) == 4


def _a_new_object() -> str:
    return uuid.uuid4().hex


def test_a_shared_value_arrives_as_itself(executor):
    value = bytes(range(256)) * 1000
    handle = shared(executor, value)
    assert handle is not value
    calls = [executor.submit(_length_and_sum, k, handle, scale=2) for k in range(4)]
    assert [call.result(SECONDS) for call in calls] == [(k, len(value), 2) for k in range(4)]


def _length_and_sum(k: int, value: bytes, *, scale: int) -> tuple[int, int, int]:
    return k, len(value), scale


def test_other_executors_get_a_shared_value_with_each_call():
    with crew(2, None, PACKAGES) as pool:
        value = [1, 2]
        assert shared(pool, value) is value


def test_a_cancelled_call_ends_at_once_and_what_is_abandoned_takes_no_more(executor):
    calls = [executor.submit(_sleep, 0.2) for _ in range(8)]
    assert calls[-1].cancel()
    assert calls[-1].cancelled()
    executor.abandon()
    assert wait(calls, timeout=5).not_done == set()
    with pytest.raises(RuntimeError, match="shut down"):
        executor.submit(_sleep, 0.0)


def _sleep(seconds: float) -> None:
    time.sleep(seconds)


def test_a_worker_with_other_sources_is_refused_in_one_line(running, tmp_path):
    shutil.copytree(
        Path(feasibility.__file__).parent,
        tmp_path / "feasibility",
        ignore=shutil.ignore_patterns("*.seqmodel", "__pycache__"),
    )
    other = tmp_path / "feasibility" / "errors.py"
    other.write_text(other.read_text() + "# changed\n")
    with running_cluster(tmp_path, 0) as there:
        there.add_worker(path=tmp_path)
        with (
            pytest.raises(InputError, match=r"another feasibility \(0\..*same sources") as caught,
            cluster(there.address, PACKAGES),
        ):
            pass
        assert "\n" not in str(caught.value)


def test_a_cluster_without_workers_is_refused_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_FIRST_WORKER_S", 0.5)
    with (
        running_cluster(tmp_path, 0) as there,
        pytest.raises(InputError, match="has no worker; start one with: dask worker tcp://"),
        cluster(there.address, PACKAGES),
    ):
        pass


def test_lost_workers_are_counted_and_without_any_the_calls_are_given_up(tmp_path):
    with running_cluster(tmp_path, 2) as there, cluster(there.address, PACKAGES) as executor:
        executor._patience_s = 1.5
        handle = shared(executor, b"kept")
        calls = [executor.submit(_after_a_while, handle, k) for k in range(8)]
        calls[0].result(SECONDS)
        there.kill_worker(0)
        assert [call.result(SECONDS) for call in calls] == [(b"kept", k) for k in range(8)]
        call = executor.submit(_sleep, 60.0)
        there.kill_worker(1)
        with pytest.raises(WorkersLostError, match="all workers of the Dask scheduler tcp"):
            call.result(SECONDS)
        assert executor.mended == 2
        with pytest.raises(WorkersLostError):
            executor.submit(_sleep, 0.0)


def _after_a_while(value: bytes, k: int) -> tuple[bytes, int]:
    _sleep(0.2)
    return value, k


def test_a_lost_scheduler_is_told_in_one_line(tmp_path):
    with running_cluster(tmp_path, 1) as there, cluster(there.address, PACKAGES) as executor:
        call = executor.submit(_sleep, 60.0)
        there.scheduler.kill()
        with pytest.raises(WorkersLostError, match=r"the Dask scheduler tcp\S* is gone"):
            call.result(SECONDS)


@pytest.mark.filterwarnings("ignore")
def test_no_scheduler_there_is_one_line(monkeypatch):
    monkeypatch.setattr(module, "_CONNECT_S", 0.5)
    for address in ("tcp://127.0.0.1:1", "nonsense://x"):
        with (
            pytest.raises(InputError, match="no Dask scheduler there") as caught,
            cluster(address, PACKAGES),
        ):
            pass
        assert "\n" not in str(caught.value)


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(MissingDependencyError, match=r"seqsearch\[dask\]"),
        cluster("tcp://127.0.0.1:1", PACKAGES),
    ):
        pass


def test_a_digest_is_of_names_and_contents(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    package = tmp_path / "some_package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    digests = [source_digest("some_package")]
    (package / "part.py").write_text("x = 1\n")
    digests.append(source_digest("some_package"))
    (package / "part.py").rename(package / "piece.py")
    digests.append(source_digest("some_package"))
    assert len(set(digests)) == 3
    with pytest.raises(InputError, match="no_such_package"):
        source_digest("no_such_package")

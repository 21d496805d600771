"""A Dask cluster of this machine's processes, which tests may kill."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


class Cluster:
    """A scheduler and its workers, each a process of its own that nothing starts again."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "scheduler.json"
        self._log = (folder / "cluster.log").open("w")
        self.workers: list[subprocess.Popen[bytes]] = []
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0")
        self.address = self._address()

    def add_worker(self, path: Path = ROOT) -> None:
        """Start a worker that finds our packages in a folder."""
        options = ("--no-nanny", "--nthreads", "1", "--host", "127.0.0.1")
        self.workers.append(self._start("worker", *options, path=path))

    def wait_for(self, workers: int) -> None:
        """Wait until this many workers are there."""
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)

    def kill_worker(self, number: int) -> None:
        """End a worker as if its machine were switched off."""
        self.workers[number].send_signal(signal.SIGKILL)
        self.workers[number].wait()

    def end(self) -> None:
        """End whatever is still there."""
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
        self._log.close()

    def _start(self, what: str, *options: str, path: Path = ROOT) -> "subprocess.Popen[bytes]":
        module = f"distributed.cli.dask_{what}"
        file = ("--scheduler-file", str(self._file), "--no-dashboard")
        return subprocess.Popen(
            [sys.executable, "-m", module, *file, *options],
            env=os.environ | {"PYTHONPATH": str(path)},
            cwd=self._file.parent,
            stdout=self._log,
            stderr=self._log,
        )

    def _address(self) -> str:
        for _ in range(600):
            if self._file.exists() and self._file.stat().st_size:
                found: dict[str, Any] = json.loads(self._file.read_text())
                return str(found["address"])
            assert self.scheduler.poll() is None
            time.sleep(0.1)
        raise AssertionError("no scheduler")


@contextmanager
def running_cluster(folder: Path, workers: int) -> Iterator[Cluster]:
    """Yield a cluster with some workers and end it."""
    cluster = Cluster(folder)
    try:
        for _ in range(workers):
            cluster.add_worker()
        if workers:
            cluster.wait_for(workers)
        yield cluster
    finally:
        cluster.end()

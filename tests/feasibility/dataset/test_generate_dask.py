"""Generation on a Dask cluster: the same rows, even where a worker dies on the way."""

import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from feasibility.commands.cli import main
from feasibility.dataset import read_dataset

distributed = pytest.importorskip("distributed")

PROTOCOL = """\
name = "dask"
solver = "fast"
legs_per_shard = 20
propellant = false

[sampler]
kind = "random-pairs"
tof_days_max = 900.0

[spacecraft]
dry_mass_kg = 800.0
thrust_n = 0.5
isp_s = 3000.0

[catalogue]
synthetic_bodies = 60

[impulsive_grid]
step_days = 50.0
fine_step_days = 10.0
"""
LEGS = 2000


@pytest.mark.slow
def test_a_worker_killed_midway_changes_no_row(tmp_path):
    file = tmp_path / "dask.toml"
    file.write_text(PROTOCOL)
    alone, shared_out = tmp_path / "alone", tmp_path / "cluster"
    common = ["generate", str(file), "--legs", str(LEGS), "--out"]
    assert main([*common, str(alone), "--workers", "1"]) == 0

    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
        ThreadPoolExecutor(1) as background,
    ):
        before = client.run(os.getpid)
        assert len(before) == 2
        address = cluster.scheduler_address
        work = background.submit(main, [*common, str(shared_out), "--scheduler", address])
        wait_for_a_shard(shared_out, work)
        os.kill(next(iter(before.values())), signal.SIGKILL)
        assert not work.done()
        assert work.result(timeout=300) == 0
        assert set(client.run(os.getpid).values()) != set(before.values())

    one, other = read_dataset(alone), read_dataset(shared_out)
    for name, column in one.columns.items():
        if name != "seconds":
            np.testing.assert_array_equal(column, other.columns[name], err_msg=name)


def wait_for_a_shard(folder: Path, work) -> None:
    while not list(folder.glob("part-*.parquet")):
        assert not work.done(), work.result()
        time.sleep(0.02)

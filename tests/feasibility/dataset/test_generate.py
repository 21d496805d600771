"""Generation: the same rows however it is run, and nothing finished is ever lost."""

import errno
import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from feasibility import InputError
from feasibility.commands.cli import main
from feasibility.dataset import Dataset, begin, read_dataset, read_protocol
from feasibility.dataset.inspection import inspect_dataset
from feasibility.dataset.labels import make_shard
from feasibility.dataset.storage import METADATA, shard_path
from feasibility.runtime.locks import LOCK, folder_lock
from feasibility.runtime.workers import worker_pool
from feasibility.sims_flanagan import Status

PROTOCOL = """\
name = "small"
solver = "fast"
legs_per_shard = 40
propellant = false
boundary_share = 0.7

[sampler]
kind = "random-pairs"
tof_days_max = 900.0
max_de = 0.1
max_di_deg = 5.0
m0_kg = [1000.0, 6000.0]

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
LEGS = 590


@pytest.fixture(scope="module")
def protocol_file(tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("protocol") / "small.toml"
    file.write_text(PROTOCOL)
    return file


@pytest.fixture(scope="module")
def undisturbed(protocol_file, tmp_path_factory) -> Dataset:
    folder = tmp_path_factory.mktemp("undisturbed") / "data"
    assert generate(protocol_file, folder) == 0
    return read_dataset(folder)


def generate(protocol: Path, folder: Path, *options: str, legs: int = LEGS) -> int:
    common = ["--legs", str(legs), "--out", str(folder), "--workers", "1"]
    return main(["generate", str(protocol), *common, *options])


def assert_same_rows(one: Dataset, other: Dataset, rows: int | None = None) -> None:
    for name, column in one.columns.items():
        if name != "seconds":
            np.testing.assert_array_equal(
                column[:rows], other.columns[name][:rows], err_msg=name, strict=True
            )


def shards(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("part-*.parquet"))


@contextmanager
def running(protocol: Path, folder: Path, *options: str):
    """A generation in a process and session of its own; what is left of it is killed."""
    command = [
        sys.executable,
        "-c",
        "import sys; from feasibility.commands.cli import main; sys.exit(main())",
    ]
    arguments = ["generate", str(protocol), "--legs", str(LEGS), "--out", str(folder), *options]
    with subprocess.Popen(
        command + arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    ) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)


def wait_for_shards(folder: Path, count: int) -> None:
    deadline = time.monotonic() + 120
    while len(shards(folder)) < count:
        assert time.monotonic() < deadline, "no shard within two minutes"
        time.sleep(0.02)


def processes_of_session(session: int) -> list[int]:
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == session and fields[0] != "Z":
                found.append(int(entry.name))
    return found


def test_rows_and_metadata_are_as_asked(undisturbed):
    assert len(undisturbed) == LEGS
    assert undisturbed.metadata["protocol"]["name"] == "small"
    assert undisturbed.metadata["seed"] == 0
    assert undisturbed.metadata["catalogue"]["source"] == "synthetic main belt of 60"
    assert undisturbed.metadata["sessions"][0]["versions"]["numpy"] == np.__version__
    margin = undisturbed.columns["log_margin"]
    ratio = undisturbed.columns["m_star_kg"] / undisturbed.columns["m0_kg"]
    np.testing.assert_allclose(margin, np.log(ratio))
    redrawn = undisturbed.columns["boundary_draw"]
    assert redrawn.any()
    assert (np.abs(margin[redrawn]) < 0.3).all()


@pytest.mark.parametrize("workers", [2, 3])
def test_any_number_of_workers_gives_the_same_rows(protocol_file, undisturbed, tmp_path, workers):
    protocol = read_protocol(str(protocol_file))
    with worker_pool(workers) as executor:
        begin(protocol, LEGS, tmp_path / "data").run(executor, in_flight=workers)
    assert_same_rows(undisturbed, read_dataset(tmp_path / "data"))


def test_a_larger_dataset_begins_with_the_rows_of_a_smaller(protocol_file, undisturbed, tmp_path):
    folder = tmp_path / "data"
    assert generate(protocol_file, folder, legs=50) == 0
    assert_same_rows(read_dataset(folder), undisturbed, rows=50)
    first = shard_path(folder, 0).stat().st_mtime_ns
    assert generate(protocol_file, folder) == 0
    assert_same_rows(undisturbed, read_dataset(folder))
    assert shard_path(folder, 0).stat().st_mtime_ns == first
    assert len(read_dataset(folder).metadata["sessions"]) == 2


def test_kill_9_and_resume_gives_the_dataset_of_an_undisturbed_run(
    protocol_file, undisturbed, tmp_path
):
    folder = tmp_path / "data"
    with running(protocol_file, folder, "--workers", "2") as process:
        wait_for_shards(folder, 1)
        process.kill()
        process.wait()
        deadline = time.monotonic() + 20
        while processes_of_session(process.pid):
            assert time.monotonic() < deadline, "workers outlive their killed parent"
            time.sleep(0.1)
    finished = {name: (folder / name).stat().st_mtime_ns for name in shards(folder)}
    assert len(finished) < 15
    # What a kill in the middle of a write leaves behind.
    (folder / ".part-00014.parquet.x1y2z3").write_bytes(b"half a sh")
    with pytest.raises(InputError, match="missing"):
        read_dataset(folder)
    assert generate(protocol_file, folder) == 0
    assert_same_rows(undisturbed, read_dataset(folder))
    for name, written in finished.items():
        assert (folder / name).stat().st_mtime_ns == written
    assert [path.name for path in folder.glob(".*")] == [LOCK]


def test_a_damaged_shard_is_made_again(protocol_file, undisturbed, tmp_path):
    folder = tmp_path / "data"
    assert generate(protocol_file, folder) == 0
    path = shard_path(folder, 2)
    path.write_bytes(path.read_bytes()[:-20])
    assert generate(protocol_file, folder) == 0
    assert_same_rows(undisturbed, read_dataset(folder))


def test_a_second_process_gets_one_line(protocol_file, tmp_path, capsys):
    folder = tmp_path / "data"
    generation = begin(read_protocol(str(protocol_file)), 50, folder)
    with folder_lock(folder):
        assert generate(protocol_file, folder, legs=50) == 2
        assert "data: in use by another process" in capsys.readouterr().err
        with pytest.raises(InputError, match="in use by another process"):
            generation.run()
    generation.run()
    assert len(read_dataset(folder)) == 50


def test_a_dataset_of_an_older_version_without_checksums_is_completed(protocol_file, tmp_path):
    from pyarrow import parquet

    folder = tmp_path / "data"
    assert generate(protocol_file, folder, legs=40) == 0
    path = folder / METADATA
    old = {
        key: value
        for key, value in json.loads(path.read_text()).items()
        if key not in ("checksums", "sha256")
    }
    path.write_text(json.dumps(old))
    part = shard_path(folder, 0)
    parquet.write_table(parquet.read_table(part).replace_schema_metadata(None), part)
    assert len(read_dataset(folder)) == 40
    assert generate(protocol_file, folder, legs=50) == 0
    assert len(read_dataset(folder)) == 50


def test_ctrl_c_stops_cleanly_and_says_how_to_go_on(protocol_file, tmp_path):
    folder = tmp_path / "data"
    with running(protocol_file, folder, "--workers", "2") as process:
        wait_for_shards(folder, 1)
        # As a terminal does: to the whole group, workers too.
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"Traceback" not in errors
    assert re.search(
        rb"interrupted; \d+ of 590 legs are written, the same command goes on", errors
    )
    protocol = read_protocol(str(protocol_file))
    missing = begin(protocol, LEGS, folder).legs_missing
    assert missing == LEGS - 40 * len(shards(folder))


def test_a_full_disk_is_one_line_and_leaves_the_earlier_shards(
    protocol_file, undisturbed, tmp_path, monkeypatch, capsys
):
    folder = tmp_path / "data"
    write_bytes = Path.write_bytes

    def full_after_two(self, data):
        if "part-00002" in self.name:
            write_bytes(self, bytes(data)[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write_bytes(self, data)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full_after_two)
        assert generate(protocol_file, folder) == 2
    error = capsys.readouterr().err
    assert re.fullmatch(
        r"feasibility: .*part-00002\.parquet: cannot be written \(No space left.*\)\n", error
    )
    assert shards(folder) == ["part-00000.parquet", "part-00001.parquet"]
    assert [path.name for path in folder.glob(".*")] == [LOCK]
    assert generate(protocol_file, folder) == 0
    assert_same_rows(undisturbed, read_dataset(folder))


def test_a_really_full_disk_is_one_line_too(protocol_file, tmp_path, capsys):
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=128k", "tmpfs", str(tmp_path)], check=False
    )
    if mounted.returncode:
        pytest.skip("mounting a small file system needs privileges")
    try:
        (tmp_path / "ballast").write_bytes(bytes(60 * 1024))
        assert generate(protocol_file, tmp_path / "data") == 2
        assert re.fullmatch(
            r"feasibility: .*: cannot be written \(No space left.*\)\n", capsys.readouterr().err
        )
        for name in shards(tmp_path / "data"):
            assert (tmp_path / "data" / name).stat().st_size > 1000
    finally:
        subprocess.run(["umount", str(tmp_path)], check=True)


def test_a_folder_that_cannot_be_made_is_one_line(protocol_file, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert generate(protocol_file, tmp_path / "file" / "data") == 2
    assert re.fullmatch(r"feasibility: .*cannot be used as a folder \(.*\)\n", error_of(capsys))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_one_line(protocol_file, tmp_path, capsys):
    tmp_path.chmod(0o555)
    assert generate(protocol_file, tmp_path) == 2
    assert "cannot be written to" in error_of(capsys)


def test_a_folder_with_something_else_is_left_alone(protocol_file, tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("")
    assert generate(protocol_file, tmp_path) == 2
    assert "is not empty and holds no dataset" in error_of(capsys)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_other_settings_are_refused_and_named(protocol_file, tmp_path, capsys):
    folder = tmp_path / "data"
    begin(read_protocol(str(protocol_file)), LEGS, folder)
    before = (folder / METADATA).read_bytes()
    assert generate(protocol_file, folder, "--seed", "1") == 2
    assert "was begun with seed = 0, now 1" in error_of(capsys)
    other = tmp_path / "other.toml"
    other.write_text(PROTOCOL.replace("thrust_n = 0.5", "thrust_n = 0.6"))
    assert generate(other, folder) == 2
    assert "protocol.spacecraft.thrust_n = 0.5, now 0.6" in error_of(capsys)
    assert generate(protocol_file, folder, legs=5) == 2
    assert "was begun with --legs 590, expected no fewer" in error_of(capsys)
    assert (folder / METADATA).read_bytes() == before


def test_a_catalogue_file_is_known_by_its_content(protocol_file, tmp_path, capsys):
    table = tmp_path / "table.txt"
    header = "ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)\n"
    rows = [f"{k} 64328 2.{30 + k} 0.08 {k / 3} 103.8 151.2 {7 * k}" for k in range(1, 30)]
    table.write_text(header + "\n".join(rows) + "\n")
    folder = tmp_path / "data"
    assert generate(protocol_file, folder, "--catalogue", str(table), legs=2) == 0
    described = json.loads((folder / METADATA).read_text())["catalogue"]
    assert described["bodies"] == 29
    assert len(described["sha256"]) == 64
    capsys.readouterr()
    table.write_text(header + "\n".join(rows[1:]) + "\n")
    assert generate(protocol_file, folder, "--catalogue", str(table), legs=2) == 2
    assert "was begun with catalogue." in error_of(capsys)


def test_metadata_name_the_catalogue_but_no_folder_of_this_machine(
    protocol_file, tmp_path, monkeypatch
):
    header = "ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)\n"
    rows = [f"{k} 64328 2.{30 + k} 0.08 {k / 3} 103.8 151.2 {7 * k}" for k in range(1, 30)]
    (tmp_path / "table.txt").write_text(header + "\n".join(rows) + "\n")
    folder = tmp_path / "data"
    options = ["--out", str(folder), "--catalogue", str(tmp_path / "table.txt"), "--legs", "2"]
    words = ["generate", str(protocol_file), *options]
    monkeypatch.setattr(sys, "argv", [str(tmp_path / "feasibility"), *words])
    assert main(words) == 0
    text = (folder / METADATA).read_text()
    assert str(tmp_path) not in text
    described = json.loads(text)
    assert described["catalogue"]["source"] == "table.txt"
    assert described["protocol"]["catalogue"]["file"] == "table.txt"
    # Folders begun before this was so are completed all the same.
    described["catalogue"]["source"] = "/elsewhere/table.txt"
    described["protocol"]["catalogue"]["file"] = "/elsewhere/table.txt"
    (folder / METADATA).write_text(json.dumps(described))
    assert main([*words[:-1], "3"]) == 0
    assert "elsewhere" not in (folder / METADATA).read_text()
    assert read_dataset(folder).metadata["catalogue"]["source"] == "table.txt"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--legs", "0"], "--legs 0: expected one or more"),
        (["--seed", "-1"], "--seed -1: expected zero or more"),
        (["--workers", "0"], "--workers 0: expected one or more"),
        (["--catalogue", "nowhere.txt"], "nowhere.txt: cannot be read"),
        (["--scheduler", "tcp://127.0.0.1:1"], "no Dask scheduler there"),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_options_that_cannot_be_used_are_one_line(
    protocol_file, tmp_path, capsys, options, message
):
    assert generate(protocol_file, tmp_path / "data", *options) == 2
    error = error_of(capsys)
    assert message in error
    assert error.count("\n") == 1


def test_propellant_is_solved_where_the_leg_is_flyable(protocol_file, tmp_path):
    file = tmp_path / "propellant.toml"
    text = PROTOCOL.replace("propellant = false", "propellant = true").replace("6000", "1100")
    file.write_text(text.replace('"fast"', '"reference"'))
    protocol = read_protocol(str(file))
    task = begin(protocol, 2, tmp_path / "data").tasks[0]
    shard = make_shard(task)
    flyable = shard["log_margin"] >= 0
    assert flyable.any()
    m_final = shard["m_final_kg"]
    np.testing.assert_array_equal(np.isfinite(m_final), shard["status"] == Status.CONVERGED)
    assert np.isnan(m_final[~flyable]).all()
    known = np.isfinite(m_final)
    assert (m_final[known] < shard["m0_kg"][known]).all()
    assert (m_final[known] >= shard["m_dry_kg"][known]).all()


def test_the_paper_protocol_says_what_one_random_start_reached(tmp_path):
    file = tmp_path / "paper.toml"
    file.write_text(
        PROTOCOL.replace("propellant = false", 'label = "convergence"').replace("6000", "1200")
    )
    folder = tmp_path / "data"
    assert generate(file, folder, legs=6) == 0
    data = read_dataset(folder)
    converged = data.feasible
    assert converged.any()
    np.testing.assert_array_equal(converged, np.isfinite(data.columns["m_final_kg"]))
    # What one start reached can be flown: the reference's m* is no lower, to its accuracy.
    assert (data.columns["log_margin"][converged] > -1e-3).all()
    assert "flyable by margin" in inspect_dataset(folder)


def test_inspect_solves_a_sample_again(protocol_file, tmp_path):
    folder = tmp_path / "data"
    assert generate(protocol_file, folder, legs=3) == 0
    text = inspect_dataset(folder, resolve=2)
    assert "2 legs solved again" in text
    assert re.search(r"same side of the boundary +2 +100\.00 %", text)


def error_of(capsys) -> str:
    return capsys.readouterr().err

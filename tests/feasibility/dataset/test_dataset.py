"""A dataset reads back what was written, refuses what is damaged, and splits by pair."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from feasibility import InputError
from feasibility.commands.cli import main
from feasibility.dataset import COLUMNS, Dataset, read_dataset, read_protocol, split_by_pair
from feasibility.dataset.inspection import inspect_dataset
from feasibility.dataset.labels import _at_boundary
from feasibility.dataset.storage import FORMAT, METADATA, shard_path, write_metadata, write_shard
from feasibility.orbits import synthetic_main_belt
from feasibility.sims_flanagan import Status

BELT = synthetic_main_belt(50, np.random.default_rng(0))


def columns(n: int, seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    dep, arr = rng.integers(0, 25, n), rng.integers(25, 50, n)
    swap = rng.uniform(size=n) < 0.5
    dep, arr = np.where(swap, arr, dep), np.where(swap, dep, arr)
    margin = rng.normal(size=n)
    margin[rng.uniform(size=n) < 0.1] = np.nan
    status = np.where(margin >= 0, Status.CONVERGED, Status.TOO_HEAVY)
    status[np.isnan(margin)] = Status.NOT_CONVERGED
    m0 = rng.uniform(1000, 2000, n)
    values = {
        "dep_id": BELT.ids[dep],
        "arr_id": BELT.ids[arr],
        "t_dep_mjd2000": np.full(n, 8000.0),
        "tof_days": rng.uniform(100, 500, n),
        "m0_kg": m0,
        "thrust_n": np.full(n, 0.3),
        "isp_s": np.full(n, 3000.0),
        "m_dry_kg": np.full(n, 800.0),
        "dt_imp_days": rng.uniform(100, 500, n),
        "lambert_dv_m_s": rng.uniform(100, 5000, n),
        "m_star_kg": m0 * np.exp(margin),
        "log_margin": margin,
        "m_final_kg": np.where(margin >= 0, 0.8 * m0, np.nan),
        "status": status,
        "start": rng.integers(0, 5, n),
        "seconds": rng.uniform(0.001, 0.002, n),
        "boundary_draw": rng.uniform(size=n) < 0.3,
        "vinf_dep_m_s": np.where(rng.uniform(size=n) < 0.5, 2000.0, 0.0),
        "vinf_arr_m_s": np.where(rng.uniform(size=n) < 0.5, np.inf, 0.0),
    }
    states = {"dep": BELT.states(8000.0)[dep], "arr": BELT.states(8200.0)[arr]}
    for end, state in states.items():
        for k, name in enumerate(("rx", "ry", "rz", "vx", "vy", "vz")):
            values[f"{name}_{end}_{'m' if k < 3 else 'm_s'}"] = state[:, k]
    return {
        column.name: np.asarray(values[column.name]).astype(column.dtype) for column in COLUMNS
    }


def metadata(legs: int, legs_per_shard: int, **protocol) -> dict:
    settings_ = {**read_protocol("search").to_dict(), "legs_per_shard": legs_per_shard, **protocol}
    catalogue = {"source": "test", "bodies": len(BELT), "sha256": None}
    return {"legs": legs, "protocol": settings_, "seed": 0, "catalogue": catalogue, "sessions": []}


def write(folder: Path, sizes: list[int], **protocol) -> list[dict[str, np.ndarray]]:
    parts = [columns(n, seed) for seed, n in enumerate(sizes)]
    for shard, part in enumerate(parts):
        write_shard(shard_path(folder, shard), part)
    write_metadata(folder, metadata(sum(sizes), sizes[0], **protocol))
    return parts


def dataset(n: int, seed: int = 0, **protocol) -> Dataset:
    return Dataset(columns(n, seed), metadata(n, n, **protocol))


def test_what_was_written_is_read_back_in_order(tmp_path):
    parts = write(tmp_path, [30, 30, 12])
    read = read_dataset(tmp_path)
    assert len(read) == 72
    assert list(read.columns) == [column.name for column in COLUMNS]
    for column in COLUMNS:
        expected = np.concatenate([part[column.name] for part in parts])
        np.testing.assert_array_equal(read.columns[column.name], expected)
        assert read.columns[column.name].dtype == column.dtype
        assert not read.columns[column.name].flags.writeable


def test_the_legs_are_the_columns(tmp_path):
    write(tmp_path, [20])
    read = read_dataset(tmp_path)
    legs = read.legs
    np.testing.assert_array_equal(legs.rv_dep[:, 4], read.columns["vy_dep_m_s"])
    np.testing.assert_array_equal(legs.rv_arr[:, 2], read.columns["rz_arr_m"])
    np.testing.assert_array_equal(legs.m0, read.columns["m0_kg"])
    np.testing.assert_array_equal(legs.dep_id, read.columns["dep_id"])


def test_the_metadata_give_units_and_meanings_of_all_columns(tmp_path):
    write(tmp_path, [3])
    described = json.loads((tmp_path / METADATA).read_text())["columns"]
    assert [entry["name"] for entry in described] == [column.name for column in COLUMNS]
    for entry in described:
        assert entry["meaning"]
        name, unit = entry["name"], entry["unit"]
        for suffix, expected in (("_kg", "kg"), ("_days", "d"), ("_m_s", "m/s"), ("_n", "N")):
            if name.endswith(suffix):
                assert unit == expected


def test_a_missing_shard_is_named(tmp_path):
    write(tmp_path, [10, 10, 10])
    shard_path(tmp_path, 1).unlink()
    with pytest.raises(InputError, match=r"part-00001\.parquet: missing, as 1 of 3 are"):
        read_dataset(tmp_path)


@settings(deadline=None, max_examples=25)
@given(keep=st.floats(0, 0.999))
def test_a_truncated_shard_is_named(tmp_path_factory, keep):
    folder = tmp_path_factory.mktemp("dataset")
    write(folder, [10, 10])
    path = shard_path(folder, 1)
    content = path.read_bytes()
    path.write_bytes(content[: int(keep * len(content))])
    with pytest.raises(InputError, match=r"part-00001\.parquet: not a readable Parquet file"):
        read_dataset(folder)


def test_a_shard_with_other_rows_is_named(tmp_path):
    write(tmp_path, [10, 10])
    write_shard(shard_path(tmp_path, 1), columns(7))
    with pytest.raises(InputError, match=r"part-00001\.parquet: 7 rows, expected 10"):
        read_dataset(tmp_path)


def test_a_shard_with_other_columns_is_named(tmp_path):
    import pyarrow as pa
    from pyarrow import parquet

    write(tmp_path, [10])
    kept = {name: column for name, column in columns(10).items() if name != "seconds"}
    parquet.write_table(pa.table(kept), shard_path(tmp_path, 0))
    with pytest.raises(InputError, match=r"part-00000\.parquet: other columns.*seconds"):
        read_dataset(tmp_path)


def rewrite(path: Path, change, *, keep_checksum: bool = True) -> None:
    """Write a shard again with some numbers changed, as any program may."""
    from pyarrow import parquet

    table = parquet.read_table(path)
    values = table.column("m_star_kg").to_numpy().copy()
    change(values)
    index = table.column_names.index("m_star_kg")
    table = table.set_column(index, "m_star_kg", [values])
    parquet.write_table(table if keep_checksum else table.replace_schema_metadata(None), path)


def nudge(values: np.ndarray) -> None:
    values[3] = np.nextafter(values[3], np.inf)


def test_a_number_that_was_changed_is_found(tmp_path):
    write(tmp_path, [10, 10])
    rewrite(shard_path(tmp_path, 1), nudge)
    with pytest.raises(InputError, match=r"part-00001\.parquet: does not match its checksum"):
        read_dataset(tmp_path)


def test_parts_that_were_swapped_are_found(tmp_path):
    write(tmp_path, [10, 10])
    shard_path(tmp_path, 1).write_bytes(shard_path(tmp_path, 0).read_bytes())
    with pytest.raises(InputError, match=r"part-00001\.parquet: does not match its checksum"):
        read_dataset(tmp_path)


def test_a_part_without_checksum_is_refused_where_the_others_have_some(tmp_path):
    write(tmp_path, [10])
    rewrite(shard_path(tmp_path, 0), nudge, keep_checksum=False)
    # As in datasets of older versions.
    assert len(read_dataset(tmp_path)) == 10
    write_metadata(tmp_path, metadata(10, 10) | {"checksums": "sha256"})
    with pytest.raises(InputError, match=r"part-00000\.parquet: has no checksum"):
        read_dataset(tmp_path)


def test_a_dataset_in_a_folder_named_like_a_partition_is_read(tmp_path):
    folder = tmp_path / "seed=1"
    folder.mkdir()
    write(folder, [10])
    assert len(read_dataset(folder)) == 10


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 7}, "does not match its checksum"),
        ({"sha256": "abc"}, "does not match its checksum"),
        ({"sha256": None, "legs": "ten"}, "legs is 'ten', expected a whole number"),
        ({"sha256": None, "legs": True}, "legs is True"),
        ({"sha256": None, "legs": 0}, "0 legs in parts of 10"),
        ({"sha256": None, "legs": 10**15}, "legs in parts of 10, expected at most"),
        ({"sha256": None, "protocol": []}, "no table 'protocol'"),
        ({"sha256": None, "catalogue": {}}, "catalogue.bodies is None"),
    ],
)
def test_metadata_that_were_changed_or_lack_something_are_one_line(tmp_path, change, message):
    write(tmp_path, [10])
    path = tmp_path / METADATA
    record = json.loads(path.read_text()) | change
    path.write_text(json.dumps({k: v for k, v in record.items() if v is not None}))
    with pytest.raises(InputError, match=message) as caught:
        read_dataset(tmp_path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_another_format_version_is_refused(tmp_path):
    write(tmp_path, [10])
    path = tmp_path / METADATA
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format": FORMAT + 1}))
    with pytest.raises(InputError, match=f"format {FORMAT + 1}, expected {FORMAT}"):
        read_dataset(tmp_path)


@pytest.mark.parametrize("text", ["", "{", "[1]"])
def test_damaged_metadata_are_named(tmp_path, text):
    write(tmp_path, [10])
    (tmp_path / METADATA).write_text(text)
    with pytest.raises(InputError, match=r"metadata\.json: "):
        read_dataset(tmp_path)


def test_a_folder_without_dataset_says_what_makes_one(tmp_path):
    with pytest.raises(InputError, match=r"metadata\.json: no such file.*feasibility generate"):
        read_dataset(tmp_path / "nowhere")


def test_feasible_is_a_known_margin_of_at_least_zero_and_enough_propellant():
    data = dataset(300)
    margin = data.columns["log_margin"]
    np.testing.assert_array_equal(data.labelled, ~np.isnan(margin))
    np.testing.assert_array_equal(data.feasible, np.nan_to_num(margin, nan=-1.0) >= 0)
    flyable = int(np.argmax(data.feasible))
    dry = dict(data.columns)
    dry["status"] = dry["status"].copy()
    dry["status"][flyable] = Status.BELOW_DRY_MASS
    assert not Dataset(dry, data.metadata).feasible[flyable]
    np.testing.assert_array_equal(Dataset(dry, data.metadata).flyable, data.feasible)


def test_a_convergence_label_is_the_solvers_status():
    data = dataset(300, label="convergence")
    assert data.labelled.all()
    np.testing.assert_array_equal(data.feasible, data.columns["status"] == Status.CONVERGED)
    np.testing.assert_array_equal(data.flyable, data.feasible)


@settings(deadline=None, max_examples=60)
@given(
    n=st.integers(0, 400),
    seed=st.integers(0, 1000),
    cuts=st.lists(st.floats(0.05, 1.0), min_size=1, max_size=4),
)
def test_no_unordered_pair_is_in_two_splits_and_no_row_is_lost(n, seed, cuts):
    data = dataset(n, seed)
    fractions = np.array(cuts) / sum(cuts)
    parts = split_by_pair(data, fractions.tolist(), np.random.default_rng(seed))
    assert len(parts) == len(fractions)
    pairs = [
        {frozenset(pair) for pair in zip(p.columns["dep_id"], p.columns["arr_id"], strict=True)}
        for p in parts
    ]
    for one in range(len(parts)):
        for other in range(one):
            assert not pairs[one] & pairs[other]
    times = np.concatenate([part.columns["tof_days"] for part in parts])
    np.testing.assert_array_equal(np.sort(times), np.sort(data.columns["tof_days"]))
    if n > 200:
        # At most the rows of one pair, some 6 of 400, are on the wrong side of a bound.
        shares = np.array([len(part) for part in parts]) / n
        assert np.abs(shares - fractions).max() < 0.05


def test_splits_depend_on_the_generator_alone():
    data = dataset(200)
    first = split_by_pair(data, [0.5, 0.5], np.random.default_rng(1))[0]
    again = split_by_pair(data, [0.5, 0.5], np.random.default_rng(1))[0]
    other = split_by_pair(data, [0.5, 0.5], np.random.default_rng(2))[0]
    np.testing.assert_array_equal(first.columns["tof_days"], again.columns["tof_days"])
    assert not np.array_equal(first.columns["dep_id"], other.columns["dep_id"])


@pytest.mark.parametrize("fractions", [[0.5, 0.6], [1.2, -0.2], [], [1.0, 0.0]])
def test_fractions_that_are_none_are_refused(fractions):
    with pytest.raises(InputError, match="split fractions"):
        split_by_pair(dataset(10), fractions, np.random.default_rng(0))


def test_boundary_draws_are_near_m_star_or_keep_their_mass():
    protocol = read_protocol("general")
    rng = np.random.default_rng(4)
    draw = protocol.sampler.draw(500, rng, BELT, None, protocol.impulsive_grid)
    m_star = draw.legs.m0 * np.exp(3 * rng.standard_normal(500))
    m_star[:50] = np.nan
    chosen = rng.uniform(size=500) < 0.6
    log_ratio = 0.05 * rng.standard_normal(500)
    legs, redrawn = _at_boundary(draw, m_star, chosen, log_ratio)
    assert redrawn.sum() > 100
    assert not redrawn[~chosen].any()
    assert not redrawn[:50].any()
    np.testing.assert_allclose(np.log(legs.m0 / m_star)[redrawn], log_ratio[redrawn], atol=1e-12)
    np.testing.assert_array_equal(legs.m0[~redrawn], draw.legs.m0[~redrawn])
    acceleration = legs.thrust / legs.m0
    assert ((acceleration >= 1e-5 * (1 - 1e-9)) & (acceleration <= 1e-3 * (1 + 1e-9))).all()
    lighter = redrawn & (legs.m0 < draw.legs.m_dry)
    assert lighter.any()
    np.testing.assert_allclose(
        (legs.m_dry / legs.m0)[lighter], (draw.legs.m_dry / draw.legs.m0)[lighter]
    )


def test_inspect_counts_and_draws(tmp_path):
    write(tmp_path, [400])
    data = read_dataset(tmp_path)
    text = inspect_dataset(tmp_path)
    feasible = int(data.feasible.sum())
    assert f"feasible{feasible:>34}" in text
    assert (tmp_path / "margin.png").read_bytes().startswith(b"\x89PNG")
    shown = sum(int(line.split()[3]) for line in text.splitlines() if " to " in line[:12])
    assert shown == data.labelled.sum()


def test_inspect_says_in_one_line_what_it_cannot_read(tmp_path, capsys):
    assert main(["inspect", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("feasibility: ")
    assert error.count("\n") == 1


def test_a_dataset_of_before_free_ends_is_read_with_zeros(tmp_path, monkeypatch):
    import feasibility.dataset.storage as storage

    with monkeypatch.context() as old:
        old.setattr(storage, "COLUMNS", COLUMNS[:-2])
        write(tmp_path, [20])
    data = read_dataset(tmp_path)
    assert len(data) == 20
    assert not data.legs.free_ends.any()


def test_a_leg_without_a_largest_mass_is_labelled_and_flyable():
    data = dataset(20)
    columns_ = {
        **data.columns,
        "log_margin": np.full(20, np.inf),
        "m_star_kg": np.full(20, np.inf),
    }
    endless = Dataset(columns_, data.metadata)
    assert endless.labelled.all()
    assert endless.flyable.all()
    with pytest.raises(InputError, match="legs of protocol search have free ends"):
        endless.check_rendezvous("model")

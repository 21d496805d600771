"""The 103 features of Table 2: what they are called and what they say."""

import numpy as np
import pytest

from feasibility import InputError, Legs
from feasibility.classifier.paper.features import (
    FEATURES,
    NO_ARC_DELTA_V,
    body_features,
    impulsive_time_of_flight,
    paper_features,
)
from feasibility.classifier.paper.standardise import Standardiser
from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.orbits.kepler_kernels import propagate_batch
from tests.helpers.labelled import labelled_dataset


@pytest.fixture(scope="module")
def legs():
    return labelled_dataset().legs.take(np.arange(50))


@pytest.fixture(scope="module")
def columns(legs):
    features = paper_features(legs)
    assert features.shape == (50, 103)
    return {feature.name: features[:, j] for j, feature in enumerate(FEATURES)}


def test_there_are_103_features_with_distinct_names_in_the_groups_of_table_2():
    assert len(FEATURES) == len({feature.name for feature in FEATURES}) == 103
    sizes: dict[str, int] = {}
    for feature in FEATURES:
        sizes[feature.group] = sizes.get(feature.group, 0) + 1
    assert sorted(sizes.values()) == sorted([1, 1, 1, 1, 3, 3, 3, 18, 18, 18, 18, 18])


def test_all_features_are_finite(columns):
    assert all(np.isfinite(column).all() for column in columns.values())


@pytest.mark.parametrize("end", ["dep", "arr"])
def test_the_descriptions_of_one_body_agree(columns, end):
    def of(name):
        return columns[f"{end}_{name}"]

    assert np.allclose(of("energy"), -MU_SUN / (2 * of("a")))
    assert np.allclose(of("momentum") ** 2, MU_SUN * of("p"))
    assert np.allclose(np.hypot(of("f"), of("g")), of("e"))
    assert np.allclose(np.hypot(of("h"), of("k")), np.tan(of("i") / 2))
    radius, longitude, latitude = (
        of(f"spherical_{part}") for part in ("radius", "longitude", "latitude")
    )
    assert np.allclose(radius * np.cos(latitude) * np.cos(longitude), of("x"))
    assert np.allclose(radius * np.sin(latitude), of("cylindrical_z"))
    assert np.allclose(of("cylindrical_radius") * np.sin(of("cylindrical_longitude")), of("y"))
    speed2 = of("vx") ** 2 + of("vy") ** 2 + of("vz") ** 2
    for frame in (
        ("spherical_v_radial", "spherical_v_longitude", "spherical_v_latitude"),
        ("cylindrical_v_radial", "cylindrical_v_longitude", "cylindrical_vz"),
    ):
        assert np.allclose(sum(of(name) ** 2 for name in frame), speed2)


def test_radial_velocity_is_the_derivative_of_the_radius(legs):
    state = legs.rv_dep[:1]
    moved = state.copy()
    moved[:, :3] += state[:, 3:]
    names = [feature.name for feature in FEATURES[2:35]]
    row = names.index("dep_spherical_radius")
    rate = body_features(moved)[0, row] - body_features(state)[0, row]
    assert rate == pytest.approx(
        body_features(state)[0, names.index("dep_spherical_v_radial")], rel=1e-4
    )


def test_differences_are_departure_minus_arrival(columns):
    for name in ("a", "p", "x", "spherical_longitude", "energy"):
        assert np.array_equal(
            columns[f"diff_{name}"], columns[f"dep_{name}"] - columns[f"arr_{name}"]
        )


def test_given_and_computed_columns_agree_with_the_dataset():
    dataset = labelled_dataset().take(np.arange(40))
    stored = paper_features(
        dataset.legs,
        dt_imp_days=dataset.columns["dt_imp_days"],
        lambert_dv=dataset.columns["lambert_dv_m_s"],
    )
    assert np.allclose(paper_features(dataset.legs), stored, rtol=1e-9)


def test_the_impulsive_time_of_flight_does_not_depend_on_the_mass(legs):
    heavier = legs.with_m0(2.0 * legs.m0)
    assert np.array_equal(impulsive_time_of_flight(legs), impulsive_time_of_flight(heavier))


def test_the_impulsive_time_of_flight_is_the_same_for_every_flight_time_of_a_pair():
    legs = labelled_dataset().legs.take(np.zeros(4, dtype=int))
    days = np.array([100.0, 200.0, 300.0, 400.0])
    without = impulsive_time_of_flight(legs)
    assert len(set(without.tolist())) == 1
    # The same body at other arrival epochs: each leg alone, and all together.
    moved = propagate_batch(legs.rv_arr.copy(), (days - legs.tof_days) * DAY_S, MU_SUN)
    several = Legs(legs.rv_dep, moved, days, 1500.0, 0.236, 4190.0, 1000.0, arr_id=legs.arr_id)
    assert np.array_equal(impulsive_time_of_flight(several), without)
    alone = [impulsive_time_of_flight(several.take([row]))[0] for row in range(4)]
    assert alone == without.tolist()


def test_missing_impulsive_times_alone_are_computed(legs):
    given = np.full(50, 123.0)
    given[7] = np.nan
    column = paper_features(legs, dt_imp_days=given)[:, -2]
    assert column[7] == impulsive_time_of_flight(legs.take([7]))[0]
    assert (np.delete(column, 7) == 123.0).all()


def test_no_lambert_arc_is_a_large_finite_cost(legs):
    delta_v = np.full(50, 1e4)
    delta_v[:2] = np.nan, np.inf
    column = paper_features(legs, dt_imp_days=np.full(50, 99.0), lambert_dv=delta_v)[:, -1]
    assert (column[:2] == NO_ARC_DELTA_V).all()
    assert (column[2:] == 1e4).all()


def test_an_unbound_body_is_refused_in_one_line():
    fast = [2 * AU, 0, 0, 0, 4e4, 0]
    legs = Legs(fast, [0, 2 * AU, 0, -2e4, 0, 0], 300.0, 1000.0, 0.2, 4000.0, 500.0)
    with pytest.raises(InputError, match="ellipse"):
        paper_features(legs)


def test_a_column_of_the_wrong_length_is_refused(legs):
    with pytest.raises(InputError, match="dt_imp_days"):
        paper_features(legs, dt_imp_days=[1.0, 2.0])


def test_standardised_training_features_have_mean_0_and_deviation_1():
    X = np.random.default_rng(0).normal([1e11, 3.0], [1e9, 0.1], (500, 2))
    X = np.column_stack([X, np.full(500, 1e8 / 3)])
    Z = Standardiser.fit(X).transform(X)
    assert np.allclose(Z.mean(axis=0), 0.0, atol=1e-9)
    assert np.allclose(Z.std(axis=0), [1.0, 1.0, 0.0])

"""The synthetic main belt has the structure of the real one.

The fixed bounds stand for the real belt: mean e 0.14 to 0.15 and mean i 9.2 to
9.5 degrees in the tables of GTOC7 and GTOC11.
"""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from feasibility.constants import AU
from feasibility.errors import InputError
from feasibility.orbits import (
    OrbitalNeighbours,
    orbital_metric,
    read_catalogue,
    synthetic_main_belt,
)

N = 16_256


@pytest.fixture(scope="module")
def belt():
    return synthetic_main_belt(N, np.random.default_rng(0))


def a_au(catalogue):
    return catalogue.elements[:, 0] / AU


def neighbour_distance(catalogue, nth):
    """Median distance to the nth neighbour in the orbital metric, m/s."""
    rows = np.arange(0, len(catalogue), len(catalogue) // 500)
    epoch = 6000.0  # a multiple of the bucket: the distance is the query's own
    near = OrbitalNeighbours(catalogue).query(rows, epoch, nth)[:, -1]
    points = orbital_metric(catalogue.states(epoch), 180.0)
    return np.median(np.linalg.norm(points[near] - points[rows], axis=1))


def test_the_same_seed_gives_the_same_belt_and_another_seed_another():
    first, again, other = (synthetic_main_belt(200, np.random.default_rng(s)) for s in (4, 4, 5))
    assert_array_equal(first.elements, again.elements)
    assert first.names == again.names
    assert not np.array_equal(first.elements, other.elements)


def test_ids_names_and_epoch_are_as_documented():
    belt = synthetic_main_belt(3, np.random.default_rng(0))
    assert_array_equal(belt.ids, [1, 2, 3])
    assert belt.names == ("S00001", "S00002", "S00003")
    assert np.all(belt.epoch_mjd2000 == 56800 - 51544)


def test_every_orbit_is_one_of_the_main_belt(belt):
    a, e, i = a_au(belt), belt.elements[:, 1], belt.elements[:, 2]
    assert len(belt) == N
    assert a.min() >= 1.8
    assert a.max() <= 3.6
    assert (a * (1 - e)).min() > 1.666
    assert (a * (1 + e)).max() < 4.6
    assert np.degrees(i).max() < 35.0


def test_mean_eccentricity_and_inclination_are_those_of_the_real_belt(belt):
    assert 0.13 < belt.elements[:, 1].mean() < 0.155
    assert 0.055 < belt.elements[:, 1].std() < 0.08
    assert 8.5 < np.degrees(belt.elements[:, 2]).mean() < 10.0
    assert 5.0 < np.degrees(belt.elements[:, 2]).std() < 6.5


@pytest.mark.parametrize(
    ("resonance_au", "depth"),
    [(2.065, 0.35), (2.502, 0.2), (2.825, 0.35), (2.958, 0.6), (3.279, 0.2)],
)
def test_there_is_a_kirkwood_gap(belt, resonance_au, depth):
    """Count within 0.01 AU against both shoulders, 0.04 to 0.08 AU away (real: 0.01 to 0.9)."""
    offset = np.abs(a_au(belt) - resonance_au)
    inside = np.count_nonzero(offset < 0.01) / 0.02
    shoulders = np.count_nonzero((offset > 0.04) & (offset < 0.08)) / 0.08
    assert inside < depth * shoulders


def test_angles_are_uniform(belt):
    for column in (3, 4, 5):
        angle = belt.elements[:, column]
        assert angle.min() >= 0.0
        assert angle.max() < 2 * np.pi
        # The resultant of N random unit vectors is about sqrt(N); 4 sqrt(N) is a 1e-7 event.
        assert abs(np.exp(1j * angle).sum()) < 4.0 * np.sqrt(N)


def test_families_make_clusters(belt):
    """Koronis, narrow in i at 2.88 AU, stands out of the smooth background several times."""
    near = np.abs(a_au(belt) - 2.88) < 0.03
    i = np.degrees(belt.elements[near, 2])
    family = np.count_nonzero(np.abs(i - 2.1) < 1.0)
    beside = np.count_nonzero(np.abs(i - 6.1) < 1.0)
    assert family > 2 * beside


def test_a_number_out_of_range_is_refused():
    for n in (0, -1, 10_000_001):
        with pytest.raises(InputError, match="expected 1 to 10 million"):
            synthetic_main_belt(n, np.random.default_rng(0))


def test_the_smallest_belt_has_one_body():
    assert len(synthetic_main_belt(1, np.random.default_rng(0))) == 1


def test_neighbours_are_as_near_as_in_gtoc7(belt, shared):
    real = read_catalogue(shared / "gtoc/official/GTOC7-DATA.txt")
    for nth in (1, 8, 60):
        ratio = neighbour_distance(belt, nth) / neighbour_distance(real, nth)
        assert 0.85 < ratio < 1.15


def test_the_histogram_of_a_resembles_the_real_one(belt, shared):
    """GTOC11's table is the larger and reaches beyond 3 AU, where GTOC7's ends."""
    real = read_catalogue(shared / "gtoc/gtoc11_asteroids.txt")
    edges = [1.8, 2.065, 2.2, 2.3, 2.4, 2.502, 2.6, 2.7, 2.825, 2.958, 3.05, 3.15, 3.279, 3.6]
    ours = np.histogram(a_au(belt), edges)[0] / len(belt)
    theirs = np.histogram(a_au(real), edges)[0] / len(real)
    # Half the sum of the differences: the share of bodies that would have to move.
    assert np.abs(ours - theirs).sum() / 2 < 0.15
    assert np.corrcoef(ours, theirs)[0, 1] > 0.85

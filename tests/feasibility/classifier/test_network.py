"""The nets in numpy: what is between their products, and answers that do not depend on others."""

from itertools import pairwise

import numpy as np
import pytest

from feasibility.classifier.margin import network_kernels
from feasibility.classifier.margin.network import INPUT_LIMIT, MarginNet

EPSILON = np.finfo(np.float32).eps


def net(width, layers=3, inputs=40, seed=0):
    rng = np.random.default_rng(seed)
    sizes = [inputs, *[width] * (layers - 1), 2]
    arrays = {"mean": rng.normal(size=inputs), "std": rng.uniform(0.5, 2.0, inputs)}
    for i, (k, n) in enumerate(pairwise(sizes)):
        arrays[f"weight_{i}"] = rng.normal(size=(n, k)) / np.sqrt(k)
        arrays[f"bias_{i}"] = rng.normal(size=n)
    return arrays | {"unit": np.array(0.02)}


def by_the_book(arrays, X):
    """Return correction and error in double precision."""
    x = np.clip((X - arrays["mean"]) / arrays["std"], -INPUT_LIMIT, INPUT_LIMIT)
    last = sum(name.startswith("weight_") for name in arrays) - 1
    for i in range(last):
        x = x @ arrays[f"weight_{i}"].T + arrays[f"bias_{i}"]
        x /= 1.0 + np.exp(-x)
    x = x @ arrays[f"weight_{last}"].T + arrays[f"bias_{last}"]
    return x[:, 0] * arrays["unit"], np.exp(x[:, 1]) * arrays["unit"]


def test_silu_is_right_to_two_digits_of_single_precision_and_never_overflows():
    x = np.linspace(-79.0, 79.0, 100_001).astype(np.float32)
    want = x.astype(np.float64) / (1.0 + np.exp(-x.astype(np.float64)))
    got = x.reshape(-1, 1).copy()
    network_kernels.add_and_activate(got, np.zeros(1, dtype=np.float32))
    assert np.all(np.abs(got[:, 0] - want) <= 2.0 * EPSILON * np.abs(want))
    far = np.array([[-1e30, -1e4, 1e4, 1e30]], dtype=np.float32)
    network_kernels.add_and_activate(far, np.zeros(4, dtype=np.float32))
    np.testing.assert_allclose(far, [[0.0, 0.0, 1e4, 1e30]], atol=1e-4)


def test_the_bias_belongs_to_the_columns():
    x = np.zeros((3, 2), dtype=np.float32)
    network_kernels.add_and_activate(x, np.array([0.0, 50.0], dtype=np.float32))
    np.testing.assert_array_equal(x, [[0.0, 50.0]] * 3)


@pytest.mark.parametrize("width", [7, 64, 256, 300])
def test_a_net_is_what_its_formula_says(width):
    arrays = net(width)
    X = np.random.default_rng(1).normal(scale=3.0, size=(700, 40))
    for got, want in zip(MarginNet(arrays)(X), by_the_book(arrays, X), strict=True):
        np.testing.assert_allclose(got, want, rtol=3e-5, atol=1e-6)


@pytest.mark.parametrize("width", [7, 64, 128, 256])
@pytest.mark.parametrize("n", [1, 17, 255, 257, 1500])
def test_an_answer_does_not_depend_on_the_other_rows_to_the_last_bit(width, n):
    asked = MarginNet(net(width))
    X = np.random.default_rng(2).normal(size=(3000, 40))
    whole = asked(X)
    for first in (0, 1, 1024, 1400):
        for got, want in zip(asked(X[first : first + n]), whole, strict=True):
            np.testing.assert_array_equal(got, want[first : first + n])


def test_rows_without_numbers_leave_the_others_alone():
    asked = MarginNet(net(64))
    X = np.random.default_rng(3).normal(size=(600, 40))
    whole = asked(X)
    unknown = np.arange(600) % 7 == 0
    holes = np.where(unknown[:, np.newaxis], np.nan, X)
    for got, want in zip(asked(holes), whole, strict=True):
        np.testing.assert_array_equal(got[~unknown], want[~unknown])


def test_no_rows_are_a_batch_too():
    correction, error = MarginNet(net(64))(np.empty((0, 40)))
    assert correction.shape == error.shape == (0,)

"""Indices have the values that their definitions give where these are known."""

import numpy as np
import pytest

from hopperopt import indices, outflow

BATCH = np.array([8, 27, 64]) / 99
DIAMETER = np.repeat([2e-3, 3e-3, 4e-3], 2000)
SIZE_CLASS = np.repeat([0, 1, 2], 2000)


def of_order(exit_time):
    return indices.of_outflow(*outflow.outflow(exit_time, DIAMETER, SIZE_CLASS), BATCH)


def test_a_random_mixture_is_at_its_limit():
    rng = np.random.default_rng(1)
    runs = [of_order(rng.random(6000)) for _ in range(40)]
    mean = {name: np.mean([run[name] for run in runs], axis=0) for name in indices.OF_SIZES}
    np.testing.assert_allclose(mean["lacey_index"], 1, atol=1e-3)
    np.testing.assert_allclose(mean["relative_deviation"], mean["random_deviation"], rtol=0.07)
    # 100 spheres of each size in a window, half of them at both ends.
    closed = np.sqrt(((1 - BATCH[0]) ** 2 + BATCH[1] ** 2 + BATCH[2] ** 2) / 100 * (19 + 2 * 2) / 21)
    assert mean["random_deviation"][0] == pytest.approx(closed, rel=0.01)
    for name in ("U_without_end", "U_by_mass"):
        assert np.all(np.abs(mean[name]) < 0.2 * (mean["random_deviation"] * BATCH) ** 2)


def test_separated_sizes_have_an_index_of_nought():
    """One size in each of 21 windows; S^2 over 20 degrees of freedom is a twentieth above S_0^2."""
    curve = np.repeat(np.eye(3), [5, 6, 10], axis=1)
    found = indices.of_outflow(curve, np.zeros_like(curve), np.array([5, 6, 10]) / 21)
    np.testing.assert_allclose(found["lacey_index"], -1 / 20)
    np.testing.assert_allclose(found["largest_deviation"], [16 / 21, 15 / 21, 11 / 21])


def test_a_spike_at_the_end_counts_by_its_window():
    curve = np.repeat(BATCH[:, None], 21, axis=1)
    curve[0, -1] += 0.2
    curve[2, -1] -= 0.2
    found = indices.of_outflow(curve, np.zeros_like(curve), BATCH)
    np.testing.assert_allclose(found["U_without_end"], 0, atol=1e-15)
    np.testing.assert_allclose(found["U_by_mass"], np.array([1, 0, 1]) * 0.2**2 / 40, atol=1e-15)
    np.testing.assert_allclose(found["largest_deviation"], [0.2, 0, 0.2], atol=1e-15)
    assert found["relative_deviation"][0] == pytest.approx(0.2 / np.sqrt(21) / BATCH[0])
    noisy = indices.of_outflow(curve, np.full_like(curve, 1e-4), BATCH)
    np.testing.assert_allclose(noisy["U_by_mass"], found["U_by_mass"] - 1e-4)


def test_residence_order_is_one_for_first_in_first_out():
    height = np.random.default_rng(2).random(50)
    position = np.column_stack([1 - height, height[::-1], height])
    exit_time = np.exp(height)  # in another scale, of which ranks know nothing
    assert indices.residence_order(exit_time, position) == pytest.approx(1)
    assert indices.residence_order(-exit_time, position) == pytest.approx(-1)
    exit_time[np.argmin(height)] = np.nan  # the first one stayed
    assert indices.residence_order(exit_time, position) == pytest.approx(1)
    assert np.isnan(indices.residence_order(exit_time * np.nan, position))


@pytest.mark.filterwarnings("error")
def test_order_needs_two_heights_and_two_times():
    heights = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, 0.2]])
    assert np.isnan(indices.residence_order(np.array([0.5, 0.5]), heights))
    assert np.isnan(indices.residence_order(np.array([0.5, 0.6]), heights[[0, 0]]))
    assert np.isnan(indices.residence_order(np.array([0.5, np.nan]), heights))

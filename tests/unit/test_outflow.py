"""Window sums of the outflow are exact; its noise formula and corrected objective hold in a Monte Carlo."""

import numpy as np
import pytest

from hopperopt import outflow as flow

DIAMETERS = np.array([2e-3, 3e-3, 4e-3])
TARGET = np.array([8, 27, 64]) / 99


def batch(count, rng, order=None):
    """Equal numbers of three sizes; exit times in random order, or in the order of the given keys."""
    size_class = np.repeat([0, 1, 2], count).astype(np.int8)
    keys = rng.random(3 * count) if order is None else order(size_class, rng)
    return keys, DIAMETERS[size_class], size_class


@pytest.mark.parametrize("count", [1, 20, 5000])
def test_window_sums_are_the_batch(count):
    rng = np.random.default_rng(1)
    times, diameter, size_class = batch(count, rng, lambda k, rng: rng.random(k.size) ** (1 + k))
    result = flow.outflow(times, diameter, size_class)
    sums = (result.mass_fraction * np.diff(flow.EDGES)).sum(axis=1)
    np.testing.assert_allclose(sums, TARGET, rtol=1e-12)
    np.testing.assert_allclose(result.mass_fraction.sum(axis=0), 1, rtol=1e-9)
    np.testing.assert_allclose(flow.batch_fractions(diameter, size_class), TARGET, rtol=1e-12)


def test_windows_are_centred_on_the_grid_and_cut_at_the_ends():
    lower, upper = flow.EDGES[:-1], flow.EDGES[1:]
    np.testing.assert_allclose(lower, np.clip(flow.GRID - 0.025, 0, 1), atol=1e-15)
    np.testing.assert_allclose(upper, np.clip(flow.GRID + 0.025, 0, 1), atol=1e-15)


def test_a_particle_leaves_evenly_over_its_own_interval():
    """Fine, then coarse: with masses 8 and 64 the fine one covers M from 0 to 1/9, its edge cuts a window."""
    result = flow.outflow(np.array([1.0, 2.0]), DIAMETERS[[0, 2]], np.array([0, 2]))
    expected = np.zeros(21)
    expected[:2] = 1
    expected[2] = (1 / 9 - 0.075) / 0.05
    np.testing.assert_allclose(result.mass_fraction[0], expected, atol=1e-12)
    np.testing.assert_allclose(result.mass_fraction[2], 1 - expected, atol=1e-12)


def test_what_stays_inside_counts_neither_in_M_nor_in_the_fractions():
    rng = np.random.default_rng(2)
    times, diameter, size_class = batch(50, rng)
    times[[0, 149]] = np.nan
    kept = np.isfinite(times)
    full = flow.outflow(times, diameter, size_class)
    alone = flow.outflow(times[kept], diameter[kept], size_class[kept])
    np.testing.assert_allclose(full.mass_fraction, alone.mass_fraction, rtol=1e-12)
    assert np.isnan(flow.outflow(np.full(150, np.nan), diameter, size_class).mass_fraction).all()


def test_pure_segregation_has_no_noise_inside_a_class():
    times, diameter, size_class = batch(
        1000, np.random.default_rng(3), lambda k, rng: k + 0.5 * rng.random(k.size)
    )
    result = flow.outflow(times, diameter, size_class)
    np.testing.assert_allclose(result.mass_fraction[0, :2], 1, rtol=1e-12)
    assert result.counting_variance[:, 0] == pytest.approx(0, abs=1e-20)


@pytest.fixture(scope="module")
def campaigns():
    """Well mixed outflow, 400 runs: classes drawn at random for each particle (multinomial)."""
    rng = np.random.default_rng(4)
    results = []
    for _ in range(400):
        size_class = rng.integers(0, 3, 3000)
        results.append(flow.outflow(np.arange(3000.0), DIAMETERS[size_class], size_class))
    return flow.Outflow(*map(np.stack, zip(*results, strict=True)))


def test_counting_variance_is_the_scatter_of_a_multinomial(campaigns):
    """Mean formula against the scatter between runs: 400 runs know a variance to 7 %, 21 windows to 1.6 %.

    The window is one of mass, not of count, and holds whole numbers of particles only on average; hence 5 %.
    """
    ratio = campaigns.mass_fraction.var(axis=0, ddof=1).mean(axis=1) / campaigns.counting_variance.mean(
        (0, 2)
    )
    np.testing.assert_allclose(ratio, 1, atol=0.05)


def test_corrected_objective_is_unbiased_where_the_raw_one_is_not(campaigns):
    """A well mixed outflow has J = 0: U scatters around zero, raw J is the counting floor."""
    square = flow.corrected_square(campaigns.mass_fraction, TARGET, campaigns.counting_variance)
    error = square.std(axis=0, ddof=1) / np.sqrt(len(square))
    floor = np.sqrt(campaigns.counting_variance.mean(axis=-1))
    assert (np.abs(square.mean(axis=0)) < 3 * error + 0.02 * (floor**2).mean(axis=0)).all()
    assert (square < 0).any(), "negative values must not be cut off"
    np.testing.assert_allclose(
        flow.objective(campaigns.mass_fraction, TARGET).mean(axis=0), floor.mean(axis=0), rtol=0.05
    )


def test_noise_of_a_full_size_run_is_that_of_the_study():
    """15,000 well mixed particles: 0.0065 and 0.0177 rms in m_f and m_i."""
    times, diameter, size_class = batch(5000, np.random.default_rng(5))
    floor = np.sqrt(flow.outflow(times, diameter, size_class).counting_variance.mean(axis=-1))
    np.testing.assert_allclose(floor[:2], [0.0065, 0.0177], rtol=0.06)


def test_objective_and_its_printed_root():
    curve = np.array([[0.1] * 20 + [0.31], [0.3] * 21])
    np.testing.assert_allclose(flow.objective(curve, np.array([0.1, 0.27])), [0.21 / np.sqrt(21), 0.03])
    np.testing.assert_allclose(flow.signed_root(np.array([4e-4, -9e-4, 0.0])), [0.02, -0.03, 0])

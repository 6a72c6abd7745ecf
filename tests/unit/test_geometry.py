"""Profiles: exact volumes, shortest gaps, and faults of a profile."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hopperopt import geometry

PI = np.pi
HOPPER = geometry.hopper(0.0225, 45, 0.05, 0.2)


def frustum(r1, r2, height):
    """Volume between two circles."""
    return PI * height / 3 * (r1 * r1 + r1 * r2 + r2 * r2)


def points(profile, count=2000):
    """Points spread along a profile."""
    share = np.linspace(0, 1, count)[:, None]
    return np.concatenate([a + share * (b - a) for a, b in pairwise(profile)])


@pytest.mark.parametrize(
    ("level", "volume"),
    [
        (0.01, frustum(0.0225, 0.0325, 0.01)),
        (0.0275, frustum(0.0225, 0.05, 0.0275)),
        (0.074, frustum(0.0225, 0.05, 0.0275) + PI * 0.05**2 * 0.0465),
    ],
)
def test_volume_of_the_hopper_below_a_level(level, volume):
    assert geometry.volume_inside(HOPPER, level) == pytest.approx(volume, rel=1e-12)


def test_volume_of_a_flat_bottom():
    vessel = geometry.hopper(0.01, 90, 0.05, 0.2)
    assert geometry.volume_inside(vessel, 0.1) == pytest.approx(PI * 0.05**2 * 0.1, rel=1e-12)


def test_volume_of_a_cone_below_a_level():
    base, height = 0.04 * np.cos(np.radians(55)), 0.04 * np.sin(np.radians(55))
    insert = geometry.raised(geometry.cone(55, 0.04), 0.03)
    whole = frustum(base, 0, height)
    assert geometry.solid_volume(insert, 1) == pytest.approx(whole, rel=1e-9)
    assert geometry.solid_volume(insert, 0.03) == 0
    level = 0.03 + height / 3
    assert geometry.solid_volume(insert, level) == pytest.approx(whole * (1 - (2 / 3) ** 3), rel=1e-9)
    assert geometry.solid_volume(insert[::-1], level) == geometry.solid_volume(insert, level)


def test_volume_of_a_ring_is_pappus_and_of_a_shell_nothing():
    ring = np.array([[0.02, 0], [0.03, 0], [0.03, 0.01], [0.02, 0.01], [0.02, 0]])
    assert geometry.solid_volume(ring, 1) == pytest.approx(2 * PI * 0.025 * 1e-4, rel=1e-12)
    assert geometry.solid_volume(ring, 0.004) == pytest.approx(2 * PI * 0.025 * 0.4e-4, rel=1e-12)
    assert geometry.solid_volume(ring[:-1], 1) == 0


def test_particles_that_fill_a_volume():
    diameters = [0.002, 0.003, 0.004]
    spheres = PI / 6 * (8 + 27 + 64) * 1e-9
    assert geometry.particle_count(0.5, 2 * 100 * spheres, diameters) == 300
    assert geometry.particle_count(0.55, 0.000484182, diameters) % 3 == 0
    assert geometry.particle_count(0.55, 1e-12, diameters) == 3


lines = st.lists(
    st.tuples(st.integers(0, 20), st.integers(-20, 20)), min_size=2, max_size=5, unique=True
).map(lambda corners: np.array(corners, float))


@settings(deadline=None)
@given(lines, lines)
def test_gap_is_that_of_dense_points(first, second):
    gap = geometry.gap(first, second)
    assert gap == geometry.gap(second, first)
    a, b = points(first, 200), points(second, 200)
    brute = np.sqrt(((a[:, None] - b[None]) ** 2).sum(axis=2).min())
    spacing = 2 * 45 / 199  # longest segment over its points
    assert gap - 1e-9 <= brute <= gap + spacing


def test_gap_of_the_tightest_design_is_its_distance_from_the_cone():
    insert = geometry.raised(geometry.cone(50, 0.05), 0.026)
    base = 0.05 * np.cos(np.radians(50))
    assert geometry.gap(insert, HOPPER) == pytest.approx((0.0225 + 0.026 - base) / np.sqrt(2), rel=1e-9)
    assert geometry.gap(insert, HOPPER) / 0.004 == pytest.approx(2.89, abs=0.005)


def test_gap_in_the_meridian_plane_is_the_gap_in_space():
    insert = geometry.raised(geometry.cone(50, 0.05), 0.026)
    angle = np.linspace(0, 2 * PI, 73)[:, None, None]
    a, b = points(insert, 60), points(HOPPER, 120)
    turned = np.stack([b[:, 0] * np.cos(angle[..., 0]), b[:, 0] * np.sin(angle[..., 0])], axis=-1)
    in_plane = np.concatenate([turned, np.broadcast_to(b[:, 1:], (*turned.shape[:2], 1))], axis=-1)
    apart = in_plane.reshape(-1, 1, 3) - np.column_stack([a[:, 0], 0 * a[:, 0], a[:, 1]])
    shortest = np.sqrt((apart**2).sum(axis=2).min())
    assert shortest == pytest.approx(geometry.gap(insert, HOPPER), abs=2e-3)
    assert shortest >= geometry.gap(insert, HOPPER) - 1e-12


def test_gap_is_none_where_profiles_cross():
    assert geometry.gap(geometry.raised(geometry.cone(50, 0.09), 0.026), HOPPER) == 0
    cross = np.array([[0.0, 0.0], [2.0, 2.0]]), np.array([[0.0, 2.0], [2.0, 0.0]])
    assert geometry.gap(*cross) == 0
    in_line = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[3.0, 0.0], [5.0, 0.0]])
    assert geometry.gap(*in_line) == 2


@pytest.mark.parametrize(
    ("profile", "itself"),
    [
        ([[0, 0], [2, 0], [0, 3]], False),
        ([[2, 0], [3, 0], [3, 1], [2, 1], [2, 0]], False),
        ([[0, 0], [2, 2], [2, 0], [0, 2]], True),
        ([[0, 0], [4, 0], [2, 0]], True),
        ([[0, 0], [4, 0], [4, 0], [0, 2]], True),
        ([[0, 0], [4, 0], [4, 2], [2, 0]], True),
        ([[1, 0], [4, 0], [4, 2], [2, 2], [2, -1]], True),
    ],
)
def test_profile_that_crosses_itself(profile, itself):
    assert geometry.crosses_itself(np.array(profile, float)) == itself


@pytest.mark.parametrize(
    ("profile", "axis"),
    [
        ([[0, 0], [2, 0], [0, 3]], False),
        ([[1, 0], [2, 0]], False),
        ([[0, 0], [-1, 2], [0, 3]], True),
        ([[0, 0], [2, 1], [0, 2], [2, 3]], True),
    ],
)
def test_profile_that_crosses_the_axis(profile, axis):
    assert geometry.crosses_axis(np.array(profile, float)) == axis


@pytest.mark.parametrize(
    ("profile", "radius"),
    [
        (geometry.hopper(0.0225, 45, 0.05, 0.2), 0.0225),
        (geometry.hopper(0.01, 90, 0.05, 0.2), 0.01),  # a flat bottom's rim
        (geometry.gate(0.02), np.inf),
        (geometry.cone(55, 0.04), np.inf),
        (geometry.cone(55, 0.04)[::-1], np.inf),
        (np.array([[0, 1], [2, 0], [0, 3.0]]), 0),  # hollow from below
        (np.array([[2, 0], [3, 0], [3, 1], [2, 1], [2, 0.0]]), 2),  # a ring, from inside
        (np.array([[1, 0], [2, 1.0]]), 1),  # a shell shows both faces
        (np.array([[0, 0], [3, 0], [3, 1], [1, 1.0]]), 1),  # a lid with a hole
        (np.array([[1, 1], [3, 1], [3, 0], [0, 0.0]]), 1),
        (np.array([[0, 1], [1, 1], [3, 0.0]]), 1),
    ],
)
def test_smallest_circle_seen_from_inside(profile, radius):
    assert geometry.inner_radius(profile) == radius


@pytest.mark.parametrize(
    ("profile", "angle"),
    [
        (geometry.cone(16, 0.04), 16),
        (geometry.cone(16, 0.04)[::-1], 16),
        (geometry.double_cone(10, 15, 0.04), 25),
        (geometry.bullet(0.02, 0.01, 55), 90),
        (np.array([[2, 0], [3, 0], [3, 1], [2, 0.0]]), 45),  # a ring; its first corner and its last
        (np.array([[3, 0], [3, 1], [2, 0], [3, 0.0]]), 45),
        (np.array([[0, 0], [2, 0], [1, 1], [2, 2], [0, 2.0]]), 45),  # re-entrant between two sharp edges
        (np.array([[0, 0], [2, 1.0]]), np.inf),  # a shell
    ],
)
def test_sharpest_edge_of_a_solid(profile, angle):
    assert geometry.sharpest_edge(profile) == pytest.approx(angle)


def test_insert_beyond_the_wall_is_not_inside():
    ring = np.array([[0.06, 0.1], [0.07, 0.1], [0.07, 0.11], [0.06, 0.1]])
    assert geometry.gap(ring, HOPPER) == pytest.approx(0.01)
    assert not geometry.stays_inside(ring, HOPPER)
    assert not geometry.stays_inside(geometry.raised(geometry.cone(55, 0.01), -0.02), HOPPER)
    assert geometry.stays_inside(geometry.raised(geometry.cone(55, 0.01), 0.02), HOPPER)

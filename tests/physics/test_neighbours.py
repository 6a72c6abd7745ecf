"""The neighbour list: every touching pair is in it, no history is lost, results do not depend on it."""

import copy

import numpy as np
import pytest

from hopperopt.dem.neighbours import CELLS_PER_SPHERE, make_grid
from hopperopt.dem.state import (
    PAIR_CARRIED,
    REBUILDS,
    STALE,
    TOUCH_CARRIED,
    make_pairs,
    make_spheres,
    make_touches,
)

SIZES = np.array([0.001, 0.0015, 0.002])
CAN = {"can": [[0.0, 0.0], [0.016, 0.0], [0.016, 0.5]]}
COUNT = 300


@pytest.fixture
def shaken(simulate):
    """300 spheres of three sizes stirred in a small can: some resting, some fast, some flying off."""

    def make():
        rng = np.random.default_rng(21)
        grid = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 2, np.arange(12)), axis=-1).reshape(-1, 3) * 0.0042
        grid = grid[np.hypot(grid[:, 0], grid[:, 1]) < 0.0135]
        position = grid[np.argsort(grid[:, 2], kind="stable")][:COUNT]
        position[:, 2] += 0.0025
        position += rng.uniform(-1e-4, 1e-4, position.shape)
        radius = rng.choice(SIZES, COUNT)
        velocity = rng.normal(0.0, 0.3, position.shape) * rng.choice([0.1, 1.0, 4.0], (COUNT, 1))
        return simulate(position, radius, velocity, walls=CAN, gravity=9.81)

    return make


def expected_contacts(sim):
    """All pairs of identities that overlap, and the identities that overlap the can's side or bottom."""
    x, r = sim.by_identity(sim.spheres.position), sim.by_identity(sim.spheres.radius)
    apart = np.linalg.norm(x[:, None] - x[None, :], axis=2)
    i, j = np.nonzero(np.triu(apart < r[:, None] + r[None, :], k=1))
    side = 0.016 - np.hypot(x[:, 0], x[:, 1]) < r
    return set(zip(i.tolist(), j.tolist(), strict=True)), set(np.flatnonzero(side | (x[:, 2] < r)).tolist())


def test_every_touching_pair_is_in_the_list(shaken, springs):
    """At each of 600 steps of a violent mixture, against all pairs; the lists last several steps."""
    sim = shaken()
    met = set()
    for _ in range(600):
        pairs, touches = expected_contacts(sim)
        sim.advance(1)
        in_touch, at_wall = springs(sim)
        assert set(in_touch) == pairs
        assert {i for i, _ in at_wall} == touches
        met |= pairs
    assert len(met) > 2 * COUNT
    assert 10 < sim.counters[REBUILDS] < 600 / 5


def test_one_sphere_far_away_changes_nothing(shaken, simulate):
    """The grid of the neighbour search spans a runaway as well."""
    sim = shaken()
    x, r = sim.spheres.position.copy(), sim.spheres.radius.copy()
    v = sim.spheres.velocity.copy()
    far = simulate(
        np.vstack([x, [300.0, -200.0, 900.0]]),
        np.append(r, 0.002),
        np.vstack([v, [9.0, 9.0, 9.0]]),
        walls=CAN,
        gravity=9.81,
    )
    for each in (sim, far):
        each.advance(200)
    here = far.by_identity(far.spheres.position)[:-1]
    assert here == pytest.approx(sim.by_identity(sim.spheres.position), abs=1e-12)


def state(sim, springs):
    """All that evolves, by identity."""
    x, v, w = (sim.by_identity(getattr(sim.spheres, name)) for name in ("position", "velocity", "spin"))
    return np.hstack([x, v, w]), *springs(sim)


def assert_same(one, other, tolerance=1e-10):
    """Equal to round-off (relative to 1 mm, 1 m/s, 1000 rad/s, springs of 1 um), springs with their sign."""
    scale = np.repeat([1e-3, 1.0, 1e3], 3)
    assert one[0] / scale == pytest.approx(other[0] / scale, abs=tolerance)
    for mine, others in zip(one[1:], other[1:], strict=True):
        assert mine.keys() == others.keys()
        for key, spring in mine.items():
            assert spring == pytest.approx(others[key], abs=1e-6 * tolerance)


def test_bed_does_not_feel_rebuilds(bed, springs):
    """Lists built at every step (sorted, springs carried) or when worn out: the same, spring by spring.

    The bed is set moving first, so that springs and order change all the time.
    """
    bed.open("gate", -0.012)
    bed.advance(700)
    often, seldom = copy.deepcopy(bed), bed
    begun = bed.counters[REBUILDS]
    for _ in range(60):
        often.counters[STALE] = 1
        often.advance(1)
    seldom.advance(60)
    assert often.counters[REBUILDS] - begun >= 60 > 10 > seldom.counters[REBUILDS] - begun >= 1
    one, other = state(often, springs), state(seldom, springs)
    assert len(one[1]) > 1000 and len(one[2]) > 100
    assert_same(one, other)


def test_a_rebuild_keeps_every_spring(bed, springs):
    """Also of pairs whose order in the list turns round, whose sign turns with it."""
    bed.open("gate", -0.012)
    bed.advance(500)
    bed.settings = bed.settings._replace(time_step=1e-30)  # time stands still from here on
    bed.advance(1)
    before = springs(bed)
    order = bed.spheres.identity[: bed.rows].copy()
    bed.counters[STALE] = 1
    bed.advance(1)
    after = springs(bed)
    flipped = {tuple(sorted(pair)) for pair in _overtaking(order, bed.spheres.identity[: bed.rows])}
    assert flipped & before[0].keys()
    for mine, others in zip(before, after, strict=True):
        assert mine.keys() == others.keys()
        assert all(mine[key] == pytest.approx(others[key], rel=1e-9, abs=1e-18) for key in mine)


def _overtaking(old, new):
    """Pairs of identities whose order differs between two lists."""
    place_old, place_new = np.argsort(old), np.argsort(new)
    known = np.intersect1d(old, new)
    swapped = (place_old[known][:, None] < place_old[known]) & (place_new[known][:, None] > place_new[known])
    return zip(*known[np.array(np.nonzero(swapped))].tolist(), strict=True)


def test_numbering_does_not_matter(bed, simulate, springs):
    """The same spheres given in another order move the same way, spring by spring."""
    x, v, r = (bed.by_identity(getattr(bed.spheres, name)) for name in ("position", "velocity", "radius"))
    walls = {"hopper": [[0.012, 0.0], [0.03, 0.018], [0.03, 0.2]]}  # the bed falls out of it
    order = np.random.default_rng(2).permutation(len(r))
    plain = simulate(x, r, v, walls=walls, gravity=9.81)
    shuffled = simulate(x[order], r[order], v[order], walls=walls, gravity=9.81)
    for sim in (plain, shuffled):
        sim.advance(60)
    values, pairs, touches = state(shuffled, springs)
    back = np.empty_like(values)
    back[order] = values
    pairs = {(int(order[i]), int(order[j])): spring for (i, j), spring in pairs.items()}
    pairs = {(min(i, j), max(i, j)): spring if i < j else -spring for (i, j), spring in pairs.items()}
    touches = {(int(order[i]), name): spring for (i, name), spring in touches.items()}
    assert len(pairs) > 500
    assert_same((back, pairs, touches), state(plain, springs))


@pytest.mark.parametrize("room", [1, 45])
def test_lists_too_small_grow_and_lose_nothing(bed, springs, room):
    """Lists with no room for the next rebuild: they grow in the middle of it, with all springs under way."""
    bed.open("gate", -0.012)
    bed.advance(500)
    plain = copy.deepcopy(bed)
    plain.settings = plain.settings._replace(skin=3.0 * plain.settings.skin)
    bed.settings = plain.settings
    kept = _cut(bed, room)
    for sim in (plain, bed):
        sim.counters[STALE] = 1
        sim.advance(100)
    assert len(bed.pairs.partner) > kept[0]
    assert len(bed.touches.surface) > kept[1] or room > 1
    one, other = state(bed, springs), state(plain, springs)
    assert (one[0] == other[0])[~np.isnan(one[0])].all()
    assert_same(one, other, tolerance=0.0)


def _cut(sim, room):
    """Leave the lists room for `room` entries more than they hold. Returns the two capacities."""
    sizes = [int(entries.start[sim.rows]) + room for entries in (sim.pairs, sim.touches)]
    sim.pairs, sim.touches = (
        type(entries)(*(a if name == "start" else a[:size].copy() for name, a in entries._asdict().items()))
        for entries, size in zip((sim.pairs, sim.touches), sizes, strict=True)
    )
    return sizes


@pytest.mark.parametrize("spare", [0, 1, 2])
def test_list_that_just_fits_holds_every_pair(simulate, spare):
    """Two spheres in touch and a third one near them, with room for hardly more entries than needed."""
    position = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0039], [0.006, 0.0, 0.0039]]
    sim = simulate(position, 0.002)
    sim.pairs = make_pairs(3, 1 + spare)
    sim.touches = make_touches(3, 1)
    sim.advance(1)
    force = sim.by_identity(sim.spheres.force)
    assert force[0, 2] < 0.0 < force[1, 2]
    assert not force[2].any()


@pytest.mark.parametrize("speed", [0.5, 0.02])
def test_history_ends_with_the_contact(simulate, springs, speed):
    """Spheres that rubbed, parted and meet again begin anew, whether they left their list or not."""
    sim = simulate([[0.0, 0.0, 0.0], [0.0, 0.0, 0.00398]], 0.002, [[0.02, 0.0, 0.0], [0.0, 0.0, 0.0]])
    sim.advance(3)
    assert np.linalg.norm(springs(sim)[0][0, 1]) > 1e-7

    def move(speed):
        """Let both fly apart straight (or towards each other)."""
        position = sim.spheres.position
        n = position[0] - position[1]
        sim.spheres.spin[:] = 0.0
        sim.spheres.velocity[:] = 0.5 * speed * np.array([n, -n]) / np.linalg.norm(n)

    move(speed)
    sim.advance(80)
    assert not springs(sim)[0]
    assert len(sim.pairs.partner[: sim.pairs.start[2]]) == (speed < 0.1)
    move(-speed)
    for _ in range(1000):
        sim.advance(1)
        if springs(sim)[0]:
            break
    assert np.linalg.norm(springs(sim)[0][0, 1]) < 1e-12


def test_nothing_is_left_aside_after_a_rebuild(bed):
    """What a rebuild carries is put down before the step that asked for it."""
    bed.counters[STALE] = 1
    bed.advance(1)
    assert (bed.counters[[PAIR_CARRIED, TOUCH_CARRIED]] == -1).all()
    assert sorted(bed.spheres.identity[: bed.rows]) == list(range(1200))


@pytest.mark.parametrize("far", [0.1, 1e3, 1e5, 1e8])
def test_one_sphere_far_away_is_in_a_cell_of_the_grid(far):
    """A run that blows up: however far the sphere, its cell exists, and the cells stay few."""
    count = 200_000
    position = np.random.default_rng(1).uniform(0.0, 0.1, (count, 3))
    position[-1, 0] = far
    spheres = make_spheres(position, np.zeros((count, 3)), np.full(count, 0.001), 1000.0)
    corner, size, cells = make_grid(spheres, count, 0.005)
    assert cells.prod() <= CELLS_PER_SPHERE * count + 4096
    assert (np.floor((position.max(axis=0) - corner) / size) < cells).all()

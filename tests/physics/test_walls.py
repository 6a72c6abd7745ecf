"""Walls of revolution: how many contacts, which way they push, what happens at joints and gates."""

import numpy as np
import pytest

from hopperopt.dem.walls import make_walls

RADIUS = 0.002
DEEP = 1.0e-5  # m, overlap of the spheres placed here
G = 9.81
CONE = {"cone": [[0.0, 0.02], [0.02, 0.02], [0.0, 0.04]]}  # base disc and slope at 45 degrees, apex up
HOPPER = {"hopper": [[0.01, 0.0], [0.03, 0.02], [0.03, 0.08]], "gate": [[0.0, 0.0], [0.01, 0.0]]}


@pytest.fixture
def push(simulate, wall_law):
    """Force (N) of walls on one elastic sphere that is put somewhere at rest."""

    def run(walls, position):
        sim = simulate([position], RADIUS, walls=walls, wall=wall_law(1.0), time_step=1.0e-9)
        sim.advance(1)
        return sim.spheres.force[0]

    return run


@pytest.fixture
def one_contact(wall_law, hertz):
    """Force (N) of one contact that is `deep` m deep."""
    return lambda deep=DEEP: hertz.force(deep, RADIUS, wall_law(1.0).modulus)


def meridian(r, z, angle):
    """Position at radius r and height z, at an angle about the axis (deg)."""
    return [r * np.cos(np.radians(angle)), r * np.sin(np.radians(angle)), z]


@pytest.mark.parametrize(
    "disc",
    [
        {"floor": [[0.0, 0.0], [0.05, 0.0]]},
        {"floor": [[0.05, 0.0], [0.0, 0.0]]},
        {"floor": [[0.0, 0.0], [0.02, 0.0]], "ring": [[0.02, 0.0], [0.05, 0.0]]},
    ],
)
@pytest.mark.parametrize("off", [0.0, 1e-300, 1e-14, 1e-6])
def test_sphere_on_the_axis_of_a_disc_has_one_axial_contact(push, one_contact, disc, off):
    force = push(disc, [off, -off, RADIUS - DEEP])
    assert force == pytest.approx([0.0, 0.0, one_contact()], rel=1e-9, abs=1e-9)


def test_sphere_below_a_disc_is_pushed_down(push, one_contact):
    force = push(CONE, [0.0, 0.0, 0.02 - RADIUS + DEEP])
    assert force == pytest.approx([0.0, 0.0, -one_contact()], rel=1e-9)


@pytest.mark.parametrize("off", [0.0, 1e-300, 1e-14])
def test_sphere_on_the_axis_on_an_apex_has_one_axial_contact(push, one_contact, off):
    force = push(CONE, [off, 0.0, 0.04 + RADIUS - DEEP])
    assert force == pytest.approx([0.0, 0.0, one_contact()], rel=1e-9, abs=1e-9)


def test_sphere_beside_an_apex_is_pushed_away_from_it(push, one_contact):
    """Within the cone of directions that belong to the apex: a contact with a point."""
    tilt = np.radians(20.0)
    away = meridian(np.sin(tilt), np.cos(tilt), 130.0)
    force = push(CONE, np.array([0.0, 0.0, 0.04]) + (RADIUS - DEEP) * np.array(away))
    assert force == pytest.approx(one_contact() * np.array(away), rel=1e-9)


@pytest.mark.parametrize("angle", [0.0, 77.0, 180.0, 301.0])
def test_cone_pushes_along_its_normal_in_the_meridian_plane(push, one_contact, angle):
    """Outside of the insert, inside of the hopper."""
    normal = np.sqrt(0.5)
    on_insert = push(CONE, meridian(0.01 + normal * (RADIUS - DEEP), 0.03 + normal * (RADIUS - DEEP), angle))
    assert on_insert == pytest.approx(one_contact() * np.array(meridian(normal, normal, angle)), rel=1e-9)
    in_hopper = push(
        HOPPER, meridian(0.02 - normal * (RADIUS - DEEP), 0.01 + normal * (RADIUS - DEEP), angle)
    )
    assert in_hopper == pytest.approx(one_contact() * np.array(meridian(-normal, normal, angle)), rel=1e-9)
    in_cylinder = push(HOPPER, meridian(0.03 - RADIUS + DEEP, 0.05, angle))
    assert in_cylinder == pytest.approx(
        one_contact() * np.array(meridian(-1.0, 0.0, angle)), rel=1e-9, abs=1e-9
    )


@pytest.mark.parametrize("direction", [-89.0, -45.0, 0.0, 44.0])
def test_convex_edge_gives_one_contact(push, one_contact, direction):
    """All round the rim of the insert's base (its slope begins at 45 degrees, its base at -90)."""
    away = meridian(np.cos(np.radians(direction)), np.sin(np.radians(direction)), 20.0)
    rim = meridian(0.02, 0.02, 20.0)
    force = push(CONE, np.array(rim) + (RADIUS - DEEP) * np.array(away))
    assert force == pytest.approx(one_contact() * np.array(away), rel=1e-9)


@pytest.mark.parametrize("inward", [1e-6, 0.001])
@pytest.mark.parametrize("turn", [60.0, 120.0, 160.0])
@pytest.mark.parametrize("first", [True, False])
def test_beside_a_convex_edge_only_the_face_is_touched(push, one_contact, inward, turn, first):
    """The edge is nearer than the radius, too, but it is not the closest point."""
    fall = np.radians(turn / 2.0)
    roof = {
        "roof": [
            [0.1 - 0.02 * np.cos(fall), -0.02 * np.sin(fall)],
            [0.1, 0.0],
            [0.1 + 0.02 * np.cos(fall), -0.02 * np.sin(fall)],
        ]
    }
    side = -1.0 if first else 1.0
    normal = np.array([side * np.sin(fall), np.cos(fall)])
    r, z = (
        np.array([0.1, 0.0])
        + inward * np.array([side * np.cos(fall), -np.sin(fall)])
        + (RADIUS - DEEP) * normal
    )
    force = push(roof, meridian(r, z, 0.0))
    assert force[[0, 2]] == pytest.approx(one_contact() * normal, rel=1e-6)


@pytest.mark.parametrize(
    "shape",
    [
        {"floor": [[0.0, 0.0], [0.03, 0.0]], "side": [[0.03, 0.0], [0.03, 0.08]]},
        {"can": [[0.0, 0.0], [0.03, 0.0], [0.03, 0.08]]},
    ],
)
def test_concave_corner_gives_two_contacts(push, one_contact, shape):
    """Each wall with its own depth, whether the corner lies inside a profile or between two."""
    force = push(shape, meridian(0.03 - RADIUS + DEEP, RADIUS - 2.0 * DEEP, 30.0))
    expected = meridian(-one_contact(), one_contact(2.0 * DEEP), 30.0)
    assert force == pytest.approx(expected, rel=1e-9)


def test_free_end_of_a_wall_is_an_edge(push, one_contact):
    """A sphere on the upper rim of the cylinder."""
    force = push(HOPPER, meridian(0.03, 0.08 + RADIUS - DEEP, 200.0))
    assert force == pytest.approx([0.0, 0.0, one_contact()], rel=1e-9, abs=1e-9)


def bend(turn):
    """A ring-shaped trough, or ridge for a negative `turn`: two slopes at that angle (deg) at r = 0.1."""
    fall = np.tan(np.radians(turn / 2.0))
    return {"bend": [[0.05, 0.05 * fall], [0.1, 0.0], [0.15, 0.05 * fall]]}


@pytest.mark.parametrize(
    ("turn", "contacts"), [(2.0, 1), (14.0, 1), (16.0, 2), (40.0, 2), (-14.0, 1), (-40.0, 1)]
)
def test_smooth_joint_gives_one_contact(push, one_contact, turn, contacts):
    """Segments that meet at less than 15 degrees are one wall; a ridge has one contact at any angle."""
    half = np.radians(turn / 2.0)
    height = (RADIUS - DEEP) / np.cos(half) if turn > 0 else RADIUS - DEEP
    force = push(bend(turn), meridian(0.1, height, 0.0))
    upward = contacts * one_contact() * (np.cos(half) if turn > 0 else 1.0)
    if contacts == 1 and turn > 0:  # which of the two equals is not said
        assert np.linalg.norm(force) == pytest.approx(one_contact(), rel=1e-6)
    assert force[2] == pytest.approx(upward, rel=1e-6)


def roll(simulate, wall_law, walls):
    """Positions, spins and forces of a sphere that slides, then rolls outwards on walls at z = 0."""
    sim = simulate(
        [[0.08, 0.0, RADIUS - 1e-6]],
        RADIUS,
        [[0.3, 0.05, 0.0]],
        walls=walls,
        gravity=G,
        wall=wall_law(0.2, 0.5, 0.05),
        time_step=1.0e-5,
    )
    track = []
    for _ in range(8000):
        sim.advance(1)
        track.append(np.concatenate([sim.spheres.position[0], sim.spheres.spin[0], sim.spheres.force[0]]))
    return np.array(track)


def test_joint_in_a_straight_wall_is_not_felt(simulate, wall_law):
    """The history passes to the next element: the same path on one segment, on five, and on three walls."""
    whole = roll(simulate, wall_law, {"floor": [[0.05, 0.0], [0.15, 0.0]]})
    assert 0.085 < np.hypot(*whole[-1, :2]) < 0.11
    radii = [0.05, 0.0811, 0.083, 0.0855, 0.0871, 0.15]
    split = roll(simulate, wall_law, {"floor": [[r, 0.0] for r in radii]})
    assert split == pytest.approx(whole, abs=1e-11)
    walls = {
        "inner": [[0.05, 0.0], [0.0811, 0.0]],
        "middle": [[0.0811, 0.0], [0.0871, 0.0]],
        "outer": [[0.0871, 0.0], [0.15, 0.0]],
    }
    assert roll(simulate, wall_law, walls) == pytest.approx(whole, abs=1e-11)


@pytest.mark.parametrize(("turn", "speed", "steps"), [(14.0, 0.05, 1200), (-14.0, 0.3, 800)])
def test_history_passes_over_a_smooth_joint(simulate, wall_law, springs, turn, speed, steps):
    """A ball rolling through a trough or over a ridge carries its spring from slope to slope."""
    slope = np.radians(turn / 2.0)
    start = np.array([0.1 - 0.001 * np.cos(slope), 0.0, 0.001 * np.sin(slope)])
    start += (RADIUS - 1e-5) * np.array([np.sin(slope), 0.0, np.cos(slope)])
    velocity = [[speed * np.cos(slope), 0.0, -speed * np.sin(slope)]]
    sim = simulate(
        [start],
        RADIUS,
        velocity,
        walls=bend(turn),
        gravity=20.0 * G,
        wall=wall_law(0.0, 0.5, 0.02),
        time_step=1.0e-5,
        spin=[[0.0, speed / RADIUS, 0.0]],
    )
    stretch = []
    for _ in range(steps):
        sim.advance(1)
        stretch.append(springs(sim)[1][0, "bend"])  # a KeyError would tell that it lost touch
    assert sim.spheres.position[0, 0] > 0.1001
    stretch = np.array(stretch[50:])
    jump = np.linalg.norm(np.diff(stretch, axis=0), axis=1)
    length = np.linalg.norm(stretch[:-1], axis=1)
    assert jump.max() < 0.4 * np.median(length)


def test_gate_holds_until_it_is_opened(simulate, wall_law):
    """On the gate beside its rim: two contacts, with gate and cone; later the cone's alone."""
    radius, deep = RADIUS, DEEP
    r = 0.01 + (radius - deep) * (1.0 - np.sqrt(2.0))  # as deep in the cone as in the gate
    sim = simulate(
        [meridian(r, radius - deep, 50.0)], radius, walls=HOPPER, wall=wall_law(1.0), time_step=1e-9
    )
    sim.advance(1)
    assert sim.wall_force("gate")[2] < 0.0
    cone = sim.wall_force("hopper")
    assert np.linalg.norm(cone) == pytest.approx(np.linalg.norm(sim.wall_force("gate")), rel=1e-5)
    sim.open("gate", -0.012)
    sim.advance(1)
    assert not sim.wall_force("gate").any()
    assert sim.wall_force("hopper") == pytest.approx(cone, rel=1e-5)
    assert sim.spheres.force[0] == pytest.approx(-cone, rel=1e-5)


@pytest.mark.parametrize("flat", [False, True])
def test_open_gate_leaves_a_rim(simulate, wall_law, one_contact, flat):
    """The rim of the outlet is an edge once the gate is gone, also where gate and bottom were one plane."""
    outer = [0.03, 0.0] if flat else [0.03, 0.02]
    walls = {"hopper": [[0.01, 0.0], outer, [0.03, 0.08]], "gate": [[0.0, 0.0], [0.01, 0.0]]}
    tilt = np.radians(60.0 if flat else 20.0)
    away = np.array([-np.cos(tilt), 0.0, np.sin(tilt)])
    position = np.array([0.01, 0.0, 0.0]) + (RADIUS - DEEP) * away
    sim = simulate([position], RADIUS, walls=walls, wall=wall_law(1.0), time_step=1e-9)
    sim.advance(1)
    sim.open("gate", -1.0)
    sim.advance(1)
    assert sim.spheres.force[0] == pytest.approx(one_contact() * away, rel=1e-4)
    assert sim.wall_force("hopper") == pytest.approx(-one_contact() * away, rel=1e-4)
    # In the middle of the outlet there is nothing any more.
    sim = simulate([[0.0, 0.0, RADIUS - DEEP]], RADIUS, walls=walls, time_step=1e-9)
    sim.advance(1)
    assert sim.spheres.force[0].any()
    sim.open("gate", -1.0)
    sim.advance(1)
    assert not sim.spheres.force[0].any()


def test_opening_drops_the_gates_history_only(bed, springs):
    """Springs between spheres and at the other walls are the same before and after."""
    pairs, walls = springs(bed)
    assert {name for _, name in walls} == {"hopper", "gate", "insert"}
    assert len(pairs) > 1000 and np.median([np.linalg.norm(s) for s in walls.values()]) > 1e-9
    bed.open("gate", -0.012)
    pairs_after, walls_after = springs(bed)
    assert pairs_after.keys() == pairs.keys()
    assert all((pairs_after[key] == pairs[key]).all() for key in pairs)
    kept = {key: spring for key, spring in walls.items() if key[1] != "gate"}
    assert walls_after.keys() == kept.keys()
    assert all((walls_after[key] == kept[key]).all() for key in kept)


def test_rim_inherits_nothing_from_the_gate(simulate, springs):
    """Where gate and bottom are one plane, a sphere beside the rim touches it anew once the gate is gone."""
    walls = {"hopper": [[0.01, 0.0], [0.03, 0.0], [0.03, 0.08]], "gate": [[0.0, 0.0], [0.01, 0.0]]}
    position = [0.01 - 1e-4, 0.0, RADIUS - DEEP]
    sim = simulate([position], RADIUS, [[0.0, 1e-3, 0.0]], walls=walls)
    sim.advance(1)
    assert np.linalg.norm(springs(sim)[1][0, "gate"]) > 1e-9
    sim.spheres.velocity[:], sim.spheres.spin[:] = 0.0, 0.0
    sim.spheres.position[0] = position
    sim.open("gate", -1.0)
    sim.advance(1)
    assert np.linalg.norm(springs(sim)[1][0, "hopper"]) < 1e-15


def test_walls_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="two equal points"):
        make_walls([[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]]])
    with pytest.raises(ValueError, match="more than two"):
        make_walls([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[1.0, 0.0], [2.0, 0.0]]])

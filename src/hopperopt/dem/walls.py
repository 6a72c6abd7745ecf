"""Walls of revolution: profiles in the meridian plane, their elements, and the spheres near them.

The closest point of an axisymmetric wall lies in the sphere's own meridian plane, so a wall contact is a
point against a polyline: exact, without facets. Elements are segments and vertices. A vertex is the closest
point only where the sphere lies beyond the end of every segment that meets there, so a convex edge gives one
contact and a concave corner two. Segments that meet at less than 15 degrees form one surface, and a sphere
has one contact with a surface, with its deepest element; the spring belongs to the surface.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numba import njit

from hopperopt.dem.neighbours import rows_by_identity
from hopperopt.dem.state import COUNT, NEEDED, RADIUS, SKIN, TOUCH_CARRIED

SMOOTH_ANGLE = math.radians(15.0)
NO_SEGMENT = -1


class Walls(NamedTuple):
    """Elements in an order in which every surface is one range. Segment e: from `point[e]` along `along[e]`.

    A vertex has `length2` 0; `segments[e]` are the (at most two) segments that end there, `ends[e]` tells at
    which end (0 start, 1 end); on a segment both are unused.
    """

    point: np.ndarray  # (elements, 2) r and z, m
    along: np.ndarray  # (elements, 2) m
    length2: np.ndarray  # (elements,) m2
    segments: np.ndarray  # (elements, 2) int64
    ends: np.ndarray  # (elements, 2) int64
    profile: np.ndarray  # (elements,) int64, index of the wall it belongs to
    closed: np.ndarray  # (elements,) uint8, 0 once the wall is taken away
    surface_start: np.ndarray  # (surfaces + 1,) int64, elements of a surface


def make_walls(profiles):
    """Elements of revolved polylines.

    Arguments: `profiles`, a list of (points, 2) arrays of r >= 0 and z in m. Points shared by two profiles or
    by the two ends of one profile are joints like any other. Raises ValueError where more than two segments
    meet in a point or a segment has no length.
    """
    segments, owners = [], []
    for wall, points in enumerate(profiles):
        points = np.asarray(points, dtype=float)
        for a, b in pairwise(points):
            if not np.linalg.norm(b - a) > 0.0:
                raise ValueError(f"wall {wall}: two equal points at r, z = {tuple(a)}")
            segments.append((a, b))
            owners.append(wall)
    joints = {}  # point -> [(segment, end)]
    for s, ends in enumerate(segments):
        for end, p in enumerate(ends):
            joints.setdefault(tuple(p), []).append((s, end))
    for p, meeting in joints.items():
        if len(meeting) > 2:
            raise ValueError(f"more than two wall segments meet at r, z = {p}")
    joints = {p: meeting for p, meeting in joints.items() if not _is_disc_centre(p, meeting, segments)}
    surfaces = _chains(segments, joints)
    return _walls_of(segments, owners, joints, surfaces)


def _is_disc_centre(point, meeting, segments):
    """A profile's end on the axis is no vertex where the profile is perpendicular to the axis."""
    (s, _), *others = meeting
    return point[0] == 0.0 and not others and segments[s][0][1] == segments[s][1][1]


def _direction(segments, s, end):
    """Unit vector of a segment, pointing away from its given end."""
    a, b = segments[s]
    d = (b - a) if end == 0 else (a - b)
    return d / np.linalg.norm(d)


def _chains(segments, joints):
    """Group segments and smooth joints into surfaces: lists of ("segment", s) and ("vertex", point)."""
    smooth = {}  # (segment, end) -> (point, neighbour segment, its end)
    for p, meeting in joints.items():
        if len(meeting) == 2:
            (s, es), (t, et) = meeting
            turn = -float(np.dot(_direction(segments, s, es), _direction(segments, t, et)))
            if turn > math.cos(SMOOTH_ANGLE):
                smooth[s, es] = (p, t, et)
                smooth[t, et] = (p, s, es)
    seen, surfaces = set(), []
    for s in range(len(segments)):
        if s in seen:
            continue
        head, end = s, 0  # walk back to where the surface begins, or once around a closed one
        while (head, end) in smooth and smooth[head, end][1] != s:
            _, head, came = smooth[head, end]
            end = 1 - came
        chain, here, out = [], head, 1 - end
        while here not in seen:
            seen.add(here)
            chain.append(("segment", here))
            if (here, out) not in smooth:
                break
            p, here, came = smooth[here, out]
            chain.append(("vertex", p))
            out = 1 - came
        surfaces.append(chain)
    inside = {item for chain in surfaces for item in chain}
    return surfaces + [[("vertex", p)] for p in joints if ("vertex", p) not in inside]


def _walls_of(segments, owners, joints, surfaces):
    """The arrays of `Walls` from the grouped elements."""
    items = [item for chain in surfaces for item in chain]
    element_of = {item[1]: e for e, item in enumerate(items) if item[0] == "segment"}
    n = len(items)
    walls = Walls(
        point=np.zeros((n, 2)),
        along=np.zeros((n, 2)),
        length2=np.zeros(n),
        segments=np.full((n, 2), NO_SEGMENT, np.int64),
        ends=np.zeros((n, 2), np.int64),
        profile=np.zeros(n, np.int64),
        closed=np.ones(n, np.uint8),
        surface_start=np.cumsum([0] + [len(chain) for chain in surfaces]).astype(np.int64),
    )
    for e, (kind, key) in enumerate(items):
        if kind == "segment":
            a, b = segments[key]
            walls.point[e], walls.along[e] = a, b - a
            walls.length2[e] = np.dot(b - a, b - a)
            walls.profile[e] = owners[key]
        else:
            walls.point[e] = key
            walls.profile[e] = owners[joints[key][0][0]]
            for k, (s, end) in enumerate(joints[key]):
                walls.segments[e, k], walls.ends[e, k] = element_of[s], end
    return walls


def open_wall(walls, touches, entries, profile):
    """Take the wall `profile` away, with the history of every contact with it.

    `entries` is the length of the wall list. A vertex shared with another wall stays with that one.
    """
    gone = (walls.profile == profile) & (walls.length2 > 0.0)
    walls.closed[gone] = 0
    for e in np.flatnonzero(walls.length2 == 0.0):
        left = [k for k in range(2) if walls.segments[e, k] != NO_SEGMENT and not gone[walls.segments[e, k]]]
        for k in range(2):
            if k not in left:
                walls.segments[e, k] = NO_SEGMENT
        if left:
            walls.profile[e] = walls.profile[walls.segments[e, left[0]]]
        else:
            walls.closed[e] = 0
    held = touches.element[:entries]
    lost = (held >= 0) & (walls.closed[held] == 0)
    touches.element[:entries][lost] = -1
    touches.spring[:entries][lost] = 0.0


@njit(cache=True)
def nearest(walls, e, r, z):
    """Vector (r, z) in m from the closest point of element e to a sphere centre, and whether e is it.

    A segment answers where the centre projects onto it, a vertex where it projects beyond every segment
    there.
    """
    dr, dz = r - walls.point[e, 0], z - walls.point[e, 1]
    if walls.length2[e] > 0.0:
        s = dr * walls.along[e, 0] + dz * walls.along[e, 1]
        t = s / walls.length2[e]
        return dr - t * walls.along[e, 0], dz - t * walls.along[e, 1], 0.0 <= s <= walls.length2[e]
    beyond = True
    for k in range(2):
        g = walls.segments[e, k]
        if g >= 0:
            s = (r - walls.point[g, 0]) * walls.along[g, 0] + (z - walls.point[g, 1]) * walls.along[g, 1]
            beyond = beyond and (s < 0.0 if walls.ends[e, k] == 0 else s > walls.length2[g])
    return dr, dz, beyond


@njit(cache=True)
def surface_boxes(walls):
    """Bounding boxes of the surfaces in the meridian plane, (surfaces, 4): r from, to, z from, to (m).

    A surface without a closed element gets an empty box.
    """
    boxes = np.empty((len(walls.surface_start) - 1, 4))
    for s in range(len(boxes)):
        boxes[s] = (np.inf, -np.inf, np.inf, -np.inf)
        for e in range(walls.surface_start[s], walls.surface_start[s + 1]):
            for end in range(2 if walls.closed[e] else 0):
                r = walls.point[e, 0] + end * walls.along[e, 0]
                z = walls.point[e, 1] + end * walls.along[e, 1]
                boxes[s, 0], boxes[s, 1] = min(boxes[s, 0], r), max(boxes[s, 1], r)
                boxes[s, 2], boxes[s, 3] = min(boxes[s, 2], z), max(boxes[s, 3], z)
    return boxes


@njit(cache=True)
def elements_within(walls, s, r, z, reach):
    """First and last element of surface s that come within `reach` (m) of a point; -1, -1 for none."""
    first = last = -1
    for e in range(walls.surface_start[s], walls.surface_start[s + 1]):
        dr, dz = r - walls.point[e, 0], z - walls.point[e, 1]
        if walls.length2[e] > 0.0:
            t = (dr * walls.along[e, 0] + dz * walls.along[e, 1]) / walls.length2[e]
            t = min(max(t, 0.0), 1.0)
            dr, dz = dr - t * walls.along[e, 0], dz - t * walls.along[e, 1]
        if walls.closed[e] and dr * dr + dz * dz < reach * reach:
            first = e if first < 0 else first
            last = e
    return first, last


@njit(cache=True)
def carry_touches(spheres, touches, counters):
    """Set the springs of touching walls aside, under the sphere's identity and the surface."""
    found = 0
    for i in range(counters[COUNT]):
        for k in range(touches.start[i], touches.start[i + 1]):
            if touches.element[k] >= 0:
                touches.carried[found, 0] = spheres.identity[i]
                touches.carried[found, 1] = touches.surface[k]
                touches.carried[found, 2] = touches.element[k]
                for a in range(3):
                    touches.carried_spring[found, a] = touches.spring[k, a]
                found += 1
    counters[TOUCH_CARRIED] = found


@njit(cache=True)
def list_touches(spheres, touches, walls, count):
    """Fill the wall list. Returns the entries needed; beyond the capacity nothing is written."""
    capacity = len(touches.surface)
    boxes = surface_boxes(walls)
    place, start = spheres.place, touches.start
    found = 0
    for i in range(count):
        start[i] = min(found, capacity)
        r = math.sqrt(place[i, 0] ** 2 + place[i, 1] ** 2)
        z = place[i, 2]
        reach = place[i, RADIUS] + spheres.anchor[i, SKIN]
        for s in range(len(boxes)):
            if (
                r + reach < boxes[s, 0]
                or r - reach > boxes[s, 1]
                or z + reach < boxes[s, 2]
                or z - reach > boxes[s, 3]
            ):
                continue
            first, last = elements_within(walls, s, r, z, reach)
            if last >= 0:
                if found < capacity:
                    touches.owner[found] = i
                    touches.surface[found] = s
                    touches.first[found] = first
                    touches.last[found] = last
                found += 1
    start[count] = min(found, capacity)
    return found


@njit(cache=True)
def restore_touches(spheres, touches, counters):
    """Put the springs set aside into the new wall list."""
    count = counters[COUNT]
    row = rows_by_identity(spheres, count)
    for k in range(touches.start[count]):
        touches.element[k] = -1
        for a in range(3):
            touches.spring[k, a] = 0.0
    for c in range(counters[TOUCH_CARRIED]):
        i = row[touches.carried[c, 0]]
        if i < 0:
            continue
        for k in range(touches.start[i], touches.start[i + 1]):
            if touches.surface[k] == touches.carried[c, 1]:
                touches.element[k] = touches.carried[c, 2]
                for a in range(3):
                    touches.spring[k, a] = touches.carried_spring[c, a]


@njit(cache=True)
def rebuild_touches(spheres, touches, walls, counters):
    """List the spheres near walls, after `rebuild_pairs`. Returns False when the capacity is too small."""
    needed = list_touches(spheres, touches, walls, counters[COUNT])
    if needed > len(touches.surface):
        counters[NEEDED] = needed
        return False
    restore_touches(spheres, touches, counters)
    return True

"""Hopper, gate and insert as revolved profiles: their shapes, volumes, gaps and faults.

A profile is a polyline in the meridian plane, an array (n, 2) of r and z in metres, revolved about the axis
r = 0; z points up and z = 0 is the outlet plane. A profile whose ends both lie on the axis, or that closes on
itself, bounds a solid; any other is a thin shell. All lengths are in metres, angles in degrees.
"""

import numpy as np

DECIMALS = 12  # coordinates are rounded to a picometre, so that no libm's last bit reaches a file


def hopper(outlet_radius, half_angle, cylinder_radius, top):
    """Conical hopper below a cylinder, from the outlet's edge up to `top`; half angle from the vertical."""
    cone_top = cone_height(outlet_radius, half_angle, cylinder_radius)
    return _profile([[outlet_radius, 0], [cylinder_radius, cone_top], [cylinder_radius, top]])


def cone_height(outlet_radius, half_angle, cylinder_radius):
    """Height at which the hopper's cone meets its cylinder; 0 for a flat bottom (90 degrees)."""
    if half_angle == 90:
        return 0.0
    return (cylinder_radius - outlet_radius) / np.tan(np.radians(half_angle))


def gate(outlet_radius):
    """The disc that closes the outlet."""
    return _profile([[0, 0], [outlet_radius, 0]])


def cone(slope, length):
    """Solid cone, apex up, base at z = 0; slope angle from the horizontal, length along the slope."""
    base, height = length * np.cos(np.radians(slope)), length * np.sin(np.radians(slope))
    return _profile([[0, 0], [base, 0], [0, height]])


def double_cone(lower_slope, upper_slope, length):
    """Two solid cones base to base, the lower apex at z = 0; length along the upper one's slope."""
    base, height = length * np.cos(np.radians(upper_slope)), length * np.sin(np.radians(upper_slope))
    waist = base * np.tan(np.radians(lower_slope))
    return _profile([[0, 0], [base, waist], [0, waist + height]])


def bullet(radius, cylinder_length, nose_slope):
    """Solid cylinder, base at z = 0, below a conical nose; its slope angle from the horizontal."""
    shoulder = [radius, cylinder_length]
    return _profile(
        [[0, 0], [radius, 0], shoulder, [0, cylinder_length + radius * np.tan(np.radians(nose_slope))]]
    )


def cone_in_cone(slope, length, opening_radius, thickness):
    """Hollow cone, open at top and bottom, its narrow end at z = 0 with a circle of `opening_radius` inside.

    Slope angle from the horizontal and length along the slope are those of the inner face, the thickness is
    measured across the sheet. The upper rim falls outwards at 45 degrees, so that no particle rests on it.
    """
    tangent = np.tan(np.radians(slope))
    top = length * np.sin(np.radians(slope))
    across = thickness / np.sin(np.radians(slope))
    rim = top - across / (1 + 1 / tangent)
    inner, outer = opening_radius, opening_radius + across
    return _profile(
        [[inner, 0], [outer, 0], [outer + rim / tangent, rim], [inner + top / tangent, top], [inner, 0]]
    )


def raised(profile, height):
    """The same profile lifted by `height`."""
    return _profile(np.asarray(profile, float) + np.array([0, height]))


def _profile(points):
    return np.round(np.asarray(points, float), DECIMALS)


def is_solid(profile):
    """True when the revolved profile encloses a solid: both ends on the axis, or one closed loop."""
    on_axis = profile[0, 0] == 0 and profile[-1, 0] == 0
    return bool(on_axis or np.array_equal(profile[0], profile[-1]))


def _swept(profile, low, high):
    """Integral of pi r^2 dz along the profile's part with low <= z <= high (m3), exact for a polyline."""
    (r1, z1), (r2, z2) = profile[:-1].T, profile[1:].T
    rise = np.where(z1 == z2, 1.0, z2 - z1)  # a level segment sweeps nothing, whatever its ends
    a, b = np.clip(z1, low, high), np.clip(z2, low, high)
    ra, rb = r1 + (r2 - r1) * (a - z1) / rise, r1 + (r2 - r1) * (b - z1) / rise
    return float(np.sum(np.pi / 3 * (b - a) * (ra * ra + ra * rb + rb * rb)))


def volume_inside(profile, level):
    """Volume (m3) that a vessel's wall holds between the outlet plane and `level`."""
    return _swept(profile, 0.0, level)


def solid_volume(profile, level):
    """Volume (m3) of a solid insert below `level`; a thin shell has none."""
    return abs(_swept(profile, -np.inf, level)) if is_solid(profile) else 0.0


def gap(first, second):
    """Shortest distance (m) between two profiles, 0 where they cross.

    Revolved about one axis, the closest points of two surfaces lie in one meridian half-plane, so that the
    distance in the (r, z) plane is the distance in space.
    """
    if _crossings(first, second).any():
        return 0.0
    return float(np.linalg.norm(np.subtract(*closest(first, second))))


def closest(first, second):
    """The closest points (2, 2) of two profiles that do not cross, one of each."""
    pairs = _closest_to_vertices(first, second), _closest_to_vertices(second, first)[::-1]
    return min(pairs, key=lambda pair: np.linalg.norm(np.subtract(*pair)))


def _closest_to_vertices(points, profile):
    """That of `points` (n, 2) which is closest to the segments of `profile`, and the point there: (2, 2)."""
    start, along = profile[:-1], np.diff(profile, axis=0)
    offset = points[:, None] - start
    squared = np.maximum(np.sum(along**2, axis=1), np.finfo(float).tiny)
    share = np.clip(np.sum(offset * along, axis=2) / squared, 0, 1)
    away = offset - share[..., None] * along
    vertex, segment = np.unravel_index(np.linalg.norm(away, axis=2).argmin(), share.shape)
    return np.array([points[vertex], points[vertex] - away[vertex, segment]])


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _crossings(first, second):
    """Boolean (n1, n2): segments of the two profiles that properly cross or touch at an end."""
    p, a = first[:-1, None], np.diff(first, axis=0)[:, None]
    q, b = second[None, :-1], np.diff(second, axis=0)[None]
    sides_of_second = _cross(a, q - p) * _cross(a, q + b - p)
    sides_of_first = _cross(b, p - q) * _cross(b, p + a - q)
    aligned = (_cross(a, q - p) == 0) & (_cross(a, q + b - p) == 0)
    ends_meet = _spans_meet(p, p + a, q, q + b)
    return (sides_of_second <= 0) & (sides_of_first <= 0) & (~aligned | ends_meet)


def _spans_meet(p1, p2, q1, q2):
    """Boolean: the boxes spanned by two segments overlap (decides for segments on one line)."""
    low = np.maximum(np.minimum(p1, p2), np.minimum(q1, q2))
    high = np.minimum(np.maximum(p1, p2), np.maximum(q1, q2))
    return np.all(low <= high, axis=-1)


def crosses_itself(profile):
    """True when two segments of a profile meet elsewhere than at the point they share."""
    if folds_back(profile):
        return True
    count = len(profile) - 1
    apart = np.triu(np.ones((count, count), bool), 2)
    if np.array_equal(profile[0], profile[-1]):
        apart[0, -1] = False  # neighbours in a closed loop
    return bool((_crossings(profile, profile) & apart).any())


def folds_back(profile):
    """True when a segment has no length or runs back over the one before it."""
    before, after = _corners(profile)
    reversed_ = (_cross(before, after) == 0) & (np.sum(before * after, axis=1) <= 0)
    return bool(reversed_.any() or (np.abs(np.diff(profile, axis=0)).sum(axis=1) == 0).any())


def _corners(profile):
    """Vectors (corners, 2) of the segments before and after each corner, that of a closed loop's ends too."""
    along = np.diff(profile, axis=0)
    if np.array_equal(profile[0], profile[-1]):
        along = np.vstack([along, along[:1]])
    return along[:-1], along[1:]


def _turn(profile):
    """1 for a solid that lies on the left of its profile, anti-clockwise in (r, z), -1 on the right."""
    return np.sign(_swept(profile, -np.inf, np.inf))


def crosses_axis(profile):
    """True when a profile has points beyond the axis, or touches it between its ends."""
    return bool((profile[:, 0] < 0).any() or (profile[1:-1, 0] == 0).any())


def inner_radius(profile):
    """Radius (m) of the smallest circle that a sphere sees from inside, infinity when none.

    The faces that look towards the axis count; a shell shows both of its faces, and the rim of a level face
    that leads away from the axis, a solid the outer one. A sphere larger than such a circle would touch it
    all around, not in one point of its meridian plane.
    """
    (r1, z1), (r2, z2) = profile[:-1].T, profile[1:].T
    if is_solid(profile):
        towards_axis = _turn(profile) * (z2 - z1) < 0
    else:
        towards_axis = z1 != z2
        towards_axis[0] |= 0 < r1[0] < r2[0]
        towards_axis[-1] |= 0 < r2[-1] < r1[-1]
    return float(np.min(np.minimum(r1, r2), where=towards_axis, initial=np.inf))


def shallowest_upper_face(profile):
    """Smallest slope (degrees, from the horizontal) of a face that looks upwards, infinity where none does.

    A shell shows both of its faces, a solid the outer one.
    """
    along, rise = np.abs(np.diff(profile[:, 0])), np.abs(np.diff(profile[:, 1]))
    upwards = along > 0
    if is_solid(profile):
        upwards = _turn(profile) * np.diff(profile[:, 0]) < 0
    slopes = np.degrees(np.arctan2(rise, along))
    return float(np.min(slopes, where=upwards, initial=np.inf))


def sharpest_edge(profile):
    """Smallest angle (degrees) between two faces of a solid at an edge off the axis, measured inside;
    infinity for a shell, or where there is no edge.
    """
    if not is_solid(profile):
        return np.inf
    before, after = _corners(profile)
    turns = np.arctan2(_cross(before, after), np.sum(before * after, axis=1))
    return float(np.min(180.0 - np.degrees(_turn(profile) * turns), initial=np.inf))


def opening_radius(profile):
    """Radius (m) of the opening that a ring or an open shell leaves around the axis, 0 for a body on it."""
    return float(profile[:, 0].min())


def stays_inside(profile, vessel):
    """True when no vertex of an insert lies at or beyond the vessel's wall, or at or below its outlet."""
    wall = np.interp(profile[:, 1], vessel[:, 1], vessel[:, 0])
    return bool((profile[:, 0] < wall).all() and (profile[:, 1] > 0).all())


def particle_count(solid_fraction, volume, diameters):
    """Number of particles that fill `volume` (m3), equal numbers of each of the `diameters` (m)."""
    kinds = len(diameters)
    return kinds * max(1, round(solid_fraction * volume / mean_sphere(diameters) / kinds))


def mean_sphere(diameters):
    """Mean volume (m3) of spheres, equal numbers of each of the `diameters` (m)."""
    return float(np.pi / 6 * np.mean(np.asarray(diameters) ** 3))

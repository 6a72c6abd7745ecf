"""Walls of revolution for the plain solver: where spheres touch profiles revolved about the z axis.

The closest point of such a wall lies in the sphere's own meridian plane (r, z): all is plane geometry.
"""

from itertools import pairwise

import numpy as np

SMOOTH = 15.0  # degrees: a profile that turns by less is smooth


class Face:
    """A segment of a profile, from `a` to `b` (r, z in m) on the wall `owner`."""

    def __init__(self, owner, a, b):
        self.owner, self.ends = owner, (tuple(a), tuple(b))
        self.a, self.along = np.array(a), np.subtract(b, a)

    def away(self, p):
        """Vectors (n, 2) m to points `p` from their closest point; NaN where that is not inside the face."""
        t = (p - self.a) @ self.along / (self.along @ self.along)
        inside = (t >= 0) & (t <= 1)
        return np.where(inside[:, None], p - self.a - t[:, None] * self.along, np.nan)


class Edge:
    """A vertex of profiles, where one or two faces end."""

    def __init__(self, point, faces):
        self.owner, self.point = faces[0].owner, np.array(point)
        along = [face.along if face.ends[0] == point else -face.along for face in faces]
        self.outward = [a / np.linalg.norm(a) for a in along]  # into each face

    def away(self, p):
        """Vectors (n, 2) m to points `p`; NaN where they lie beside one of the faces, not beyond its end."""
        beyond = np.all([(p - self.point) @ outward < 0 for outward in self.outward], axis=0)
        return np.where(beyond[:, None], p - self.point, np.nan)

    def smooth(self):
        """Whether two faces meet here, one going on almost as the other did."""
        if len(self.outward) == 1:
            return False
        return -self.outward[0] @ self.outward[1] > np.cos(np.radians(SMOOTH))

    def in_a_disc(self):
        """Whether this is the middle of a disc: an end on the axis, of a level face. No edge then."""
        return self.point[0] == 0 and len(self.outward) == 1 and self.outward[0][1] == 0


class Surfaces:
    """What spheres touch, each at one point at most: faces joined smoothly with the edges between them, and
    every other edge by itself. `elements[s]` are the faces and edges of surface s, `owner[s]` is its wall.

    Argument: `walls`, name -> profile (points, 2) of r and z in m. Profiles may share points.
    """

    def __init__(self, walls):
        faces = [Face(name, a, b) for name, points in walls.items() for a, b in pairwise(points)]
        meeting = {}  # (r, z) -> faces, by number
        for f, face in enumerate(faces):
            for point in face.ends:
                meeting.setdefault(point, []).append(f)
        edges = {point: Edge(point, [faces[f] for f in there]) for point, there in meeting.items()}
        surface = np.arange(len(faces))
        for point, edge in edges.items():
            if edge.smooth():
                one, other = surface[meeting[point]]
                surface[surface == max(one, other)] = min(one, other)
        self.elements = [
            [faces[f] for f in np.flatnonzero(surface == s)]
            + [edge for point, edge in edges.items() if edge.smooth() and surface[meeting[point][0]] == s]
            for s in np.unique(surface)
        ]
        self.elements += [[edge] for edge in edges.values() if not edge.smooth() and not edge.in_a_disc()]
        self.owner = [elements[0].owner for elements in self.elements]
        self.edge = np.array([isinstance(elements[0], Edge) for elements in self.elements])

    def contacts(self, x, R):
        """Contacts of spheres at `x` (n, 3) m with radii `R` (m): with each surface the deepest, if any.

        Returns spheres and surfaces (k,), overlaps (k,) m, unit normals (k, 3) from the wall, and which of
        the surface's elements is touched (k,).
        """
        r = np.hypot(x[:, 0], x[:, 1])
        radial = np.divide(x[:, :2], r[:, None], out=np.zeros((len(r), 2)), where=r[:, None] > 0)
        p = np.column_stack([r, x[:, 2]])
        found = []
        for s, elements in enumerate(self.elements):
            away = np.array([element.away(p) for element in elements])
            overlap = R - np.linalg.norm(away, axis=2)
            overlap[np.isnan(overlap)] = -np.inf
            i = np.flatnonzero(overlap.max(axis=0) > 0)
            deepest = overlap[:, i].argmax(axis=0)
            a, delta = away[deepest, i], overlap[deepest, i]
            n = np.column_stack([a[:, :1] * radial[i], a[:, 1:]]) / np.linalg.norm(a, axis=1)[:, None]
            found.append((i, np.full(len(i), s), delta, n, deepest))
        return tuple(np.concatenate(column) for column in zip(*found, strict=True))

"""Initial positions: spheres scattered at random, without overlap, in a column above the hopper."""

import numpy as np

ROUNDS = 2000  # proposals for the last sphere; a column at a solid fraction of 0.2 takes about 50


def scatter(radii, column_radius, bottom, solid_fraction, generator):
    """Random positions of non-overlapping spheres in a cylindrical column.

    Every sphere is placed uniformly over the column among those positions where it overlaps none placed
    before it (random sequential addition, larger spheres first). The column is as high as the solid fraction
    makes it.

    Arguments: `radii` (n,) m; radius within which centres lie, m; height of the lowest points, m; solid
    fraction of the column; a numpy random generator. Returns positions (n, 3), m. Raises ValueError when they
    do not fit.
    """
    radii = np.asarray(radii, dtype=float)
    height = 4.0 / 3.0 * np.pi * np.sum(radii**3) / (solid_fraction * np.pi * column_radius**2)
    low = bottom + radii.max()
    out = np.empty((len(radii), 3))
    placed = np.empty(0, dtype=int)
    for size in np.unique(radii)[::-1]:
        waiting = np.flatnonzero(radii == size)
        for _ in range(ROUNDS):
            if not len(waiting):
                break
            r = column_radius * np.sqrt(generator.random(len(waiting)))
            angle = 2.0 * np.pi * generator.random(len(waiting))
            z = low + height * generator.random(len(waiting))
            proposed = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
            free = _free(proposed, size, out[placed], radii[placed])
            out[waiting[free]] = proposed[free]
            placed, waiting = np.concatenate([placed, waiting[free]]), waiting[~free]
        if len(waiting):
            raise ValueError(f"no room for {len(waiting)} spheres at a solid fraction of {solid_fraction:g}")
    return out


def _free(proposed, radius, others, other_radii):
    """Which of the proposed equal spheres overlap neither any other sphere nor a proposed one before them."""
    from scipy.spatial import cKDTree

    free = np.ones(len(proposed), dtype=bool)
    tree = cKDTree(proposed)
    if len(others):
        reach = radius + other_radii.max()
        near = tree.sparse_distance_matrix(cKDTree(others), reach, output_type="ndarray")
        free[near["i"][near["v"] < radius + other_radii[near["j"]]]] = False
    pairs = tree.query_pairs(2.0 * radius, output_type="ndarray")
    free[pairs.max(axis=1)] = False
    return free

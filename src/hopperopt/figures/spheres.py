"""A picture of spheres, seen along one axis: which sphere is in front is decided for every pixel."""

from typing import NamedTuple

import numpy as np

LIGHT = np.array([-0.45, 0.55, 0.70])  # towards it: left, above, in front
LIGHT = LIGHT / np.linalg.norm(LIGHT)
AMBIENT = 0.5
RIM = 0.55  # how dark the outline of a sphere is
HAZE = 0.75  # how much of its colour the farthest sphere loses
SAMPLES = 2  # per pixel and axis


class View(NamedTuple):
    """Part of the plane that a picture shows, and pixels per length."""

    left: float
    right: float
    bottom: float
    top: float
    resolution: float


def render(
    centre: np.ndarray, radius: np.ndarray, colour: np.ndarray, view: View, depth: float
) -> np.ndarray:
    """Draw spheres as an image: rows from the top, columns, RGBA from 0 to 1, clear where there is none.

    centre (n, 3): to the right, up, and away from the eye, in the view's unit of length; radius (n,); colour
    (n, 3), RGB from 0 to 1. Colours fade to white towards `depth`.
    """
    scale = view.resolution * SAMPLES
    wide = SAMPLES * round((view.right - view.left) * view.resolution)
    high = SAMPLES * round((view.top - view.bottom) * view.resolution)
    # Centres in samples from the left and from the top; sample j covers j to j + 1.
    across, down = (centre[:, 0] - view.left) * scale, (view.top - centre[:, 1]) * scale
    size, away = radius * scale, centre[:, 2] * scale
    nearest = np.full((high, wide), np.inf, np.float32)
    picture = np.zeros((high, wide, 4), np.float32)
    for index in np.argsort(away, kind="stable"):
        r = size[index]
        columns = slice(*np.clip([int(across[index] - r), int(across[index] + r) + 2], 0, wide))
        rows = slice(*np.clip([int(down[index] - r), int(down[index] + r) + 2], 0, high))
        if (nearest[rows, columns] <= away[index] - r).all():
            continue  # hidden, whatever its shape
        x = (np.arange(columns.start, columns.stop) + 0.5 - across[index]) / r
        y = (down[index] - np.arange(rows.start, rows.stop) - 0.5)[:, None] / r
        inside = 1 - x**2 - y**2
        front = np.where(inside > 0, away[index] - r * np.sqrt(np.maximum(inside, 0)), np.inf)
        seen = front < nearest[rows, columns]
        if not seen.any():
            continue
        nearest[rows, columns][seen] = front[seen]
        towards = np.sqrt(np.maximum(inside, 0))
        bright = AMBIENT + (1 - AMBIENT) * np.maximum(LIGHT[0] * x + LIGHT[1] * y + LIGHT[2] * towards, 0)
        bright *= 1 - RIM * (1 - np.minimum(towards / 0.45, 1)) ** 2
        haze = HAZE * np.clip(centre[index, 2] / depth, 0, 1)
        shaded = (1 - haze) * colour[index] * bright[..., None] + haze
        picture[rows, columns, :3][seen] = shaded[seen]
        picture[rows, columns, 3][seen] = 1.0
    return _averaged(picture)


def _averaged(picture: np.ndarray) -> np.ndarray:
    """Mean over each pixel's samples, colours weighted with their opacity."""
    high, wide = picture.shape[0] // SAMPLES, picture.shape[1] // SAMPLES
    picture[..., :3] *= picture[..., 3:]
    mean = picture.reshape(high, SAMPLES, wide, SAMPLES, 4).mean(axis=(1, 3))
    colour = np.divide(mean[..., :3], mean[..., 3:], out=np.ones_like(mean[..., :3]), where=mean[..., 3:] > 0)
    return np.concatenate([colour, mean[..., 3:]], axis=-1)

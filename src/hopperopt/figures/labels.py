"""Words beside the lines and points that they name, none of them upon another."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation, Text
from scipy.optimize import isotonic_regression

from hopperopt.figures import style

# Where a label may stand beside its point: distances in points, directions, the likelier ones first.
DISTANCES = (5.0, 10.0, 16.0, 24.0, 34.0, 46.0)
DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1), (0.7, 0.7), (0.7, -0.7), (-0.7, 0.7), (-0.7, -0.7))
ALIGN, ALIGN_UP = {1: "left", 0: "center", -1: "right"}, {1: "bottom", 0: "center", -1: "top"}


def spread(positions: Sequence[float], distance: float) -> np.ndarray:
    """Move positions as little as needed to be `distance` apart, in their order."""
    wished = np.asarray(positions, dtype=float)
    order = np.argsort(wished, kind="stable")
    offsets = distance * np.arange(len(wished))
    moved = np.empty_like(wished)
    # With the offsets taken off, "apart" reads "not falling".
    moved[order] = isotonic_regression(wished[order] - offsets).x + offsets
    return moved


def at_points(axes: Axes, labels: Mapping[str, tuple[float, float]], others: np.ndarray) -> list[Annotation]:
    """Write labels {text: (x, y)} beside their points, where they cover least, farther ones with a line.

    others (n, 2): further points of the axes to keep clear of.
    """
    axes.autoscale_view()  # transData would lag behind the data
    own = axes.transData.transform(np.reshape(list(labels.values()), (-1, 2)))
    points = np.vstack([axes.transData.transform(np.reshape(others, (-1, 2))), own])
    frame, texts = axes.get_window_extent(), list[Annotation]()
    for index, (text, place) in enumerate(labels.items()):
        label = axes.annotate(
            text,
            place,
            (0, 0),
            textcoords="offset points",
            zorder=5,
            path_effects=style.HALO,
            arrowprops={"arrowstyle": "-", "linewidth": 0.4, "color": style.INK, "shrinkA": 0, "shrinkB": 4},
        )
        taken, costs = [_moved(other) for other in texts], []
        for distance, direction in itertools.product(DISTANCES, DIRECTIONS):
            box = _moved(label, distance, direction)
            covered = box.padded(2).count_contains(points) + 50 * box.padded(1).count_overlaps(taken)
            misleading = np.argmin(_distances(box, own)) != index
            outside = not (frame.contains(*box.min) and frame.contains(*box.max))
            cost = covered + 10 * misleading + 100 * outside + 0.15 * distance
            costs.append((cost, distance, direction))
        _, distance, direction = min(costs, key=lambda choice: choice[0])
        _moved(label, distance, direction)
        assert label.arrow_patch is not None  # it has arrowprops
        label.arrow_patch.set_visible(distance > DISTANCES[0])
        texts.append(label)
    return texts


def _distances(box, points):
    """Distances (n,) of points (n, 2) from a box."""
    return np.linalg.norm(np.maximum(np.maximum(box.min - points, points - box.max), 0), axis=1)


def _moved(label, distance=None, direction=None):
    """Box in pixels of a label's words, after moving it off its point (if asked to)."""
    if direction is not None:
        x, y = direction
        label.set(position=(distance * x, distance * y), ha=ALIGN[np.sign(x)], va=ALIGN_UP[np.sign(y)])
    label.update_positions(label.axes.figure.canvas.get_renderer())
    return Text.get_window_extent(label)  # the label's own box holds its line as well


def at_ends(axes: Axes, labels: Mapping[str, tuple[float, str]]) -> list[Annotation]:
    """Write labels {text: (y, colour)} at the right of the axes, at the height of their lines.

    Call when the limits of y are final.
    """
    height = axes.get_window_extent().height / axes.figure.dpi * 72
    low, high = axes.get_ylim()
    share = [(y - low) / (high - low) for y, _ in labels.values()]
    at = spread(share, 8.5 / height)
    return [
        axes.annotate(
            text,
            (1, y),
            xycoords="axes fraction",
            xytext=(3, 0),
            textcoords="offset points",
            va="center",
            color=colour,
            annotation_clip=False,
        )
        for (text, (_, colour)), y in zip(labels.items(), at, strict=True)
    ]

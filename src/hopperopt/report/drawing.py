"""Cuts through the hopper for a page: outlines of walls as SVG paths in mm, pictures of particles.

SVG's y points down: y = -z.
"""

import base64
import io
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from PIL import Image

from hopperopt import geometry, moments
from hopperopt.figures import hopper

PER_M = 1000.0  # millimetres
RESOLUTION = 4.0  # pixels per mm of a hopper that is 100 mm wide
WIDTH = 100.0  # mm
# Of the hopper's width: room for dimensions on the left, on the right and above, and the step between them.
LEFT, RIGHT, ABOVE, STEP = 0.46, 0.42, 0.1, 0.09


class Outline(NamedTuple):
    """Where a cut through the axis meets a wall: an SVG path, and whether it encloses a solid."""

    path: str
    solid: bool


class Dimension(NamedTuple):
    """A line with arrow heads from (x1, y1) to (x2, y2), and its text at (x, y); mm."""

    x1: float
    y1: float
    x2: float
    y2: float
    text: str
    x: float
    y: float
    anchor: str


def inside(hopper_profile: np.ndarray) -> str:
    """SVG path of the space within the hopper's profile (n, 2)."""
    return _path(np.column_stack(hopper.mirrored(hopper_profile))) + "Z"


def outline(profile: np.ndarray) -> Outline:
    """Cut of a profile (n, 2) and its mirror image."""
    solid = geometry.is_solid(profile)
    if solid and not np.array_equal(profile[0], profile[-1]):  # one body across the axis
        return Outline(_path(np.column_stack(hopper.mirrored(profile))) + "Z", True)
    sides = [_path(profile * [side, 1]) + "Z" * solid for side in (-1, 1)]
    return Outline("".join(sides), solid)


def _path(points: np.ndarray) -> str:
    return "M" + "L".join(f"{x:.2f},{-z:.2f}" for x, z in points)


def view_box(limits: Sequence[float]) -> str:
    """SVG's viewBox of left, right, bottom and top, mm."""
    left, right, bottom, top = limits
    return f"{left:.2f} {-top:.2f} {right - left:.2f} {top - bottom:.2f}"


def extent(cases: Sequence[Mapping], runs: Sequence[xr.Dataset]) -> tuple[float, ...]:
    """Left, right, bottom and top (mm) of what shows all these cases with their beds, in one scale."""
    each = [hopper.limits_of(run, case) for run, case in zip(runs, cases, strict=True)]
    left, right, bottom, top = zip(*each, strict=True)
    return min(left), max(right), min(bottom), max(top)


def dimensions(walls: Mapping[str, np.ndarray], level: float) -> tuple[list[Dimension], tuple[float, ...]]:
    """The hopper's dimensions and the limits of a drawing that holds them.

    level: of the settled bed above the outlet, mm; the cone's half angle stands beside the others.
    """
    (outlet, _), (_, cone_top) = walls["hopper"][:2]
    widest = walls["hopper"][:, 0].max()
    insert = walls.get("insert")
    top = max(level, cone_top, 0 if insert is None else insert[:, 1].max()) + STEP * widest
    step = STEP * 2 * widest
    text = 0.5 * step  # height of the letters
    lines = [
        Dimension(-widest, -top, widest, -top, f"⌀ {2 * widest:.4g} mm", 0, -top - 0.4 * text, "middle"),
        Dimension(-outlet, step, outlet, step, f"⌀ {2 * outlet:.4g} mm", 0, step + 1.3 * text, "middle"),
    ]
    lines.append(_height(-widest - step, level, f"bed {level:.0f} mm", "end", text))
    if insert is not None:
        base, apex = insert[:, 1].min(), insert[:, 1].max()
        lines.append(_height(widest + step, base, f"{base:.3g} mm", "start", text))
        right = widest + step
        middle = -(base + apex) / 2 + 0.35 * text
        words = f"{apex - base:.3g} mm"
        lines.append(Dimension(right, -base, right, -apex, words, right + 0.5 * text, middle, "start"))
        wide = insert[:, 0].max()
        under = -base + 0.5 * step
        lines.append(
            Dimension(-wide, under, wide, under, f"⌀ {2 * wide:.3g} mm", 0, under + 1.3 * text, "middle")
        )
    scale = 2 * widest
    limits = (-widest - LEFT * scale, widest + RIGHT * scale, -step - 2 * text, top + ABOVE * scale)
    return lines, limits


def _height(x, height, text, anchor, size):
    """Dimension of a height above the outlet, its text on the side that `anchor` leaves free."""
    beside = x + (0.5 if anchor == "start" else -0.5) * size
    return Dimension(x, 0, x, -height, text, beside, -height / 2 + 0.35 * size, anchor)


def frames(run: xr.Dataset, limits: Sequence[float]) -> list[dict]:
    """The particles of a run at the opening and when half of the mass has left: `caption` and `image`.

    limits: left, right, bottom and top of the images, mm. A moment that the run did not reach has no frame.
    """
    half_way = hopper.words_for(moments.half_time(run)).replace("$", "")
    shown = {"before the opening": "position_opening", half_way: "position_half"}
    resolution = RESOLUTION * WIDTH / (limits[1] - limits[0])
    return [
        {
            "caption": caption,
            "image": data_uri(
                hopper.picture(
                    run, PER_M * run[name].values, hopper.by_size(run), "front view", limits, resolution
                )
            ),
        }
        for caption, name in shown.items()
        if np.isfinite(run[name].values).any()
    ]


def data_uri(image: np.ndarray) -> str:
    """An image (rows, columns, RGBA from 0 to 1) as a data URI."""
    content = io.BytesIO()
    Image.fromarray((255 * image).round().astype(np.uint8)).save(content, "webp", quality=80)
    return f"data:image/webp;base64,{base64.b64encode(content.getvalue()).decode()}"

"""The hopper with some inserts, side by side at one scale, before anything is simulated."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hopperopt import geometry
from hopperopt.figures import hopper, style

PANEL = 80.0  # mm, width
FRAME = style.Frame(left=10, right=2, bottom=8, top=15)
GAPS = (3.0, 24.0)
MARGIN = 6.0  # mm of the hopper, beside and above it
BED = "#0072B2"


class Sketch(NamedTuple):
    """One hopper with the design that it is."""

    heading: str
    design: Mapping[str, float]
    walls: Mapping[str, Sequence | None]  # of the case: profiles, m
    level: float  # mm
    gap: float  # coarse diameters
    coarse: float  # mm, that diameter


@style.styled
def draw(sketches: Sequence[Sketch]) -> Figure:
    """Draw each sketch with its dimensions in mm and the level of the bed."""
    walls = [
        {
            name: hopper.PER_M * np.array(wall, float)
            for name, wall in sketch.walls.items()
            if wall is not None
        }
        for sketch in sketches
    ]
    wide = max(each["hopper"][:, 0].max() for each in walls) + MARGIN
    tops = [each["insert"][:, 1].max() for each in walls if "insert" in each]
    limits = -wide, wide, -3 * MARGIN, max([*tops, *(sketch.level for sketch in sketches)]) + 4 * MARGIN
    columns = min(2, len(sketches))
    rows = math.ceil(len(sketches) / columns)
    high = PANEL * (limits[3] - limits[2]) / (limits[1] - limits[0])
    figure = style.page(
        FRAME.left + FRAME.right + columns * PANEL + (columns - 1) * GAPS[0],
        FRAME.bottom + FRAME.top + rows * high + (rows - 1) * GAPS[1],
    )
    axes = style.panels(figure, rows, columns, FRAME, GAPS)
    for panel in axes.flat[len(sketches) :]:
        panel.remove()
    for panel, sketch, each in zip(axes.flat, sketches, walls, strict=False):
        panel.set(xlim=limits[:2], ylim=limits[2:], xlabel="$r$ (mm)")
        _draw_hopper(panel, sketch, each, limits)
    for panel in axes[:, 0]:
        panel.set_ylabel("height $z$ (mm)")
    return figure


def _draw_hopper(axes: Axes, sketch: Sketch, walls: Mapping, limits: Sequence[float]) -> None:
    hopper.draw_walls(axes, walls)
    axes.plot(*hopper.mirrored(walls["gate"]), color=hopper.WALL, linewidth=1.2, zorder=3)
    edge = np.interp(sketch.level, walls["hopper"][:, 1], walls["hopper"][:, 0])
    axes.plot([-edge, edge], [sketch.level] * 2, color=BED, linewidth=0.8, linestyle="--", zorder=2)
    words = f"level of the bed, {sketch.level:g} mm"
    axes.text(1 - edge, sketch.level + 1, words, color=BED, path_effects=style.HALO, zorder=6)
    hopper.draw_dimensions(axes, walls, limits)
    facts = [sketch.heading, style.design_text(sketch.design)]
    if "insert" in walls:
        across, size = 2 * walls["insert"][:, 0].max(), np.ptp(walls["insert"][:, 1])
        facts.append(f"insert ⌀ {across:.3g} mm, {size:.3g} mm high; gap {sketch.gap:.2f} coarse diameters")
        start, end = geometry.closest(walls["insert"], walls["hopper"])
        level = start[1] == end[1]
        away = (0, -1) if level else (-3, -1)
        hopper.dimension(axes, start, end, f"{sketch.gap * sketch.coarse:.3g} mm", away, "top")
        if (opening := geometry.opening_radius(walls["insert"])) > 0:
            at = walls["insert"][walls["insert"][:, 0].argmin(), 1]
            hopper.dimension(axes, (-opening, at), (opening, at), f"⌀ {2 * opening:.3g} mm", (0, 1), "bottom")
    axes.set_title("\n".join(facts), loc="left")

"""The hopper with its particles, before and during the discharge, cut open in two directions (figure 2)."""

import json
import os
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Circle, Polygon
from matplotlib.ticker import MaxNLocator

from hopperopt import files, moments, outflow
from hopperopt.figures import spheres, style
from hopperopt.geometry import is_solid

PER_M = 1000.0  # millimetres
WIDTH = 130.0  # mm in print
MARGIN = 4.0  # mm of the hopper, beside it
# Axes to the right, up and away from the eye, and the sign of the last.
SIDES = {"front view": ([0, 2, 1], 1, "x"), "side view": ([1, 2, 0], -1, "y")}
COLOURS = style.COLOURS | {"coarse": "#C4C4C4"}
WALL, SECTION, INSIDE = "#4D4D4D", "#E4E4E4", "#F4F4F4"


def write(params: Mapping, run: str | os.PathLike, outputs: Sequence[str | os.PathLike]) -> None:
    """Draw a run; params: `dpi`; run: the run's netCDF file; outputs: paths, PNG or PDF."""
    style.save(draw(files.read_netcdf(run)), outputs, params["dpi"])


@style.styled
def draw(run: xr.Dataset) -> Figure:
    """Draw four views of one run: at the opening and at M = 0.5, from the front and from the side.

    The particles whose centres lie behind the cut, a plane through the axis, are shown. Heights and widths
    are in mm, particles at true scale.
    """
    case = json.loads(run.attrs["case"])
    walls = walls_of(case)
    rows = {
        "before the discharge": PER_M * run["position_opening"].values,
        words_for(moments.half_time(run)): PER_M * run["position_half"].values,
    }
    sensor = PER_M * case["discharge"]["sensor"]
    limits = limits_of(run, case)
    frame = style.Frame(left=11, right=1, bottom=19, top=5)
    gaps = (3.0, 6.0)
    scale = (WIDTH - frame.left - frame.right - gaps[0]) / 2 / (limits[1] - limits[0])
    height = scale * (limits[3] - limits[2])
    figure = style.page(WIDTH, frame.bottom + 2 * height + gaps[1] + frame.top)
    axes = style.panels(figure, 2, 2, frame, gaps, sharex=True, sharey=True)
    for row, (moment, position) in zip(axes, rows.items(), strict=True):
        for panel, side in zip(row, SIDES, strict=True):
            draw_walls(panel, walls)
            resolution = scale * style.MM * style.IMAGE_DPI
            draw_particles(panel, run, position, by_size(run), side, limits, resolution)
            panel.set_title(f"{side}, {moment}", loc="left")
    _finish_axes(axes, limits)
    for panel in axes[0]:
        panel.plot(*mirrored(walls["gate"]), color=WALL, linewidth=1.2, zorder=3)
    for panel in axes[1]:
        outlet = walls["gate"][:, 0].max()
        panel.plot([-outlet, outlet], [sensor, sensor], color=WALL, linewidth=0.7, linestyle=":", zorder=3)
    draw_dimensions(axes[0, 0], walls, limits)
    draw_key(figure, case, scale)
    return figure


def words_for(half):
    """Words for the time (s) at which half of the mass had left, NaN if it never did."""
    return "never half discharged" if np.isnan(half) else f"at $M$ = 0.5, after {half:.2f} s"


def walls_of(case: Mapping) -> dict[str, np.ndarray]:
    """Profiles r, z (mm) of the walls of a case, by name."""
    return {name: PER_M * np.array(w, float) for name, w in case["walls"].items() if w is not None}


def limits_of(run: xr.Dataset, case: Mapping) -> tuple[float, float, float, float]:
    """Left, right, bottom and top (mm) of what is shown: particles, insert, and the way to the sensor.

    A filling that blew up has left no positions: then it is the height that the bed should have had.
    """
    walls, position = walls_of(case), PER_M * run["position_opening"].values
    widest = walls["hopper"][:, 0].max() + MARGIN
    heights = position[np.isfinite(position).all(axis=1), 2]
    # A few may still hop on the bed, or fly away.
    top = np.quantile(heights, 0.999) if len(heights) else PER_M * case["filling"]["level"]
    top = min(top, walls["hopper"][:, 1].max())
    if "insert" in walls:
        top = max(top, walls["insert"][:, 1].max())
    return -widest, widest, PER_M * case["discharge"]["sensor"] - 2 * MARGIN, top + 3 * MARGIN


def mirrored(profile):
    """A profile and its mirror image as one line, from the axis outwards on either side."""
    r, z = profile.T
    return np.concatenate([-r[::-1], r]), np.concatenate([z[::-1], z])


def draw_walls(axes: Axes, walls: Mapping) -> None:
    """Draw where the cut meets hopper and insert."""
    axes.add_patch(
        Polygon(np.column_stack(mirrored(walls["hopper"])), facecolor=INSIDE, edgecolor="none", zorder=0)
    )
    sides = np.array([[-1, 1], [1, 1]])
    for side in sides:
        axes.plot(*(walls["hopper"] * side).T, color=WALL, linewidth=1.2, zorder=3)
    if "insert" not in walls:
        return
    profile = walls["insert"]
    if is_solid(profile):
        closed = np.array_equal(profile[0], profile[-1])
        sections = [profile * side for side in sides] if closed else [np.column_stack(mirrored(profile))]
        for section in sections:
            axes.add_patch(Polygon(section, facecolor=SECTION, edgecolor="none", zorder=3))
    for side in sides:
        axes.plot(*(profile * side).T, color=WALL, linewidth=1.0, zorder=4)


def by_size(run: xr.Dataset) -> np.ndarray:
    """Colour (n, 3), RGB from 0 to 1, of each particle by its size class."""
    return np.array([to_rgb(COLOURS[name]) for name in outflow.SIZE_CLASSES])[run["size_class"].values]


def draw_particles(axes: Axes, run, position, colours, side, limits, resolution) -> AxesImage:
    """Draw the particles behind the cut.

    position (n, 3), mm; colours (n, 3); side: one of `SIDES`; limits: left, right, bottom, top (mm) of what
    is shown; resolution: pixels per mm.
    """
    image = picture(run, position, colours, side, limits, resolution)
    return axes.imshow(image, extent=limits, zorder=2, aspect="auto")


def picture(run, position, colours, side, limits, resolution) -> np.ndarray:
    """Image of the particles behind the cut, see spheres.render; arguments as for draw_particles."""
    order, sign, _ = SIDES[side]
    centre = position[:, order] * [1, 1, sign]
    # A particle that has left, or that blew up, has no finite position.
    shown = np.isfinite(centre).all(axis=1) & (centre[:, 2] >= 0)
    return spheres.render(
        centre[shown],
        PER_M * run["diameter"].values[shown] / 2,
        colours[shown],
        spheres.View._make((*limits, resolution)),
        depth=limits[1],
    )


def _finish_axes(axes, limits):
    for panel in axes[:, 0]:
        panel.set_ylabel("height $z$ (mm)")
    for panel, (_, _, name) in zip(axes[1], SIDES.values(), strict=True):
        panel.set_xlabel(f"${name}$ (mm)")
    for panel in axes.flat:
        panel.set_xlim(limits[:2])
        panel.set_ylim(limits[2:])
        panel.xaxis.set_major_locator(MaxNLocator(5))
        panel.yaxis.set_major_locator(MaxNLocator(6))


def draw_dimensions(axes: Axes, walls: Mapping, limits: Sequence[float]) -> None:
    """Draw the diameters of outlet and cylinder and the height of the insert (mm)."""
    outlet, widest = walls["gate"][:, 0].max(), walls["hopper"][:, 0].max()
    above, below = limits[3] - 2 * MARGIN, -1.5 * MARGIN
    dimension(axes, (-widest, above), (widest, above), f"⌀ {2 * widest:.3g} mm", (0, 1), "bottom")
    dimension(axes, (-outlet, below), (outlet, below), f"⌀ {2 * outlet:.3g} mm", (0, -1), "top")
    if "insert" in walls:
        r, height = walls["insert"][walls["insert"][:, 1].argmin()]
        dimension(axes, (-r, 0), (-r, height), f"{height:.3g} mm", (-2, 0), "center")


def dimension(axes, start, end, text, offset, align):
    """Draw a line with arrow heads at both ends, and its length beside the middle."""
    arrow = {"arrowstyle": "<|-|>,head_length=0.3,head_width=0.12", "color": style.INK, "linewidth": 0.6}
    line = axes.annotate("", end, start, zorder=6, arrowprops={**arrow, "shrinkA": 0, "shrinkB": 0})
    line.arrow_patch.set_path_effects(style.HALO)
    axes.annotate(
        text,
        ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2),
        offset,
        textcoords="offset points",
        ha={1: "left", 0: "center", -1: "right"}[np.sign(offset[0])],
        va=align,
        zorder=6,
        path_effects=style.HALO,
    )


def draw_key(figure: Figure, case: Mapping, scale: float) -> None:
    """Draw one particle of each size at true scale with its name, and the design in words, at the bottom."""
    width, height = style.size(figure)
    axes = figure.add_axes((0, 0, 1, 10 / height), xlim=(0, width), ylim=(0, 10))
    axes.set_axis_off()
    axes.text(11, 2.2, style.design_text(case["design"]), va="center_baseline")
    left = 11.0
    for name, diameter in zip(outflow.SIZE_CLASSES, case["particles"]["diameters"], strict=True):
        radius = scale * PER_M * diameter / 2
        axes.add_patch(Circle((left + radius, 7), radius, facecolor=COLOURS[name], edgecolor="none"))
        text = axes.text(left + 2 * radius + 1, 7, f"{name}, {PER_M * diameter:.3g} mm", va="center_baseline")
        left = axes.transData.inverted().transform_bbox(text.get_window_extent()).x1 + 3

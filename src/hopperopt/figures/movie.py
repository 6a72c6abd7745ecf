"""A discharge as a movie and as stills: the hopper cut open, particles coloured by size, speed or height."""

import json
import logging
import shutil
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from hopperopt import files, moments
from hopperopt.figures import hopper, style

WIDTH = 100.0  # mm in print
DPI = 150
FRAMES_PER_SECOND = 20
# What colours mean, and their map.
COLOURS = {
    "size": None,
    "speed": ("speed (m/s)", "viridis"),
    "height": ("height before the discharge (mm)", "cividis"),
}
HOW = "for a movie, simulate it with `simulation: {snapshot_interval_s: 0.02}` in the configuration"


def write(run: Path, stem: Path, colour: str, suffix: str) -> list[Path]:
    """Draw a run's file: the movie STEM.gif or STEM.mp4 and the stills STEM_opening.png, STEM_half.png.

    colour: a key of `COLOURS`. Returns what was written. A run without snapshots has no movie; the log says
    how to get one. Raises files.InputError for a file that holds no run, for speeds without snapshots, and
    for an MP4 where ffmpeg is not found.
    """
    if suffix == "mp4" and shutil.which("ffmpeg") is None:
        raise files.InputError("ffmpeg is not found, which an MP4 takes: install it, or ask for --format gif")
    dataset = moments.read(run)
    recorded = moments.snapshots(dataset)
    if colour == "speed" and not recorded:
        raise files.InputError(f"{run}: holds no snapshots and so no speeds; {HOW}")
    written = []
    for name, still in moments.stills(dataset).items():
        written.append(stem.with_name(f"{stem.name}_{name}.png"))
        style.save(draw(dataset, still, colour), written[-1:], DPI)
    if not recorded:
        logging.warning(f"{run} holds no snapshots; {HOW}")
        return written
    movie = stem.with_name(f"{stem.name}.{suffix}")
    _write_movie(dataset, recorded, colour, movie)
    return [movie, *written]


@style.styled
def draw(run: xr.Dataset, moment: moments.Moment, colour: str) -> Figure:
    """Draw one moment of a run as the front view of the cut hopper; colour: a key of `COLOURS`."""
    scene = _Scene(run, colour)
    scene.show(moment)
    return scene.figure


class _Scene:
    """The figure, and what changes from moment to moment."""

    def __init__(self, run, colour):
        case = json.loads(run.attrs["case"])
        self._run, self._colour, self._image = run, colour, None
        self._mass = run["diameter"].values ** 3
        self._limits = limits = hopper.limits_of(run, case)
        frame = style.Frame(left=11, right=2, bottom=21, top=5)
        scale = (WIDTH - frame.left - frame.right) / (limits[1] - limits[0])
        self.figure = style.page(WIDTH, frame.bottom + scale * (limits[3] - limits[2]) + frame.top)
        self._axes = style.panels(self.figure, 1, 1, frame, (0, 0))[0, 0]
        self._resolution = scale * style.MM * DPI
        self._axes.set(xlim=limits[:2], ylim=limits[2:], xlabel="$x$ (mm)", ylabel="height $z$ (mm)")
        hopper.draw_walls(self._axes, hopper.walls_of(case))
        if COLOURS[colour] is None:
            hopper.draw_key(self.figure, case, scale)
        else:
            self._draw_bar(case)

    def _draw_bar(self, case):
        meaning, name = COLOURS[self._colour]
        self._values = ScalarMappable(Normalize(*self._range()), colormaps[name])
        width, height = style.size(self.figure)
        place = self.figure.add_axes((11 / width, 9.5 / height, 30 / width, 2 / height))
        self.figure.colorbar(self._values, cax=place, orientation="horizontal").outline.set_visible(False)
        style.put(self.figure, 43, 10.5, meaning, va="center")
        style.put(self.figure, 11, 2.2, style.design_text(case["design"]), va="center_baseline")

    def _range(self):
        """Lowest and highest value that the colours tell apart; a few fast particles are out of it."""
        if self._colour == "speed":
            return 0.0, float(np.nanquantile(self._run["speed"].values, 0.99))
        heights = hopper.PER_M * self._run["position_opening"].values[:, 2]
        return float(np.nanmin(heights)), float(np.nanquantile(heights, 0.999))

    def _colours(self, moment):
        if self._colour == "size":
            return hopper.by_size(self._run)
        heights = hopper.PER_M * self._run["position_opening"].values[:, 2]
        return self._values.to_rgba(moment.speed if self._colour == "speed" else heights)[:, :3]

    def show(self, moment):
        """Show the particles of a moment in place of those before."""
        if self._image is not None:
            self._image.remove()
        colours = self._colours(moment)
        position = hopper.PER_M * moment.position
        self._image = hopper.draw_particles(
            self._axes, self._run, position, colours, "front view", self._limits, self._resolution
        )
        # NaN, what never left, is no part of it.
        left = self._mass[self._run["exit_time"].values <= moment.time].sum() / self._mass.sum()
        self._axes.set_title(f"$t$ = {moment.time:.2f} s, $M$ = {left:.2f}", loc="left")


@style.styled
def _write_movie(run, recorded, colour, path):
    kinds = {".gif": PillowWriter, ".mp4": FFMpegWriter}
    scene = _Scene(run, colour)
    with files.atomic(path) as temporary:
        writer = kinds[path.suffix](fps=FRAMES_PER_SECOND)
        with writer.saving(scene.figure, str(temporary), DPI):
            for moment in recorded:
                scene.show(moment)
                writer.grab_frame()

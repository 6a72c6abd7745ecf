"""Bulk: the settled bed before the opening.

Beds poured by the study's rain of spheres, five seeds of the centre design and five of the bare hopper, at
the study's step.

- Solid fraction of the core, two coarse diameters (8 mm) from walls, insert and surface: 0.56 to 0.60,
  where poured beds of frictional spheres lie; without friction it would be 0.64 or more. Measured as the
  share of random points (200,000 before those outside the core are dropped) that lie in spheres, so that
  spheres cut by the region's edge count as far as they are inside; standard error 0.002 for a bed.
- Overall solid fraction, the looser layers at walls and surface included: 0.53 to 0.58. All spheres over
  the volume below the surface, which is the mean, over cells one coarse diameter wide, of the highest top
  in the cell. The level that the study records is the mean of the highest tops of ten rings, each of many
  cells, and so 2 to 3 mm higher: the fraction below it is reported beside, and in the centre design it
  falls short of the range.
- Mixing: the mass fraction of fines in the core, in 16 layers and in 16 rings of equal volume, five beds
  together. A bed mixed at random departs from the core's mean by the counting noise sqrt(sum of c_s w_s²
  (δ_fs - m_f)²) / sum of c_s w_s, with number c_s and mass w_s of each class s. The rms over the bins is at
  most 1.5 times that (by chance 1 ± 0.18). So what segregates in the outflow does so during the outflow.
- The share of an experiment's computing time that filling and settling take. The aim of 40 % is not a
  matter of right or wrong and is not judged: a faster filling would have to leave beds like these. A column
  of solid fraction 0.3 instead of 0.2 does not: it is as well mixed and takes 41 % of the time, 40 % when it
  falls at 1 m/s instead of 0.5, but its core packs to 0.578 and 0.581 in the centre design (five seeds each)
  where these beds have 0.586. So the study keeps its rain.
"""

import numpy as np
from scipy.spatial import cKDTree

from hopperopt import geometry
from hopperopt.figures import style
from hopperopt.monitors import radii_at
from hopperopt.outflow import batch_fractions
from validation import experiments
from validation.report import Row, at_most

SEEDS = 5
POINTS = 200_000
BINS = 16


def measure(figures):
    """Rows: solid fractions, mixing in height and radius, share of filling."""
    study = experiments.study()
    centre = experiments.cases(study, experiments.centre(study), "coarse", SEEDS)
    bare = experiments.cases(study, None, "bare", SEEDS)
    for _, case in bare:
        case["discharge"]["time_limit"] = 0.0  # the bed is all that is asked for
    runs = experiments.run(centre + bare)
    rows, mixing = [], {}
    for name, cases, beds in (("centre design", centre, runs[:SEEDS]), ("bare hopper", bare, runs[SEEDS:])):
        walls = cases[0][1]["walls"]
        cores = [
            Core(run["position_opening"].astype(float), run["diameter"], walls, float(run["filling_level"]))
            for run in beds
        ]
        rows += _fraction_rows(name, walls, beds, cores)
        mixing[name] = [Mixing(cores, along) for along in (Core.heights, Core.radii)]
        rows += _mixing_rows(name, cores, mixing[name])
    rows += _filling_rows(runs[:SEEDS])
    if figures is not None:
        batch = batch_fractions(runs[0]["diameter"], runs[0]["size_class"])[0]
        _draw(mixing, batch, figures / "bulk.png")
    return rows


class Core:
    """Random points in the core of a settled bed, and which of the size classes each lies in (-1: none)."""

    def __init__(self, position, diameter, walls, level):
        self.diameters = np.unique(diameter)
        margin = 2 * self.diameters[-1]
        generator = np.random.default_rng(1)
        radius, top = walls["hopper"][-1][0], level - margin
        r = radius * np.sqrt(generator.random(POINTS))
        angle, z = 2 * np.pi * generator.random(POINTS), top * generator.random(POINTS)
        inside = _free(np.column_stack([r, z]), walls, margin)
        self.volume = inside.mean() * np.pi * radius**2 * top
        self.point = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])[inside]
        self.size_class = self._classes(position, diameter)

    def _classes(self, position, diameter):
        found = np.full(len(self.point), -1)
        for k, own in enumerate(self.diameters):
            tree = cKDTree(position[diameter == own])
            distance, _ = tree.query(self.point, distance_upper_bound=own / 2)
            found[np.isfinite(distance)] = k
        return found

    @property
    def solid_fraction(self):
        """Share of the points that lie in spheres."""
        return np.mean(self.size_class >= 0)

    def heights(self):
        """Heights of the points (m)."""
        return self.point[:, 2]

    def radii(self):
        """Distances of the points from the axis (m)."""
        return np.hypot(self.point[:, 0], self.point[:, 1])


def _free(meridian, walls, margin):
    """Which points r, z (n, 2) lie in the vessel, outside the insert and `margin` (m) from every wall."""
    r, z = meridian.T
    free = r < np.interp(z, *np.array(walls["hopper"]).T[::-1])
    if walls["insert"] is not None:
        free &= r > radii_at(walls["insert"], z)[1]
    for profile in walls.values():
        if profile is not None:
            free &= _distance(meridian, np.array(profile)) >= margin
    return free


def _distance(points, profile):
    """Distance (m) of points (n, 2) from a polyline."""
    start, along = profile[:-1], np.diff(profile, axis=0)
    offset = points[:, None] - start
    share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    return np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1)


def overall_fraction(run, walls, level):
    """Solid fraction of the whole bed below a level (m)."""
    hopper, insert = np.array(walls["hopper"]), walls["insert"]
    volume = geometry.volume_inside(hopper, level)
    if insert is not None:
        volume -= geometry.solid_volume(np.array(insert), level)
    return np.pi / 6 * np.sum(run["diameter"] ** 3) / volume


def surface(run, radius):
    """Height (m) of the surface: mean over cells one coarse diameter wide of the highest resting top."""
    position, own = run["position_opening"].astype(float), run["diameter"] / 2
    cell = 2 * own.max()
    one, other = cKDTree(position).query_pairs(cell, output_type="ndarray").T
    touching = np.linalg.norm(position[one] - position[other], axis=1) < own[one] + own[other]
    resting = np.zeros(len(own), dtype=bool)
    resting[one[touching]] = resting[other[touching]] = True
    count = int(2 * radius / cell)
    column = np.floor((position[:, :2] + radius) / cell).astype(int).clip(0, count - 1)
    tops = np.zeros((count, count))
    np.maximum.at(tops, tuple(column[resting].T), (position[:, 2] + own)[resting])
    middle = (np.arange(count) + 0.5) * cell - radius
    return tops[np.hypot(*np.meshgrid(middle, middle)) < radius - cell / 2].mean()


def _fraction_rows(name, walls, beds, cores):
    radius = walls["hopper"][-1][0]
    core = np.array([core.solid_fraction for core in cores])
    below = [overall_fraction(run, walls, surface(run, radius)) for run in beds]
    level = [overall_fraction(run, walls, float(run["filling_level"])) for run in beds]
    low, high = core.min(), core.max()
    return [
        _between(f"core solid fraction, {name}, mean of {SEEDS} seeds", 0.56, 0.60, core.mean()),
        Row(f"its range over the seeds; volume of the core, {name}", "",
            f"{low:.4f} to {high:.4f}; {1e6 * cores[0].volume:.0f} cm³", "", True),
        _between(f"overall solid fraction, {name}", 0.53, 0.58, np.mean(below)),
        Row(f"the same below the study's level, {name}", "", f"{np.mean(level):.4f}", "", True),
    ]  # fmt: skip


def _between(test, low, high, value):
    return Row(test, f"{low:.2f} to {high:.2f}", f"{value:.4f}", "bound", bool(low <= value <= high))


class Mixing:
    """Mass fraction of fines in bins of equal volume along one coordinate, and its counting noise."""

    def __init__(self, cores, along):
        places = [along(core) for core in cores]
        self.edges = np.quantile(np.concatenate(places), np.linspace(0, 1, BINS + 1))
        self.middle = (self.edges[1:] + self.edges[:-1]) / 2
        volume = sum(self._solid(*pair) for pair in zip(cores, places, strict=True))
        sphere = np.pi / 6 * cores[0].diameters[:, None] ** 3
        self.fines = volume[0] / volume.sum(axis=0)
        self.mean = volume[0].sum() / volume.sum()
        away = np.array([1.0, 0.0, 0.0])[:, None] - self.fines
        self.noise = np.sqrt((volume * sphere * away**2).sum(axis=0)) / volume.sum(axis=0)

    def _solid(self, core, place):
        """Volume (m3) of each class in each bin of a bed."""
        points = [np.histogram(place[core.size_class == k], self.edges)[0] for k in range(3)]
        return np.array(points) * core.volume / len(place)

    @property
    def ratio(self):
        """Rms departure from the core's mean over what counting gives."""
        return np.sqrt(np.mean((self.fines - self.mean) ** 2) / np.mean(self.noise**2))


def _mixing_rows(name, cores, mixing):
    rows = [
        at_most(f"m_f against {words}, {name}: rms departure over counting noise", 1.5, one.ratio)
        for words, one in zip(("height", "radius"), mixing, strict=True)
    ]
    return [*rows, Row(f"m_f of the core, {name}", "", f"{mixing[0].mean:.4f}", "", True)]


def _filling_rows(runs):
    share = 100 * np.array([float(run["filling_share"]) for run in runs])
    text = f"{share.mean():.0f} % ({share.min():.0f} to {share.max():.0f})"
    return [Row("filling's share of the computing time, centre design", "below 40 %", text, "", True)]


@style.styled
def _draw(mixing, batch, path):
    """m_f against height and radius in both beds, with twice the counting noise."""
    page = style.page(style.PAGE, 70)
    axes = style.panels(page, 1, 2, style.Frame(14, 3, 11, 9), (8, 0), sharey=True)[0]
    shown = {"centre design": ("#0072B2", "o", -0.2), "bare hopper": ("#D55E00", "s", 0.2)}
    for k, words in enumerate(("height above the outlet / mm", "distance from the axis / mm")):
        for name, (colour, mark, shift) in shown.items():
            one, look = mixing[name][k], {"color": colour, "marker": mark, "linestyle": "none"}
            axes[k].errorbar(1000 * one.middle + shift, one.fines, 2 * one.noise, elinewidth=0.7, **look)
        axes[k].axhline(batch, color=style.FAINT, zorder=0)
        axes[k].set(xlim=(0, None), ylim=(0.05, 0.11), xlabel=words)
    axes[0].set_ylabel("mass fraction of fines in the core")
    meanings = {
        name: {"color": colour, "marker": mark, "linestyle": "none"}
        for name, (colour, mark, _) in shown.items()
    }
    style.key(page, meanings | {"batch": {"color": style.FAINT}}, (14, 68))
    style.put(page, style.PAGE - 3, 68, "bars: two standard deviations of counting", ha="right", va="top")
    style.save(page, [path], 150)

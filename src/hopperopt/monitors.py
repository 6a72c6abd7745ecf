"""What is watched while a simulation runs: energy, spheres outside the walls, the flow pattern."""

from itertools import pairwise

import numpy as np

# What the monitors may reach in a run that counts.
MAX_OVERLAP, MAX_SPEED_RATIO, MAX_ENERGY_GAIN = 0.3, 2.0, 0.01
MIN_SPHERES = 20  # fewer per sample in either region, and the mass-flow index is not told
FLOW_BAND = (0.030, 0.060)  # m above the outlet
FLOW_SHARE = (0.05, 0.35)  # of the mass discharged
LEVEL_RINGS = 10


class EnergyWatch:
    """Largest gain of mechanical energy over an earlier sample, relative to the potential energy released."""

    def __init__(self, energies):
        kinetic, self._potential, elastic = energies
        self.least = kinetic + self._potential + elastic
        self.gain = 0.0

    def sample(self, energies):
        """Take the (kinetic, gravitational, elastic) energies of a sample, J."""
        kinetic, potential, elastic = energies
        total = kinetic + potential + elastic
        released = self._potential - potential
        if total > self.least and released > 0.0:
            self.gain = max(self.gain, (total - self.least) / released)
        self.least = min(self.least, total)


class Envelope:
    """The hopper's inside: counts the spheres whose centre was ever seen outside it."""

    def __init__(self, profile, count):
        self._r, self._z = np.asarray(profile, dtype=float).T
        self.outside = np.zeros(count, dtype=bool)

    def sample(self, position, gate_closed):
        """Look at positions (n, 3) by identity, m; NaN rows (spheres that left) are passed over.

        Below the outlet there is no wall, so a sphere there is outside only while the gate is closed.
        """
        r, z = np.hypot(position[:, 0], position[:, 1]), position[:, 2]
        beside = (r > np.interp(z, self._z, self._r)) & (z >= self._z[0])
        below = (z < self._z[0]) if gate_closed else False
        self.outside |= beside | (z > self._z[-1]) | below

    @property
    def lost(self):
        """Spheres seen outside so far."""
        return int(np.count_nonzero(self.outside))


def radii_at(profile, z):
    """Inner and outer radii (m) of a revolved profile at heights z (n,); a body on the axis begins there.

    0 and 0 where the profile is not; it may be None.
    """
    inner, outer = np.full(len(z), np.inf), np.zeros(len(z))
    for (r1, z1), (r2, z2) in pairwise(profile or ()):
        low, high = min(z1, z2), max(z1, z2)
        share = (z - z1) / (z2 - z1) if z2 != z1 else np.zeros(len(z))
        inside = (z >= low) & (z <= high)
        r = r1 + share * (r2 - r1)
        inner = np.minimum(inner, np.where(inside, r, np.inf))
        outer = np.maximum(outer, np.where(inside, r, 0.0))
    on_axis = any(r == 0.0 for r, _ in profile or ())
    return np.where(np.isfinite(inner) & (not on_axis), inner, 0.0), outer


class FlowPattern:
    """Mass-flow index: mean downward speed at the cylinder wall over that at the axis.

    The wall's region is one coarse diameter wide; the axis' region reaches two coarse diameters from the
    axis, or from the insert where that occupies the axis. Averaged over the samples taken.
    """

    def __init__(self, case):
        self._coarse = case["particles"]["diameters"][-1]
        self._insert = case["walls"]["insert"]
        self._wall_radius = case["walls"]["hopper"][-1][0]
        self.sums, self.counts, self.samples = np.zeros(2), np.zeros(2), 0

    def sample(self, position, velocity, share):
        """Take positions and velocities (n, 3) at a discharged mass fraction; NaN rows are passed over."""
        if not FLOW_SHARE[0] <= share <= FLOW_SHARE[1]:
            return
        inside = (position[:, 2] >= FLOW_BAND[0]) & (position[:, 2] <= FLOW_BAND[1])
        x, y, z = position[inside].T
        r, down = np.hypot(x, y), -velocity[inside, 2]
        near_wall = r > self._wall_radius - self._coarse
        inner, outer = radii_at(self._insert, z)
        near_axis = r - np.where(inner > 0.0, 0.0, outer) < 2.0 * self._coarse  # a ring leaves the axis free
        for k, region in enumerate((near_wall, near_axis)):
            self.sums[k] += down[region].sum()
            self.counts[k] += np.count_nonzero(region)
        self.samples += 1

    @property
    def index(self):
        """The index; NaN with fewer than 20 spheres per sample in either region."""
        if not self.samples or self.counts.min() < MIN_SPHERES * self.samples:
            return np.nan
        wall, axis = self.sums / self.counts
        return float(wall / axis) if axis else np.nan


def filling_level(position, radius, contacts, case):
    """Height of the bed's top, m: mean over ten rings of equal area of the highest sphere top.

    Spheres with fewer than two contacts are in flight and no part of the bed. Rings that the insert covers at
    the level asked for, be it in part, are left out, as are empty ones.

    Arguments: positions (n, 3) and radii (n,), m; contacts of each sphere (n,); the case.
    """
    resting = contacts >= 2
    position, tops = position[resting], (position[:, 2] + radius)[resting]
    cylinder = case["walls"]["hopper"][-1][0]
    (inner,), (outer,) = radii_at(case["walls"]["insert"], np.array([case["filling"]["level"]]))
    edges = cylinder * np.sqrt(np.arange(LEVEL_RINGS + 1) / LEVEL_RINGS)
    ring = np.searchsorted(edges, np.hypot(position[:, 0], position[:, 1]), side="right") - 1
    free = [k for k in range(LEVEL_RINGS) if edges[k] >= outer or edges[k + 1] <= inner]
    heights = [tops[ring == k].max() for k in free if np.any(ring == k)]
    return float(np.mean(heights)) if heights else np.nan

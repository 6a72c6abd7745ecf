"""Input of LIGGGHTS 3.8, another DEM code, which shares a bed among the processes of MPI.

Walls of revolution become triangles, with the radii stretched so that the polygon has the circle's area.
Lengths in m, times in s.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hopperopt.dem.materials import youngs_modulus

FACETS = 72  # of a full turn, or more
BULGE = 0.05  # of the smallest radius: the most that the middle of a facet lies inside its corners' circle
SKIN = 0.8  # of the neighbour lists, over the smallest radius: the fastest of a few in the hopper
RIGID = 1.0e6  # times the spheres' modulus: that of a wall whose own is infinite
SOFT, HARD = 5.0e6, 1.0e9  # Pa, Young's moduli beyond which LIGGGHTS wants to be told that they are meant
ROLLING = {"none": "", "cdt": " rolling_friction cdt"}


@dataclass
class Scene:
    """What is exported; SI units. `sphere` and `wall` are (shear modulus, Poisson's ratio), `pair`
    and `touch` (restitution, friction, rolling friction) of spheres with each other and with walls."""

    position: np.ndarray  # (n, 3)
    velocity: np.ndarray  # (n, 3)
    radius: np.ndarray  # (n,)
    density: float
    walls: dict  # name -> revolved profile (points, 2); "gate" is taken away at the opening
    sphere: tuple
    wall: tuple
    pair: tuple
    touch: tuple
    rolling: str
    gravity: float = 9.81

    @classmethod
    def of_case(cls, case):
        """The start of an experiment, whose case says all of it."""
        from hopperopt.experiment import build  # and numba, whose cache has to be named before

        simulation = build(case)
        spheres, particles, contact = simulation.spheres, case["particles"], case["contact"]
        constants = ("restitution", "static_friction", "rolling_friction")
        return cls(
            simulation.by_identity(spheres.position),
            simulation.by_identity(spheres.velocity),
            0.5 * np.repeat(particles["diameters"], particles["counts"]),
            particles["density"],
            {name: np.array(points) for name, points in case["walls"].items() if points is not None},
            (particles["shear_modulus"], particles["poisson_ratio"]),
            (case["wall"]["shear_modulus"], case["wall"]["poisson_ratio"]),
            tuple(contact["particle"][name] for name in constants),
            tuple(contact["wall"][name] for name in constants),
            contact["rolling"],
            case["gravity"],
        )

    def deck(self, time_step, sensor=None, skin=SKIN):
        """LIGGGHTS' input as file name -> text, up to the first step: `in.start` is the script.

        With a `sensor` (height in m) its mesh is there too, for `opening`. `skin` is that of the neighbour
        lists over the smallest radius: it changes the speed and nothing else.
        """
        reach = max(points[:, 0].max() for points in self.walls.values())
        facets = self._facets(reach)
        files = {f"{name}.stl": stl(points, facets) for name, points in self.walls.items()}
        meshes = [f"fix {name} all mesh/surface file {name}.stl type 2" for name in self.walls]
        if sensor is not None:
            files["sensor.stl"] = stl(np.array([[0.0, sensor], [2.0 * reach, sensor]]), facets)
            meshes.append("fix sensor all mesh/surface/planar file sensor.stl type 2")
        files["spheres.data"] = self._data(2.5 * reach, sensor or 0.0)
        files["in.start"] = "\n".join(
            [self._materials(time_step, skin), *meshes, self._touch(self.walls), ""]
        )
        return files

    def opening(self):
        """Script lines that take the gate away, start the clock anew, and write down and remove what crosses
        the sensor. LIGGGHTS has one set of walls at a time, so all springs at walls are forgotten."""
        still = self._touch([name for name in self.walls if name != "gate"])
        counting = "vec_side 0. 0. -1. count once file outflow.txt writeTime delete_atoms yes"
        return f"""unfix touch
unfix gate
{still}
fix out all massflow/mesh mesh sensor {counting}
reset_timestep 0
"""

    def _touch(self, names):
        meshes = f"n_meshes {len(names)} meshes {' '.join(names)}"
        return f"fix touch all wall/gran {self._model} mesh {meshes}"

    def _facets(self, reach):
        """Facets of a turn: more of them for a wall whose radius `reach` is large beside the spheres."""
        return max(FACETS, math.ceil(math.pi / math.acos(1.0 - BULGE * self.radius.min() / reach)))

    @property
    def _model(self):
        return "model hertz tangential history" + ROLLING[self.rolling]

    def _materials(self, time_step, skin):
        sphere, wall = youngs_modulus(*self.sphere), youngs_modulus(*self.wall)
        moduli = [sphere, wall if math.isfinite(wall) else RIGID * sphere]
        constants = [
            ("youngsModulus", "", moduli),
            ("poissonsRatio", "", [self.sphere[1], self.wall[1]]),
        ]
        for k, name in enumerate(
            ("coefficientRestitution", "coefficientFriction", "coefficientRollingFriction")
        ):
            pair, touch = self.pair[k], self.touch[k]
            constants.append((name, "pair 2", [pair, touch, touch, touch]))
        properties = [
            f"fix m{k} all property/global {name} peratomtype{kind} {' '.join(f'{v:.9g}' for v in values)}"
            for k, (name, kind, values) in enumerate(constants)
        ]
        meant = [*(["soft_particles yes"] if min(moduli) < SOFT else []),
                 *(["hard_particles yes"] if max(moduli) > HARD else [])]  # fmt: skip
        return "\n".join([
            "atom_style granular", "atom_modify map array", "boundary f f f", "newton off",
            "communicate single vel yes", "units si", *meant, "read_data spheres.data",
            f"neighbor {skin * self.radius.min():.6g} bin", "neigh_modify delay 0", *properties,
            f"pair_style gran {self._model}", "pair_coeff * *", f"timestep {time_step:.9g}",
            f"fix weight all gravity {self.gravity:.9g} vector 0 0 -1", "fix move all nve/sphere",
            "compute kinetic all ke", "thermo_style custom step atoms c_kinetic cpu", "thermo 1000",
            "thermo_modify lost ignore norm no",
        ])  # fmt: skip

    def _data(self, side, lowest):
        """Box, spheres and velocities as LIGGGHTS' read_data wants them."""
        top = max(points[:, 1].max() for points in self.walls.values())
        top = max(top, (self.position[:, 2] + 2.0 * self.radius).max())
        low = lowest - 10.0 * self.radius.max()
        box = [f"{-side:.6g} {side:.6g} {axis}lo {axis}hi" for axis in "xy"]
        head = [f"{len(self.radius)} atoms", "2 atom types", *box, f"{low:.6g} {1.05 * top:.6g} zlo zhi"]
        atoms = [
            f"{i} 1 {2 * r:.9g} {self.density:.9g} {p[0]:.9e} {p[1]:.9e} {p[2]:.9e}"
            for i, (r, p) in enumerate(zip(self.radius, self.position, strict=True), 1)
        ]
        speeds = [f"{i} {v[0]:.9e} {v[1]:.9e} {v[2]:.9e} 0 0 0" for i, v in enumerate(self.velocity, 1)]
        return "\n".join(["Spheres\n", *head, "\nAtoms\n", *atoms, "\nVelocities\n", *speeds, ""])


def look(name):
    """Script lines that write the spheres as they are to the file `name`."""
    return f"""dump look all custom 1 {name} id x y z radius
dump_modify look first yes
run 0
undump look
"""


def stl(profile, facets=FACETS):
    """A revolved profile, (points, 2) of r and z in m, as triangles in the text form of STL."""
    turn = 2.0 * math.pi / facets
    stretch = math.sqrt(turn / math.sin(turn))
    angle = turn * np.arange(facets + 1)
    cosine, sine = stretch * np.cos(angle), stretch * np.sin(angle)
    lines = ["solid wall"]
    for (r1, z1), (r2, z2) in pairwise(np.asarray(profile, dtype=float)):
        for k in range(facets):
            a, b, c, d = ((r * cosine[j], r * sine[j], z) for r, z, j in
                          ((r1, z1, k), (r1, z1, k + 1), (r2, z2, k + 1), (r2, z2, k)))  # fmt: skip
            for corners, radius in (((a, b, c), r1), ((a, c, d), r2)):
                if radius > 0.0:
                    lines += ["facet normal 0 0 0", "outer loop"]
                    lines += [f"vertex {x:.9e} {y:.9e} {z:.9e}" for x, y, z in corners]
                    lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid wall", ""])

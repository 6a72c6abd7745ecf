"""A simulation as input of LIGGGHTS, for beds that take more than one machine.

The script fills, waits until the bed is at rest, opens and discharges, by the criteria of `experiment.py`.
"""

import json
import logging
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from hopperopt import files, moments, provenance

SCRIPT = "in.hopper"
STEP_SHARE = 0.4  # of the Rayleigh time of the smallest sphere: LIGGGHTS loses spheres at 0.7
LEAST_RESTITUTION = 0.05  # what LIGGGHTS takes is above it


def settled(run: Path) -> tuple[dict, np.ndarray]:
    """The case of a run's file and the positions (n, 3) in m of its spheres when the gate opened.

    Raises files.InputError where the file holds no run, or one that never came to the opening.
    """
    dataset = moments.read(run)
    position = dataset["position_opening"].values.astype(float)
    if not np.isfinite(position).all():
        raise files.InputError(f"{run}: the simulation did not reach the opening, so there is no settled bed")
    return json.loads(dataset.attrs["case"]), position


def write(case: Mapping, folder: Path, bed: np.ndarray | None = None) -> None:
    """Write a case into a folder: walls as meshes, the spheres, and the script `in.hopper`.

    bed: positions (n, 3) in m of spheres at rest to begin with; without, the falling column. Raises
    files.InputError where LIGGGHTS does not take a number of the case; warns of what it knows differently.
    """
    provenance.use_numba_cache()
    from hopperopt.dem.materials import rayleigh_time
    from hopperopt.experiment import SAMPLE_TIME, SETTLED_ENERGY
    from hopperopt.liggghts import Scene, look

    _check(case)
    scene = Scene.of_case(case)
    if bed is not None:
        scene = replace(scene, position=bed, velocity=np.zeros_like(bed))
    if scene.rolling == "edem":
        scene.rolling = "cdt"
        logging.warning(
            "contact.rolling: LIGGGHTS does not know edem; cdt takes its place, with which a bed is denser "
            "and empties faster (docs/validation.md: 3 % lower, 5 % faster)"
        )
    particles = case["particles"]
    material = (particles["density"], particles["shear_modulus"], particles["poisson_ratio"])
    step = min(case["time_step"], STEP_SHARE * rayleigh_time(scene.radius.min(), *material))
    step = float(f"{step:.3g}")
    deck = scene.deck(step, case["discharge"]["sensor"])
    mass = material[0] * 4.0 / 3.0 * math.pi * scene.radius**3
    rest = SETTLED_ENERGY * mass.sum() * case["gravity"] * 2.0 * scene.radius.mean()
    looking = 2.0 * SAMPLE_TIME
    deck[SCRIPT] = "".join(
        [
            _heading(case, len(scene.radius), bed is not None),
            deck.pop("in.start"),
            _until_at_rest(rest, looking, case["filling"]["settling_limit"], step),
            look("opening.txt"),
            scene.opening(),
            _until_empty(case["discharge"], step),
        ]
    )
    for name, text in deck.items():
        with files.atomic(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")


def _check(case: Mapping) -> None:
    for name in ("particle", "wall"):
        value = case["contact"][name]["restitution"]
        if value <= LEAST_RESTITUTION:
            raise files.InputError(
                f"contact.{name}.restitution: {value:g} is not allowed; allowed: "
                f"a number above {LEAST_RESTITUTION:g}, as LIGGGHTS takes no other"
            )


def _heading(case: Mapping, spheres: int, at_rest: bool) -> str:
    design = ", ".join(f"{name} {value:g}" for name, value in case["design"].items()) or "bare hopper"
    start = "a settled bed" if at_rest else "a falling column"
    return f"""\
# {spheres} spheres, {start}; {design}; seed {case["seed"]}; SI units. By hopperopt {provenance.version()}.
#   mpirun -np 16 liggghts -in {SCRIPT}
# opening.txt: positions and radii at the opening; outflow.txt (of several processes outflow.txt.0, ...): time
# from the opening and diameter of each sphere that left, in the second and third column.
processors * * 1 # the bed is at the bottom: all processes share its cross-section
"""


def _until_at_rest(energy: float, looking: float, limit: float, step: float) -> str:
    """Script lines that run until the kinetic energy (J) is spent, looking each so many s."""
    return f"""\
# Fill until the bed is at rest, for {limit:g} s at most.
variable energy equal c_kinetic
variable look loop {math.ceil(limit / looking)}
label filling
run {round(looking / step)}
if "${{energy}} < {energy:.6g}" then "jump SELF opening"
next look
jump SELF filling
print "The bed is not at rest after {limit:g} s."
label opening
variable look delete
"""


def _until_empty(limits: Mapping, step: float) -> str:
    """Script lines that run until the hopper is empty, or nothing leaves, or the time is over."""
    idle, most = limits["idle_limit"], limits["time_limit"]
    return f"""\
# Discharge until nothing leaves for {idle:g} s, for {most:g} s at most.
variable left equal atoms
variable look loop {math.ceil(most / idle)}
label discharge
variable before equal ${{left}}
run {round(idle / step)}
if "${{left}} == 0 || ${{left}} == ${{before}}" then "jump SELF end"
next look
jump SELF discharge
label end
print "${{left}} spheres are left."
"""

"""What a simulation costs, estimated from its case before it runs: time steps, time and memory.

The simulated times are fitted to runs of two hoppers, the study's (15,000 particles) and the reduced one's
(3,100), with and without inserts, which hardly matter: steps come out within 10 %, particle-steps within 15 %
of single runs. Speeds and memory were measured on one core; see benchmarks/README.md.
"""

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from hopperopt import geometry

SETTLING = 0.2  # s, from the last particle's fall to the bed at rest: 0.14 to 0.23 were measured
# Beverloo's law W = C rho_b sqrt(g) (D - k d)^2.5 with Beverloo's C and the k of docs/validation.md. A
# discharge takes 1.35 times the batch's mass over W: the measured C is smaller, the last ones leave slowly.
BEVERLOO_C, BEVERLOO_K, DISCHARGE = 0.58, 1.8, 1.35
BED = 0.55  # solid fraction of a bed at rest
IN_DISCHARGE = 0.5  # of the particles, the mean number that is left while the hopper empties
SPEEDS = 11e6, 5e6  # particle-steps per second: one core of a fast machine, of a slow or busy one
START = 4.0  # s, Python and its libraries
MEMORY = 250.0, 0.0013  # MB: the program (200 more where it compiles), and each particle
SNAPSHOT = 4e-5  # MB for each particle of a snapshot
GRANTED = 4  # times what a simulation takes on a slow machine, for those that flow for longer


class Cost(NamedTuple):
    """What one simulation is expected to take."""

    particles: int
    steps: float
    particle_steps: float
    memory_mb: float

    @property
    def seconds(self) -> tuple[float, float]:
        """Time (s) on one core of a fast and of a slow machine."""
        fast, slow = (START + self.particle_steps / speed for speed in SPEEDS)
        return fast, slow


def expected(case: Mapping, snapshot_interval: float | None = None) -> Cost:
    """Cost of a case (see `case.simulation`), with memory for snapshots (interval in s) up to its limit."""
    particles = sum(case["particles"]["counts"])
    filling, discharge = _filling_time(case, particles), _discharge_time(case)
    steps = (filling + discharge) / case["time_step"]
    worked = particles * (filling + IN_DISCHARGE * discharge) / case["time_step"]
    program, each = MEMORY
    if snapshot_interval is not None:
        each += SNAPSHOT * case["discharge"]["time_limit"] / snapshot_interval
    return Cost(particles, steps, worked, program + each * particles)


def granted(costs: Iterable[Cost]) -> dict[str, int]:
    """Memory (MB) and time (minutes) that are enough for any of some simulations, with a margin."""
    costs = list(costs)
    slow = max(cost.seconds[1] for cost in costs)
    memory = max(cost.memory_mb for cost in costs)
    return {"mem_mb": 500 + math.ceil(2 * memory), "runtime": 10 + math.ceil(GRANTED * slow / 60)}


def _filling_time(case, particles):
    """Time (s) in which the highest particle falls to the bed's surface and the bed settles."""
    filling, sphere = case["filling"], _mean_volume(case)
    section = math.pi * filling["column_radius"] ** 2
    top = filling["column_bottom"] + particles * sphere / filling["solid_fraction"] / section
    speed, gravity = filling["speed"], case["gravity"]
    fall = (math.sqrt(speed**2 + 2 * gravity * max(top - filling["level"], 0)) - speed) / gravity
    return min(fall + SETTLING, filling["settling_limit"])


def _discharge_time(case):
    """Time (s) in which the batch leaves, at most the limit."""
    particles, limit = case["particles"], case["discharge"]["time_limit"]
    width = 2 * max(r for r, _ in case["walls"]["gate"])
    free = width - BEVERLOO_K * sum(particles["diameters"]) / len(particles["diameters"])
    if free <= 0:
        return limit
    volume_rate = BEVERLOO_C * BED * math.sqrt(case["gravity"]) * free**2.5
    return min(DISCHARGE * sum(particles["counts"]) * _mean_volume(case) / volume_rate, limit)


def _mean_volume(case):
    return geometry.mean_sphere(case["particles"]["diameters"])

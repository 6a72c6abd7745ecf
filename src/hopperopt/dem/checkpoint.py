"""The evolving state of a simulation as plain arrays: what a checkpoint holds of the solver.

One table names every field that a run changes. Reading, writing back and comparing a state all walk that
table, and a test finds the field that is in none of the tables.
"""

from operator import attrgetter

import numpy as np

from hopperopt.dem.state import grown

# Attributes of a `Simulation`. All that the next step reads, and all that can be asked between two steps.
EVOLVING = (
    "spheres.place", "spheres.motion", "spheres.mass", "spheres.identity", "spheres.sums", "spheres.anchor",
    "pairs.start", "pairs.partner", "pairs.owner", "pairs.touched", "pairs.spring",
    "touches.start", "touches.owner", "touches.surface", "touches.first", "touches.last", "touches.element",
    "touches.spring",
    "chunks.first", "chunks.reach", "chunks.window", "chunks.wall_force",
    "walls.segments", "walls.profile", "walls.closed",  # change where a wall is taken away
    "settings.sensor", "exit_time", "counters", "monitors",
)  # fmt: skip
# Written before it is read within each call of `Simulation.advance`.
SCRATCH = (
    "pairs.contact", "pairs.carried", "pairs.carried_spring", "touches.carried", "touches.carried_spring",
    "chunks.block", "chunks.seen",
)  # fmt: skip
# Follows from the arguments of `Simulation`, the threads aside, which change no bit.
FIXED = (
    "walls.point", "walls.along", "walls.length2", "walls.ends", "walls.surface_start", "wall_names",
    "settings.time_step", "settings.gravity", "settings.rolling", "settings.skin", "settings.horizon",
    "settings.skin_limit", "settings.start_speed2", "settings.highest", "laws.pair", "laws.wall", "threads",
)  # fmt: skip


def read(owner, fields):
    """Values of an object's fields (dotted names), arrays by name. They are no copies."""
    return {name: np.asarray(attrgetter(name)(owner)) for name in fields}


def write(owner, fields, state):
    """Give an object's fields the values of a state, arrays by name as `read` returns them."""
    for name in fields:
        path, _, field = name.rpartition(".")
        holder = attrgetter(path)(owner) if path else owner
        is_array, value = isinstance(getattr(holder, field), np.ndarray), state[name]
        if not isinstance(holder, tuple):
            setattr(holder, field, value if is_array else value.tolist())
        elif is_array:
            getattr(holder, field)[...] = value  # in their place, where the rows are aligned
        else:
            setattr(owner, path, holder._replace(**{field: value.tolist()}))


def restore(simulation, state):
    """Bring a simulation to a state of one that was built from the same arguments."""
    for name in ("pairs", "touches"):
        entries, capacity = getattr(simulation, name), len(state[f"{name}.spring"])
        if capacity != len(entries.spring):
            setattr(simulation, name, grown(entries, capacity))
    write(simulation, EVOLVING, state)

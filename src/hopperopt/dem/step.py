"""One step of the scheme, and the compiled time loop, on one thread or on several."""

from numba import njit, prange

from hopperopt.dem.contacts import clear_overlaps, note_overlaps, pair_forces, wall_forces
from hopperopt.dem.integrate import add_windows, clear_sums, conclude, kick_and_drift, take_out
from hopperopt.dem.neighbours import carry_pairs, divide, drop_parked, rebuild_pairs
from hopperopt.dem.state import CHUNKS, COUNT, MOST_CHUNKS, PAIR_CARRIED, REBUILDS, STALE, TOUCH_CARRIED
from hopperopt.dem.walls import carry_touches, rebuild_touches

DONE, PAIRS_FULL, TOUCHES_FULL, NOT_FINITE = range(4)
NOTHING_CARRIED = -1
FAR = 1.0e9  # m, m/s: what is no number or beyond stops the run before it indexes a cell


@njit(cache=True)
def rebuild(spheres, pairs, touches, walls, chunks, counters, settings):
    """New lists in a new order, histories carried through. Returns DONE or what stopped it.

    After PAIRS_FULL or TOUCHES_FULL it goes on where it stopped, once the list has grown.
    """
    for i in range(counters[COUNT]):
        for a in range(3):
            if not (abs(spheres.place[i, a]) < FAR and abs(spheres.motion[i, a]) < FAR):
                return NOT_FINITE
    if counters[PAIR_CARRIED] == NOTHING_CARRIED:
        carry_pairs(spheres, pairs, counters)
        carry_touches(spheres, touches, counters)
        drop_parked(spheres, counters)
    if counters[COUNT] == 0:
        counters[STALE] = counters[CHUNKS] = 0
        return DONE
    if not rebuild_pairs(spheres, pairs, counters, settings):
        return PAIRS_FULL
    if not rebuild_touches(spheres, touches, walls, counters):
        return TOUCHES_FULL
    divide(spheres, pairs, chunks, counters)
    counters[PAIR_CARRIED] = counters[TOUCH_CARRIED] = NOTHING_CARRIED
    counters[STALE] = 0
    counters[REBUILDS] += 1
    return DONE


@njit(cache=True)
def forces(c, spheres, pairs, touches, walls, chunks, counters, pair_law, wall_law, settings):
    """Sum the forces of all contacts that belong to chunk c."""
    clear_sums(c, spheres, chunks)
    pair_forces(c, spheres, pairs, chunks, counters, pair_law, settings)
    wall_forces(c, spheres, touches, walls, chunks, wall_law, settings)


@njit(cache=True)
def motion(c, spheres, chunks, settings):
    """Move the spheres of chunk c, once all chunks have their forces."""
    add_windows(c, spheres, chunks)
    kick_and_drift(c, spheres, chunks, settings)


@njit(cache=True)
def step(spheres, pairs, touches, walls, chunks, counters, pair_law, wall_law, settings):
    """One time step but for its conclusion: forces at the positions, then leapfrog."""
    for c in range(counters[CHUNKS]):
        forces(c, spheres, pairs, touches, walls, chunks, counters, pair_law, wall_law, settings)
    for c in range(counters[CHUNKS]):
        motion(c, spheres, chunks, settings)


@njit(cache=True, parallel=True)
def step_threaded(spheres, pairs, touches, walls, chunks, counters, pair_law, wall_law, settings):
    """The same, the chunks shared among the threads."""
    for c in prange(counters[CHUNKS]):
        forces(c, spheres, pairs, touches, walls, chunks, counters, pair_law, wall_law, settings)
    for c in prange(counters[CHUNKS]):
        motion(c, spheres, chunks, settings)


@njit(cache=True)
def prepare(spheres, pairs, touches, walls, chunks, counters, settings):
    """Fresh lists where they are stale. Returns DONE or what stopped it."""
    if counters[STALE]:
        return rebuild(spheres, pairs, touches, walls, chunks, counters, settings)
    return DONE


@njit(cache=True)
def conclude_step(spheres, chunks, exit_time, counters, monitors, settings):
    """What follows when all spheres have moved: monitors, and those that left."""
    if conclude(chunks, counters, monitors) > 0.0:
        take_out(spheres, exit_time, counters, settings)


@njit(cache=True)
def advance(spheres, pairs, touches, walls, chunks, exit_time, counters, monitors, laws, settings, steps):
    """Run up to `steps` steps. Returns (DONE or what stopped it, steps done)."""
    for done in range(steps):
        outcome = prepare(spheres, pairs, touches, walls, chunks, counters, settings)
        if outcome != DONE:
            return outcome, done
        step(spheres, pairs, touches, walls, chunks, counters, laws.pair, laws.wall, settings)
        conclude_step(spheres, chunks, exit_time, counters, monitors, settings)
    return DONE, steps


@njit(cache=True)
def advance_threaded(
    spheres, pairs, touches, walls, chunks, exit_time, counters, monitors, laws, settings, steps
):
    """`advance` on as many threads as numba was told to use: the same bits."""
    for done in range(steps):
        outcome = prepare(spheres, pairs, touches, walls, chunks, counters, settings)
        if outcome != DONE:
            return outcome, done
        step_threaded(spheres, pairs, touches, walls, chunks, counters, laws.pair, laws.wall, settings)
        conclude_step(spheres, chunks, exit_time, counters, monitors, settings)
    return DONE, steps


@njit(cache=True)
def collect_overlaps(chunks, monitors):
    """Move the largest overlaps that the blocks have seen into the monitors."""
    for c in range(MOST_CHUNKS):
        note_overlaps(chunks.block[c], monitors)
        clear_overlaps(chunks.block[c])

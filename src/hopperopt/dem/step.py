"""One step of the scheme, and the compiled time loop."""

from numba import njit

from hopperopt.dem.contacts import make_block, note_overlaps, pair_forces, wall_forces
from hopperopt.dem.integrate import clear_forces, kick_and_drift, take_out
from hopperopt.dem.neighbours import carry_pairs, drop_parked, rebuild_pairs
from hopperopt.dem.state import COUNT, PAIR_CARRIED, REBUILDS, STALE, TOUCH_CARRIED
from hopperopt.dem.walls import carry_touches, rebuild_touches

DONE, PAIRS_FULL, TOUCHES_FULL, NOT_FINITE = range(4)
NOTHING_CARRIED = -1


@njit(cache=True)
def rebuild(spheres, pairs, touches, walls, counters, settings):
    """New lists in a new order, histories carried through. Returns DONE or what stopped it.

    After PAIRS_FULL or TOUCHES_FULL it goes on where it stopped, once the list has grown.
    """
    for i in range(counters[COUNT]):
        for a in range(3):
            if not abs(spheres.position[i, a]) < 1.0e9:
                return NOT_FINITE
    if counters[PAIR_CARRIED] == NOTHING_CARRIED:
        carry_pairs(spheres, pairs, counters)
        carry_touches(spheres, touches, counters)
        drop_parked(spheres, counters)
    if counters[COUNT] == 0:
        counters[STALE] = 0
        return DONE
    if not rebuild_pairs(spheres, pairs, counters, settings):
        return PAIRS_FULL
    if not rebuild_touches(spheres, touches, walls, counters):
        return TOUCHES_FULL
    counters[PAIR_CARRIED] = counters[TOUCH_CARRIED] = NOTHING_CARRIED
    counters[STALE] = 0
    counters[REBUILDS] += 1
    return DONE


@njit(cache=True)
def step(spheres, pairs, touches, walls, exit_time, counters, monitors, block, settings):
    """One time step: forces at the positions, then leapfrog. Velocities live at half steps."""
    clear_forces(spheres, counters[COUNT])
    pair_forces(spheres, pairs, counters, block, settings)
    wall_forces(spheres, touches, walls, counters, block, settings)
    beyond = kick_and_drift(spheres, counters, monitors, settings)
    if beyond:
        take_out(spheres, exit_time, counters, settings)


@njit(cache=True)
def advance(spheres, pairs, touches, walls, exit_time, counters, monitors, settings, steps):
    """Run up to `steps` steps. Returns (DONE or what stopped it, steps done)."""
    block = make_block()
    outcome = DONE
    done = 0
    for done in range(steps + 1):
        if done == steps:
            break
        if counters[STALE]:
            outcome = rebuild(spheres, pairs, touches, walls, counters, settings)
            if outcome != DONE:
                break
        step(spheres, pairs, touches, walls, exit_time, counters, monitors, block, settings)
    note_overlaps(block, monitors)
    return outcome, done

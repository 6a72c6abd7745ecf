"""Re-sorting into cell order and the half Verlet list, with contact histories carried through.

Every rebuild sorts the spheres by cell (x fastest), so that the neighbours of a sphere lie in five contiguous
row ranges and the lists stay in memory order. A sphere's skin grows with its speed: the few fast ones carry a
wide skin, the bed a thin one, and all last about equally long. The lists hold as long as every sphere is
closer to its reference than its own skin.
"""

import math

import numpy as np
from numba import njit

from hopperopt.dem.state import (
    CHUNKS,
    COUNT,
    MOST_CHUNKS,
    NEEDED,
    NEVER,
    ONE,
    PAIR_CARRIED,
    PARKED,
    PLACE,
    RADIUS,
    SKIN,
    STEP,
    TWO,
    VECTOR,
)

CHUNK_ROWS = 128  # rows of a chunk, on average, at least
LEAST_CHUNK = 1.5  # rows of a chunk, on average, over those that pairs reach ahead
SLICES = 4  # cells along x per cell along y
WIDER = 1.0 + 1.0e-9  # so that rounding at a cell's border loses no pair
CELLS_PER_SPHERE = 8  # a coarser grid is used beyond, so that one sphere far away costs no memory


@njit(cache=True)
def carry_pairs(spheres, pairs, counters):
    """Set the springs of touching pairs aside, under the identities of the two spheres."""
    carried, carried_spring, spring = pairs.carried, pairs.carried_spring, pairs.spring
    found = np.uint64(0)
    for k in range(np.uint64(pairs.start[counters[COUNT]])):
        # Written first, kept by moving on: no branch to mispredict.
        carried[found, 0] = spheres.identity[pairs.owner[k]]
        carried[found, 1] = spheres.identity[pairs.partner[k]]
        for a in range(VECTOR):
            carried_spring[found, a] = spring[k, a]
        found += np.uint64(pairs.touched[k] == counters[STEP] - 1)
    counters[PAIR_CARRIED] = found


@njit(cache=True)
def drop_parked(spheres, counters):
    """Close the gaps that removed spheres left; the order of the others stays."""
    kept = 0
    for i in range(counters[COUNT]):
        if spheres.place[i, 2] <= PARKED / 2.0:
            continue
        if kept != i:
            spheres.place[kept] = spheres.place[i]
            spheres.motion[kept] = spheres.motion[i]
            spheres.mass[kept] = spheres.mass[i]
            spheres.identity[kept] = spheres.identity[i]
        kept += 1
    counters[COUNT] = kept


@njit(cache=True)
def grow_skins(spheres, count, settings):
    """Reference positions and skins for the lists about to be built. Returns the largest skin, m."""
    largest = 0.0
    for i in range(count):
        squared = 0.0
        for a in range(3):
            spheres.anchor[i, a] = spheres.place[i, a]
            squared += spheres.motion[i, a] ** 2
        skin = min(settings.skin + settings.horizon * math.sqrt(squared), settings.skin_limit)
        spheres.anchor[i, SKIN] = skin
        largest = max(largest, skin)
    return largest


@njit(cache=True)
def make_grid(spheres, count, reach):
    """Cells of at least `reach` (m) around the spheres, finer along x, where a search reads them in one go.

    Returns (corner (3,) m, cell sizes (3,) m, cells along x, y, z).
    """
    low = np.full(3, np.inf)
    high = np.full(3, -np.inf)
    for i in range(count):
        for a in range(3):
            low[a] = min(low[a], spheres.place[i, a])
            high[a] = max(high[a], spheres.place[i, a])
    size = np.array([reach / SLICES, reach, reach])
    cells = np.ones(3, np.int64)
    while True:
        number = np.floor((high - low) / size) + 1.0  # of cells; integers might overflow
        if number[0] * number[1] * number[2] <= CELLS_PER_SPHERE * count + 4096:
            for a in range(3):
                cells[a] = int(number[a])
            return low, size, cells
        size *= 1.25


@njit(cache=True)
def sort_by_cell(spheres, count, corner, size, cells):
    """Permute the rows into cell order. Returns the first row of each cell, (cells + 1,)."""
    index = np.empty(count, np.int64)
    first = np.zeros(cells[0] * cells[1] * cells[2] + 1, np.int64)
    for i in range(count):
        x = int((spheres.place[i, 0] - corner[0]) / size[0])
        y = int((spheres.place[i, 1] - corner[1]) / size[1])
        z = int((spheres.place[i, 2] - corner[2]) / size[2])
        index[i] = (z * cells[1] + y) * cells[0] + x
        first[index[i] + 1] += 1
    for c in range(len(first) - 1):
        first[c + 1] += first[c]
    slot = first.copy()
    order = np.empty(count, np.int64)
    for i in range(count):
        order[slot[index[i]]] = i
        slot[index[i]] += 1
    for rows in (spheres.place, spheres.motion, spheres.anchor):
        old = rows[:count].copy()
        for i in range(count):
            for a in range(rows.shape[1]):
                rows[i, a] = old[order[i], a]
    masses, names = spheres.mass[:count].copy(), spheres.identity[:count].copy()
    for i in range(count):
        spheres.mass[i] = masses[order[i]]
        spheres.identity[i] = names[order[i]]
    return first


@njit(cache=True)
def list_pairs(spheres, pairs, count, first, corner, size, cells):
    """Fill the half list. Returns the entries needed; it is whole where these are fewer than the capacity.

    Rows ahead of i in its own x row, then those in the four x rows ahead in y and z, as far as a pair of i
    can reach.
    """
    around = np.empty(PLACE * np.uint64(count))  # position, radius and skin together, flat
    widest = 0.0
    for i in range(count):
        for a in range(3):
            around[4 * i + a] = spheres.place[i, a]
        around[4 * i + 3] = spheres.place[i, RADIUS] + spheres.anchor[i, SKIN]
        widest = max(widest, around[4 * i + 3])
    partner, owner = pairs.partner, pairs.owner
    spare = np.uint64(len(partner) - 1)
    nx, ny, nz = cells
    found = np.uint64(0)
    for i in range(count):
        pairs.start[i] = min(found, spare)
        x, y, z, own = around[4 * i], around[4 * i + 1], around[4 * i + 2], around[4 * i + 3]
        most = (own + widest) * WIDER
        left = int(max(x - most - corner[0], 0.0) / size[0])
        right = min(int((x + most - corner[0]) / size[0]), nx - 1)
        cy, cz = int((y - corner[1]) / size[1]), int((z - corner[2]) / size[2])
        in_y, in_z = y - corner[1] - cy * size[1], z - corner[2] - cz * size[2]  # place within the cell
        for row in range(5):
            ry = cy if row == 0 else (cy + 1 if row == 1 else cy + row - 3)
            rz = cz if row < 2 else cz + 1
            if ry < 0 or ry >= ny or rz >= nz:
                continue
            if (
                (ry > cy and size[1] - in_y > most)
                or (ry < cy and in_y > most)
                or (rz > cz and size[2] - in_z > most)
            ):
                continue
            line = (rz * ny + ry) * nx
            begin = i + 1 if row == 0 else first[line + left]
            end = first[line + right + 1]
            for j in range(np.uint64(begin), np.uint64(max(begin, end))):
                k = PLACE * j
                dx, dy, dz = x - around[k], y - around[k + ONE], z - around[k + TWO]
                reach = own + around[k + RADIUS]
                # Written first, kept by moving on: no branch to mispredict.
                partner[min(found, spare)] = j
                found += np.uint64(dx * dx + dy * dy + dz * dz < reach * reach)
        for k in range(np.uint64(pairs.start[i]), min(found, spare)):
            owner[k] = i
    pairs.start[count] = min(found, spare)
    return found


@njit(cache=True)
def divide(spheres, pairs, chunks, counters):
    """Divide the rows into chunks of about equal work, after the state alone.

    On average they are at least 3/2 as long as the pairs of any row reach ahead, so that all windows together
    are at most 2/3 as long as the rows; their number is a power of two, so that few threads share them
    evenly.
    """
    count = counters[COUNT]
    ahead = 1
    for k in range(pairs.start[count]):
        ahead = max(ahead, np.int64(pairs.partner[k]) - np.int64(pairs.owner[k]))
    number = 1
    while 2 * number <= MOST_CHUNKS and count >= 2 * number * max(LEAST_CHUNK * ahead, CHUNK_ROWS):
        number *= 2
    counters[CHUNKS] = number
    work = count + np.int64(pairs.start[count])
    i = 0
    for c in range(number):
        while i < count and number * (i + np.int64(pairs.start[i])) < c * work:
            i += 1
        chunks.first[c] = i
    chunks.first[number] = count
    room = len(spheres.mass)
    for c in range(number):
        end = chunks.first[c + 1]
        last = end - 1
        for k in range(pairs.start[chunks.first[c]], pairs.start[end]):
            last = max(last, np.int64(pairs.partner[k]))
        chunks.reach[c] = last + 1
        chunks.window[c] = room
        room += last + 1 - end


@njit(cache=True)
def rows_by_identity(spheres, count):
    """Row of each sphere under its identity, (n,) int64; -1 for one that has left."""
    row = np.full(len(spheres.identity), -1, np.int64)
    for i in range(count):
        row[spheres.identity[i]] = i
    return row


@njit(cache=True)
def restore_pairs(spheres, pairs, counters):
    """Put the springs set aside into the new list; a pair whose order flipped changes its sign."""
    count = counters[COUNT]
    row = rows_by_identity(spheres, count)
    for k in range(pairs.start[count]):
        pairs.touched[k] = NEVER
    for c in range(counters[PAIR_CARRIED]):
        i, j = row[pairs.carried[c, 0]], row[pairs.carried[c, 1]]
        if i < 0 or j < 0:
            continue  # one of them has left
        sign = 1.0
        if i > j:
            i, j, sign = j, i, -1.0
        for k in range(pairs.start[i], pairs.start[i + 1]):
            if pairs.partner[k] == j:
                pairs.touched[k] = counters[STEP] - 1
                for a in range(3):
                    pairs.spring[k, a] = sign * pairs.carried_spring[c, a]
                break


@njit(cache=True)
def rebuild_pairs(spheres, pairs, counters, settings):
    """Sort the spheres and list their neighbours. Returns False when the list's capacity is too small.

    Then `counters[NEEDED]` says how many entries it takes; called again with a grown list it goes on, since
    the carried springs are kept under identities. Parked spheres must have been dropped.
    """
    count = counters[COUNT]
    largest_skin = grow_skins(spheres, count, settings)
    largest_radius = 0.0
    for i in range(count):
        largest_radius = max(largest_radius, spheres.place[i, RADIUS])
    reach = 2.0 * (largest_radius + largest_skin)
    corner, size, cells = make_grid(spheres, count, reach)
    first = sort_by_cell(spheres, count, corner, size, cells)
    needed = list_pairs(spheres, pairs, count, first, corner, size, cells)
    if needed >= len(pairs.partner):  # the last place is where entries not kept are written
        counters[NEEDED] = needed
        return False
    restore_pairs(spheres, pairs, counters)
    return True

"""Chunks and threads: the same bits on any number of threads, and no force lost between chunks."""

import copy

import numpy as np
import pytest

from hopperopt.dem.state import CHUNKS


def all_bits(sim):
    """What a run has come to, by identity, as bytes."""
    spheres = sim.spheres
    vectors = (spheres.position, spheres.velocity, spheres.spin, spheres.force)
    arrays = [sim.by_identity(values) for values in vectors] + [sim.exit_time, sim.monitors]
    return b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_no_bit(bed, threads):
    """Settled and flowing out, through many rebuilds."""
    alone, together = copy.deepcopy(bed), copy.deepcopy(bed)
    together.threads = threads
    for sim in (alone, together):
        sim.advance(50)
        sim.open("gate", -0.012)
        sim.advance(3_000)
        assert sim.count < 1_150
        assert np.array_equal(sim.wall_force("hopper"), alone.wall_force("hopper"))
    assert all_bits(alone) == all_bits(together)


def test_forces_across_chunks_balance(bed):
    """The bed is worked on in several chunks, pairs reach across, and action is still reaction."""
    bed.advance(10)
    chunks, number = bed.chunks, int(bed.counters[CHUNKS])
    assert number > 1
    assert (chunks.reach[: number - 1] > chunks.first[1:number]).all()
    on_walls = sum(bed.wall_force(name) for name in bed.wall_names)
    on_spheres = bed.spheres.force[: bed.rows].sum(axis=0)
    assert on_spheres == pytest.approx(-on_walls, abs=1e-10 * np.abs(bed.spheres.force).sum())


def test_chunks_cover_all_rows_once(bed):
    bed.open("gate", -0.012)
    for _ in range(20):
        bed.advance(100)
        number = int(bed.counters[CHUNKS])
        first = bed.chunks.first[: number + 1]
        assert first[0] == 0
        assert first[-1] == bed.rows
        assert (np.diff(first) > 0).all()

"""A run that goes on from a checkpoint is the run that was never interrupted, bit for bit."""

import copy
import re
from itertools import pairwise

import numpy as np
import pytest

from hopperopt import config, experiment
from hopperopt.dem import checkpoint
from hopperopt.dem.simulation import Simulation
from hopperopt.dem.state import CHUNKS, OPENED, REBUILDS, STALE, STEP, grown

# Fields of an experiment that follow from its case, or belong to one process' part of the run.
GIVEN = {
    "case", "progress", "checkpoint", "simulation", "diameter", "mass", "size_class", "sample_steps", "clock",
    "reported", "envelope._r", "envelope._z", "energy._potential", "flow._coarse", "flow._insert",
    "flow._wall_radius",
}  # fmt: skip


class Interrupted(Exception):
    """What stops a run at a checkpoint."""


class Kept:
    """A checkpoint in memory that keeps every state, and may begin with one and stop at one."""

    def __init__(self, state=None, saves=np.inf):
        self.begin, self.saves, self.states = state, saves, []

    def load(self):
        return copy.deepcopy(self.begin)

    def due(self):
        return True

    def save(self, state):
        self.states.append({name: value.copy() for name, value in state.items()})
        if len(self.states) >= self.saves:
            raise Interrupted


def differing(one, other):
    """Names of the arrays of two states that are not the same bits; the clock's time is no state."""
    assert one.keys() == other.keys()
    return {
        name
        for name in one.keys() - {"wall_time"}
        if one[name].dtype != other[name].dtype or one[name].tobytes() != other[name].tobytes()
    }


def fields_of(owner, prefix=""):
    """Dotted names of all that an object stores, through tuples and this project's own objects."""
    stored = owner._asdict() if hasattr(owner, "_asdict") else vars(owner)
    for name, value in stored.items():
        own = type(value).__module__.startswith("hopperopt.") and not isinstance(value, Simulation)
        if own and not prefix:
            yield from fields_of(value, f"{name}.")
        else:
            yield prefix + name


def fill_scratch(simulation, generator):
    """Write garbage, valid as an index but wrong, wherever nothing may be read before it is written."""
    for name in checkpoint.SCRATCH:
        holder, field = name.split(".")
        array = getattr(getattr(simulation, holder), field)
        integer = array.dtype.kind in "iu"
        array[...] = generator.integers(0, 9, array.shape) if integer else np.nan


@pytest.fixture(scope="module")
def case():
    """600 spheres in a small hopper with an insert: several chunks, and lists that grow as the bed forms."""
    small = config.parse({}).simulation_case(None, "small", 1)
    small["walls"] = {
        "hopper": [[0.012, 0.0], [0.018, 0.006], [0.018, 0.16]],
        "gate": [[0.0, 0.0], [0.012, 0.0]],
        "insert": [[0.0, 0.014], [0.004, 0.014], [0.0, 0.018]],
    }
    small["filling"] |= {"level": 0.024, "column_radius": 0.016, "column_bottom": 0.030}
    small["particles"]["counts"] = [200, 200, 200]
    return small


@pytest.fixture(scope="module")
def undisturbed(case):
    """The run that is never saved."""
    return experiment.run(case)


@pytest.fixture(scope="module")
def saved(case):
    """The same run, saved before every sample: its data set, and the states."""
    kept = Kept()
    return experiment.run(case, checkpoint=kept), kept.states


def test_saving_changes_no_bit(undisturbed, saved):
    assert undisturbed["status"] == "complete"
    run, states = saved
    assert run.drop_attrs(deep=False).identical(undisturbed.drop_attrs(deep=False))
    assert len(states) > 30
    assert len(states[0]["touches.spring"]) < len(states[-1]["touches.spring"])
    assert max(state["counters"][CHUNKS] for state in states) > 1


@pytest.mark.parametrize(("threads", "every"), [(1, 1), (2, 20), pytest.param(2, 1, marks=pytest.mark.full)])
def test_the_run_goes_on_from_every_state(case, saved, threads, every):
    """From the first sample of the filling to the last of the discharge, each one leads to the next."""
    _, states = saved
    for state, following in list(pairwise(states))[::every]:
        kept = Kept(state, saves=2)
        with pytest.raises(Interrupted):
            experiment.run(case, threads=threads, checkpoint=kept)
        restored, advanced = kept.states
        assert differing(restored, state) == set()
        assert differing(advanced, following) == set()


@pytest.mark.parametrize("other_threads", [1, pytest.param(2, marks=pytest.mark.full)])
def test_a_run_interrupted_again_and_again_ends_as_if_it_were_not(case, undisturbed, other_threads):
    """Every third sample a new simulation goes on, every other one on another number of threads."""
    state, parts = None, 0
    while True:
        kept = Kept(state, saves=4)
        try:
            run = experiment.run(case, threads=(1, other_threads)[parts % 2], checkpoint=kept)
            break
        except Interrupted:
            state, parts = kept.states[-1], parts + 1
    assert parts > 10
    assert run.drop_attrs(deep=False).identical(undisturbed.drop_attrs(deep=False))


def test_the_end_of_the_filling_and_the_opening_are_among_the_states(saved):
    """The last state with the gate closed still has to open it; the next one was saved right after."""
    _, states = saved
    opened = [np.isfinite(state["settings.sensor"]) for state in states]
    first = opened.index(True)
    assert not any(opened[:first]) and all(opened[first:])
    assert states[first]["counters"][STEP] == states[first]["counters"][OPENED]


def test_wall_time_and_speed_are_those_of_all_parts(case, saved):
    """The parts that led to the result, without what was lost with an interrupted one."""
    run, states = saved
    late = states[-1] | {"wall_time": np.array(1.0e4)}
    resumed = experiment.run(case, checkpoint=Kept(late))
    assert 1.0e4 < resumed.attrs["wall_time_s"] < 1.1e4
    work = run.attrs["particle_steps_per_s"] * run.attrs["wall_time_s"]
    assert resumed.attrs["particle_steps_per_s"] * resumed.attrs["wall_time_s"] == pytest.approx(work)


def test_the_log_tells_where_a_run_goes_on(case, saved, caplog):
    _, states = saved
    reports = []
    caplog.set_level("INFO")
    with pytest.raises(Interrupted):
        experiment.run(case, reports.append, checkpoint=Kept(states[20], saves=1))
    told = re.search(r"resumed .* at (\S+) s of the (\w+), (\d+) particles left", caplog.text)
    counters = states[20]["counters"]
    assert float(told[1]) == pytest.approx((counters[STEP] - counters[OPENED]) * 4e-5, abs=5e-4)


def test_every_field_of_the_solver_is_in_one_table(settled_bed):
    tables = [*checkpoint.EVOLVING, *checkpoint.SCRATCH, *checkpoint.FIXED]
    assert sorted(fields_of(settled_bed)) == sorted(tables)


def test_every_field_of_the_experiment_is_in_one_table(case):
    fresh = experiment._Experiment(case, None, 1, None)
    assert sorted(fields_of(fresh)) == sorted([*experiment.EVOLVING, *GIVEN])


def test_fixed_fields_never_change(bed):
    before = copy.deepcopy(checkpoint.read(bed, checkpoint.FIXED))
    bed.open("gate", -0.012)
    bed.advance(1_500)
    assert bed.count < 1_180
    after = checkpoint.read(bed, checkpoint.FIXED)
    assert differing(before, after) == set()


@pytest.mark.parametrize("opened", [False, True])
def test_the_solver_goes_on_from_every_step(settled_bed, opened):
    """Before and after rebuilds, into shorter lists, with scratch overwritten."""
    generator = np.random.default_rng(1)
    sim = copy.deepcopy(settled_bed)
    fresh = copy.deepcopy(settled_bed)  # stands for one that was built from the same arguments
    sim.pairs, sim.touches = (grown(each, 2 * len(each.spring)) for each in (sim.pairs, sim.touches))
    if opened:
        sim.open("gate", -0.012)
        sim.advance(800)
    before_rebuild = after_rebuild = 0
    for _ in range(60):
        state = copy.deepcopy(checkpoint.read(sim, checkpoint.EVOLVING))
        rebuilds = sim.counters[REBUILDS]
        sim.advance(1)
        before_rebuild += state["counters"][STALE]
        after_rebuild += sim.counters[REBUILDS] - rebuilds
        again = copy.deepcopy(fresh)
        checkpoint.restore(again, state)
        fill_scratch(again, generator)
        again.advance(1)
        one, other = (checkpoint.read(each, checkpoint.EVOLVING) for each in (sim, again))
        assert differing(one, other) == set()
    assert not opened or (before_rebuild and after_rebuild)

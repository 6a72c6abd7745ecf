"""Snapshots show a discharge, and change nothing of it."""

import copy

import numpy as np
import pytest

from hopperopt import config, experiment, snapshots

INTERVAL = 0.02


@pytest.fixture(scope="module")
def case():
    """60 spheres in a small hopper."""
    small = config.parse({}).simulation_case(None, "small", 1)
    small["walls"]["hopper"] = [[0.010, 0.0], [0.014, 0.004], [0.014, 0.16]]
    small["walls"]["gate"] = [[0.0, 0.0], [0.010, 0.0]]
    small["filling"] |= {"level": 0.010, "column_radius": 0.012, "column_bottom": 0.015}
    small["particles"]["counts"] = [20, 20, 20]
    return small


@pytest.fixture(scope="module")
def recorded(case):
    """The run with snapshots."""
    return snapshots.run(case | {"snapshot_interval": INTERVAL})


def test_all_else_is_the_same_to_the_bit(case, recorded):
    plain = experiment.run(case)
    rest = recorded.drop_dims("snapshot")
    assert rest.drop_attrs(deep=False).identical(plain.drop_attrs(deep=False))


def test_they_come_at_their_interval_from_the_opening_to_the_end(recorded):
    time = recorded["snapshot_time"].values
    assert time[0] == 0.0
    assert np.diff(time[:-1]) == pytest.approx(INTERVAL, abs=1e-9)
    assert time[-1] >= recorded["discharge_time"].item()
    assert len(time) > 5
    assert recorded["position"].dtype == recorded["speed"].dtype == np.float32
    np.testing.assert_array_equal(recorded["position"][0], recorded["position_opening"])


def test_each_particle_is_there_until_its_exit(recorded):
    outside = recorded["snapshot_time"] >= recorded["exit_time"]
    np.testing.assert_array_equal(recorded["position"].isnull().all("xyz"), outside)
    np.testing.assert_array_equal(recorded["speed"].isnull(), outside)


def test_the_speeds_are_those_of_the_positions(recorded):
    """In free fall below the outlet, between two snapshots: dz = -(v1 + v2) / 2 dt."""
    height, speed = recorded["position"].sel(xyz="z").values[:-1], recorded["speed"].values[:-1]
    falls = (height[1:] < -1e-3) & (height[:-1] < -1e-3)
    assert falls.any()
    moved, mean = (height[:-1] - height[1:])[falls], 0.5 * (speed[1:] + speed[:-1])[falls]
    assert moved == pytest.approx(mean * INTERVAL, rel=0.1)


class Interrupted(Exception):
    """What stops a run at a checkpoint."""


class Kept:
    """A checkpoint in memory that stops a run after so many saves."""

    def __init__(self, state, saves):
        self.state, self.saves = state, saves

    def load(self):
        return copy.deepcopy(self.state)

    def due(self):
        return True

    def save(self, state):
        self.state, self.saves = {name: value.copy() for name, value in state.items()}, self.saves - 1
        if not self.saves:
            raise Interrupted


def test_an_interrupted_run_has_the_same(case, recorded):
    state, parts = None, 0
    while True:
        kept = Kept(state, saves=4)
        try:
            run = snapshots.run(case | {"snapshot_interval": INTERVAL}, checkpoint=kept)
            break
        except Interrupted:
            state, parts = kept.state, parts + 1
    assert parts > 5
    assert run.drop_attrs(deep=False).identical(recorded.drop_attrs(deep=False))


def test_every_field_that_changes_is_saved(case):
    plain = experiment._Experiment(case, None, 1, None)
    fresh = snapshots._Recorded(case | {"snapshot_interval": INTERVAL}, None, 1, None)
    assert vars(fresh).keys() - vars(plain).keys() == set(snapshots.EVOLVING)


def test_a_moment_is_recorded_once(case):
    """A run that goes on from a checkpoint asks again at the moment at which it was saved."""
    fresh = snapshots._Recorded(case | {"snapshot_interval": INTERVAL}, None, 1, None)
    for _ in range(2):
        fresh.record()
        fresh.record()
        fresh.simulation.advance(1)
    assert fresh.snapshot_times.tolist() == [0, case["time_step"]]

"""An experiment that keeps snapshots of its particles during the discharge.

All else is as in an experiment without them, to the bit. It is a module of its own so that the code of those
does not depend on it.
"""

import numpy as np

from hopperopt.dem import checkpoint as solver
from hopperopt.experiment import _about, _Experiment

# Fields beside those of an experiment that the run changes.
EVOLVING = ("snapshots", "snapshot_times")
VARIABLES = {
    "position": _about("position, missing after the exit", "m"),
    "speed": _about("speed, missing after the exit", "m s-1"),
}
TIME = _about("time of the snapshot from the opening", "s")


def run(case, progress=None, threads=1, checkpoint=None):
    """Simulate one experiment as `experiment.run` does; the data set holds snapshots as well.

    They are `position` (snapshot, particle, xyz) and `speed` (snapshot, particle), float32, at the times
    `snapshot_time`: at the opening, then at the first look at the state from each multiple of the case's
    `snapshot_interval` (s), and at the end.
    """
    return _Recorded(case, progress, threads, checkpoint).run()


class _Recorded(_Experiment):
    def __init__(self, case, progress, threads, checkpoint):
        super().__init__(case, progress, threads, checkpoint)
        self.snapshots = np.empty((0, len(self.mass), 4), np.float32)  # position and speed
        self.snapshot_times = np.empty(0)

    def state(self):
        return super().state() | solver.read(self, EVOLVING)

    def restore(self, state):
        super().restore(state)
        solver.write(self, EVOLVING, state)

    def advance(self, stage):
        due = len(self.snapshot_times) * self.case["snapshot_interval"]
        if stage == "discharge" and self.simulation.time >= due - 0.5 * self.case["time_step"]:
            self.record()
        super().advance(stage)

    def discharge(self):
        super().discharge()
        self.record()

    def record(self):
        """Keep where the particles are and how fast they move.

        Once: a run that goes on from a checkpoint may have been here just before.
        """
        if len(self.snapshot_times) and self.snapshot_times[-1] == self.simulation.time:
            return
        velocity = self.simulation.by_identity(self.simulation.spheres.velocity)
        speed = np.sqrt(np.sum(velocity**2, axis=1, keepdims=True))
        snapshot = np.concatenate([self.positions(), speed], axis=1).astype(np.float32)
        self.snapshots = np.concatenate([self.snapshots, snapshot[None]])
        self.snapshot_times = np.append(self.snapshot_times, self.simulation.time)

    def dataset(self):
        values = {"position": self.snapshots[..., :3], "speed": self.snapshots[..., 3]}
        dimensions = ("snapshot", "particle", "xyz")
        variables = {
            name: (dimensions[: values[name].ndim], values[name], attributes)
            for name, attributes in VARIABLES.items()
        }
        # To the CF conventions a coordinate `time` has a date as its origin.
        time = ("snapshot", self.snapshot_times, TIME)
        return super().dataset().assign(variables).assign_coords(snapshot_time=time)

"""Signs of life of running simulations: a small file of each one beside its lock, which `status` reads."""

import json
import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from hopperopt import checkpoint, files

INTERVAL = 3.0  # s between two beats
STARTING = ("starting", "compiling")  # stages before the first time step, one beat in all


class Beat(NamedTuple):
    """What a simulation said last, and how long ago."""

    output: str  # as seen from the state directory
    stage: str  # one of STARTING, then "filling", "settling" or "discharge"
    time: float  # s simulated in the filling or since the opening
    discharged: float  # share of the particles
    rate: float  # particle-steps per second
    remaining: float | None  # s of wall time to go, where the simulation can tell
    host: str
    pid: int
    age: float = 0.0  # s


@contextmanager
def beating(
    output: Path,
    state_dir: Path,
    particles: int,
    stage: str = "starting",
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Callable]:
    """Give a function of progress reports that writes the last one every few seconds; the end removes it.

    Only for who holds the lock of `output`. particles: their number at the start; stage: what is at
    work before the first report. A file that cannot be written stops no simulation.
    """
    path = _file(output, state_dir)
    files.remove_leftovers(path)
    whose = {"output": checkpoint.place(output, state_dir), "host": platform.node(), "pid": os.getpid()}
    due = 0.0

    def write(**said) -> None:
        nonlocal due
        with suppress(OSError), files.atomic(path) as temporary:
            temporary.write_text(json.dumps(whose | said))
        due = clock() + INTERVAL

    def beat(report) -> None:
        if clock() >= due:
            discharged = 1.0 - report.particles / particles
            said = {name: getattr(report, name) for name in ("stage", "time", "rate", "remaining")}
            write(**said, discharged=discharged)

    write(stage=stage, time=0.0, rate=0.0, remaining=None, discharged=0.0)
    try:
        yield beat
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def read(state_dir: Path) -> list[Beat]:
    """The beats in a state directory, by output; files that are no beats are passed over."""
    now, beats = _now(state_dir), []
    for path in state_dir.glob("*.json"):
        with suppress(OSError, ValueError, TypeError):  # gone at this moment, or not of this version
            age = max(0.0, now - path.stat().st_mtime)
            beats.append(Beat(**json.loads(path.read_text()), age=age))
    return sorted(beats)


def _file(output: Path, state_dir: Path) -> Path:
    return state_dir / f"{checkpoint.name_of(output, state_dir)}.json"


def _now(state_dir: Path) -> float:
    """Time by the clock that dates the files there, which on a shared disk need not be this machine's."""
    try:
        with tempfile.TemporaryFile(dir=state_dir) as file:
            file.write(b".")
            file.flush()
            return os.fstat(file.fileno()).st_mtime
    except OSError:  # it is not there, or not ours to write
        return time.time()

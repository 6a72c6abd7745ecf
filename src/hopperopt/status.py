"""How far a study is: what its files and the heartbeats of its simulations say, on one screen."""

import functools
import json
import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, TextIO

import netCDF4
import numpy as np

from hopperopt import heartbeat
from hopperopt.heartbeat import Beat
from hopperopt.progress import duration

# Time (s) without a beat after which a simulation may have ended: before its first step, and later.
SILENT, SILENT_LATER = 600.0, 60.0
REDRAW = 2.0  # s
BAR = 24  # characters
CLEAR = "\x1b[H\x1b[J"
# What a study makes of its simulations, and the last file of it.
RESULTS = {
    "data set": "dataset.nc",
    "surrogate": "surrogate/model.nc",
    "optimum": "optimum/selected.yaml",
    "verdict": "verification/verdict.csv",
}
TABLES = (
    "design.csv", "runs.csv", "designs.csv", "optimum/front.csv", "verification/glance.csv",
    "analysis/effects.csv", "analysis/anova.csv", "analysis/sobol.csv",
)  # fmt: skip
# States of a run: lost has a heartbeat that stopped, other is the file of other settings.
DONE, RUNNING, LOST, OTHER, WAITING = "done", "running", "lost", "other", "waiting"


class Run(NamedTuple):
    """A simulation of the study."""

    purpose: str  # "plan", "infill" or "verification"
    file: Path
    case: str | None  # JSON; None where the study has yet to find the design


class Finished(NamedTuple):
    """What a run's file says: its case, and what it took."""

    case: str
    wall_time: float  # s
    filling_time: float  # simulated s
    discharge_time: float  # simulated s, NaN where nothing left


class Seen(NamedTuple):
    """A study at one moment."""

    states: list[str]  # of each run
    beats: dict[Path, Beat]  # of simulations that have not ended, by their file, whose state is not DONE
    finished: list[Finished]


def planned(study) -> list[Run]:
    """All simulations of a study (`config.Study`), the plan's first."""
    results, runs = Path(study.results_dir), []

    def add(purpose, folder, name, design, replicates):
        for replicate in range(1, replicates + 1):
            case = None if isinstance(design, str) else study.simulation_case(design, name, replicate)
            text = None if case is None else json.dumps(case, sort_keys=True)
            runs.append(Run(purpose, results / folder / f"{name}_rep_{replicate}.nc", text))

    for name, design in study.experiments():
        add("plan", "simulations", name, design, study.design.replicates)
    for number, names in enumerate(study.proposals(), start=1):
        for name in names:
            add("infill", f"infill/round_{number}", name, name, study.design.replicates)
    for name, design in study.cases().items():  # a word where the study finds the design
        add("verification", "verification", name, design, study.verification.replicates_in(name))
    return runs


def look(runs: Sequence[Run], state_dir: Path) -> Seen:
    """See which runs are done (file of the same case), running, lost (no beat for too long) or waiting."""
    beats = {Path(os.path.normpath(state_dir / beat.output)): beat for beat in heartbeat.read(state_dir)}
    states, finished = [], []
    for run in runs:
        path = Path(os.path.normpath(run.file))
        beat, file = beats.get(path), _finished(run.file)
        if beat is not None and _is_alive(beat):
            states.append(RUNNING)
        elif file is None:
            states.append(WAITING if beat is None else LOST)
        elif run.case not in (None, file.case):
            states.append(OTHER)
        else:
            states.append(DONE)
            finished.append(file)
            beats.pop(path, None)  # left by a process that was killed
    return Seen(states, beats, finished)


def _is_alive(beat: Beat) -> bool:
    return beat.age < (SILENT if beat.stage in heartbeat.STARTING else SILENT_LATER)


def _finished(path: Path) -> Finished | None:
    """What a run's file says, None where there is no whole one."""
    try:
        return _read(path, path.stat().st_mtime_ns)
    except (OSError, AttributeError, KeyError, IndexError):
        return None


@functools.cache
def _read(path: Path, _mtime: int) -> Finished:
    with netCDF4.Dataset(path) as file:
        times = (float(file[name][...].filled(np.nan)) for name in ("filling_time", "discharge_time"))
        return Finished(file.case, float(file.wall_time_s), *times)


def to_go(beat: Beat, finished: Sequence[Finished]) -> float | None:
    """Wall time (s) that a running simulation has before it; None where neither it nor another can tell.

    Filling takes the time that it took in those that have ended, a discharge with half of its particles half
    of that per simulated second.
    """
    if beat.remaining is not None:
        return beat.remaining
    if not finished:
        return None
    wall, filling, discharge = (np.nanmean(column) for column in list(zip(*finished, strict=True))[1:])
    work = filling + 0.5 * np.nan_to_num(discharge)
    done = filling if beat.stage == "discharge" else min(beat.time, filling)
    return float(wall * (1 - done / work))


def left(seen: Seen) -> float | None:
    """Wall time (s) to the end of all simulations, as many at a time as now; None where it cannot be told."""
    alive = [beat for beat in seen.beats.values() if _is_alive(beat)]
    known = [seconds for beat in alive if (seconds := to_go(beat, seen.finished)) is not None]
    count = Counter(seen.states)
    waiting = count[WAITING] + count[LOST] + count[OTHER]
    if not alive or len(known) < len(alive) or (waiting and not seen.finished):
        return None
    each = np.mean([run.wall_time for run in seen.finished]) if waiting else 0.0
    return float(max(max(known), (sum(known) + waiting * each) / len(alive)))


def ended(seen: Seen, results: Path, figures: Iterable[Path]) -> bool:
    """Whether nothing is left to do."""
    files = [results / RESULTS["verdict"], *figures]
    return set(seen.states) == {DONE} and all(path.exists() for path in files)


def screen(runs: Sequence[Run], seen: Seen, results: Path, figures: Iterable[Path], lines: int) -> str:
    """What is seen as text of at most so many lines; figures: the files that the study draws."""
    figures = list(figures)
    made = [f"{name} {'done' if (results / file).exists() else '-'}" for name, file in RESULTS.items()]
    made.append(f"figures {sum(path.exists() for path in figures)} of {len(figures)}")
    head = [
        f"{results.resolve()}, {time.strftime('%H:%M:%S')}",
        "",
        *(_counts(purpose, runs, seen) for purpose in dict.fromkeys(run.purpose for run in runs)),
        f"{'results':13}{'   '.join(made)}",
        "",
    ]
    foot = ["everything is done" if ended(seen, results, figures) else _outlook(seen)]
    table = _table(seen, results)
    room = max(3, lines - len(head) - len(foot) - 2)
    if len(table) > room:
        table = [*table[: room - 1], f"and {len(table) - room + 1} more"]
    return "\n".join([*head, *table, *[""][: len(table)], *foot]) + "\n"


def _counts(purpose: str, runs: Sequence[Run], seen: Seen) -> str:
    count = Counter(state for run, state in zip(runs, seen.states, strict=True) if run.purpose == purpose)
    filled = BAR * count[DONE] // max(1, count.total())
    parts = [f"{count[DONE]:3d} of {count.total():3d} done", f"{count[RUNNING]:3d} running"]
    parts.append(f"{count[WAITING]:3d} to come")
    parts += [f"{count[OTHER]} of other settings, to be repeated"] * bool(count[OTHER])
    parts += [f"{count[LOST]} without a sign of life"] * bool(count[LOST])
    return f"{purpose:13}[{'#' * filled}{'.' * (BAR - filled)}] " + "  ".join(parts)


def _table(seen: Seen, results: Path) -> list[str]:
    """A line for each simulation that has not ended."""
    if not seen.beats:
        return []
    rows = [("simulation", "stage", "simulated", "discharged", "million steps/s", "to go", "process")]
    for file, beat in seen.beats.items():
        alive, seconds = _is_alive(beat), to_go(beat, seen.finished)
        rows.append(
            (
                os.path.relpath(file, results).removesuffix(".nc"),
                beat.stage,
                f"{beat.time:.3f} s",
                f"{beat.discharged:.0%}",
                f"{beat.rate / 1e6:.1f}" if alive and beat.rate else "",
                (duration(seconds) if seconds is not None else "")
                if alive
                else f"no sign of life for {duration(beat.age)}",
                f"{beat.host}:{beat.pid}",
            )
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    align = "<<>>>><"
    return [
        "  ".join(f"{cell:{a}{w}}" for cell, a, w in zip(row, align, widths, strict=True)).rstrip()
        for row in rows
    ]


def _outlook(seen: Seen) -> str:
    count = Counter(seen.states)
    if count[DONE] == count.total():
        return "all simulations are done"
    if not count[RUNNING]:
        goes_on = "`make` goes on, `make resume` after an interruption"
        return f"no simulation is running; if nothing else is, {goes_on}"
    seconds = left(seen)
    if seconds is None:
        return "time to go: known when the first simulations have ended"
    return f"about {duration(seconds)} to go for all simulations, {count[RUNNING]} at a time"


def watch(draw: Callable[[], tuple[str, bool]], stream: TextIO, wait: Callable = time.sleep) -> None:
    """Show what `draw` gives, every two seconds, until it says that all is done."""
    while True:
        text, done = draw()
        stream.write((CLEAR if stream.isatty() else "") + text)
        stream.flush()
        if done:
            return
        wait(REDRAW)

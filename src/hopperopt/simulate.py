"""One simulation as a job: its lock, checkpoint and heartbeat, its progress, its file."""

import hashlib
import json
import logging
import sys
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path

from hopperopt import checkpoint, dataset, files, heartbeat, provenance
from hopperopt.progress import Reporter


def simulate(
    case: Mapping,
    digest: str,
    output: Path,
    threads: int,
    checkpoint_minutes: float | None,
    state_dir: Path,
) -> None:
    """Simulate a case with the code of a digest and write its file, with all that says how it was made.

    Goes on from the checkpoint in `state_dir` that an interrupted run of the same case and code has left.
    Where such a run is still at work, waits for its end and takes its file if it wrote one.
    """
    origin = {
        "case": json.dumps(case, sort_keys=True),
        "code_digest": digest,
        "seed": case["seed"],
    }
    stamp = {
        "case": hashlib.sha256(origin["case"].encode()).hexdigest(),
        "version of the code": origin["code_digest"],
        "version of a library": f"numpy {metadata.version('numpy')}, numba {metadata.version('numba')}",
    }
    with checkpoint.working_on(output, state_dir, stamp, checkpoint_minutes) as (kept, waited):
        run = _finished(output, origin) if waited else None
        if run is None:
            stage = "starting" if provenance.is_compiled(threads) else "compiling"
            with heartbeat.beating(output, state_dir, sum(case["particles"]["counts"]), stage) as beat:
                run = _run(case, threads, kept, beat)
            _describe(run)
            run.attrs |= provenance.attributes() | origin
            files.write_netcdf(run, output)
    level, reached = 1e3 * case["filling"]["level"], 1e3 * float(run["filling_level"])
    if abs(reached - level) > 1e3 * max(case["particles"]["diameters"]):
        logging.warning(
            f"the bed was {reached:.1f} mm high, not {level:g} mm (give or take a coarse particle)"
        )
    print(f"{output}: {dataset.outcome(run)}", file=sys.stderr)


def _finished(output: Path, origin: Mapping):
    """The run that the process before wrote, None unless it is of this case and code."""
    if not output.exists():
        return None
    run = files.read_netcdf(output)
    if any(run.attrs.get(name) != value for name, value in origin.items()):
        return None
    logging.info(f"{output} is what that process has just written")
    return run


def _describe(run) -> None:
    """Attach what the CF conventions ask for beside the units and long names that a run has."""
    run.attrs |= {
        "Conventions": dataset.CONVENTIONS,
        "title": "One discharge of the hopper",
        "source": "discrete element simulation",
    }
    run["xyz"].attrs["long_name"] = "direction: x, y, or z upwards on the axis of the hopper"


def _run(case: Mapping, threads: int, kept: checkpoint.Checkpoint, beat: Callable):
    provenance.compile_solver(threads)  # before numba is imported
    from hopperopt import experiment, snapshots

    module = snapshots if "snapshot_interval" in case else experiment

    with Reporter(sys.stderr) as show:

        def progress(report):
            show(report)
            beat(report)

        return module.run(case, progress=progress, threads=threads, checkpoint=kept)

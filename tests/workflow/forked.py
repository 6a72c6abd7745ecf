"""Snakemake in forks of a process that has imported it, which saves the half of a dry run.

Only for what Snakemake is asked; what runs a study is started as by a user.
"""

import multiprocessing
import os
import subprocess
import sys
import traceback
from pathlib import Path

from hopperopt import provenance

PARENT = multiprocessing.get_context("forkserver")
PARENT.set_forkserver_preload([f"{__package__}.imported", __name__])


def snakemake_in_fork(options, directory, environment, output):
    """Run Snakemake with these options in a directory, its output to a file; return the completed process."""
    child = PARENT.Process(target=_run, args=(options, directory, environment, output))
    child.start()
    child.join()
    return subprocess.CompletedProcess(options, child.exitcode, Path(output).read_text())


def _run(options, directory, environment, output):
    """What a new process would do: an output, environment, directory and package of its own."""
    with Path(output).open("w", buffering=1) as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
        sys.stdout = sys.stderr = file
        os.environ.clear()
        os.environ.update(environment)
        os.chdir(directory)
        package = Path(environment["PYTHONPATH"])
        if package / "hopperopt" != provenance.PACKAGE:
            for name in [name for name in sys.modules if name.partition(".")[0] == "hopperopt"]:
                del sys.modules[name]
            sys.path.insert(0, str(package))
        from snakemake import cli

        try:
            cli.main([*map(str, options)])
        except Exception:
            traceback.print_exc()
            os._exit(1)

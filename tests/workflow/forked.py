"""Snakemake and jobs in forks of a process that has imported all they need, which takes half of their time.

Only for what Snakemake is asked and for the one study whose copies the tests change; every other study is run
as by a user, and must come to the same bits.
"""

import json
import multiprocessing
import os
import socket
import subprocess
import sys
import threading
import traceback
from multiprocessing.reduction import DupFd
from pathlib import Path

from hopperopt import cli, provenance

PARENT = multiprocessing.get_context("forkserver")
PARENT.set_forkserver_preload([f"{__package__}.imported", __name__])
# Sends its arguments, place and streams, and ends as the fork does.
PYTHON = """\
#!{python} -IS
import json, os, socket, sys
with socket.socket(socket.AF_UNIX) as server:
    server.connect({address!r})
    socket.send_fds(server, [b"."], [0, 1, 2])
    server.sendall(json.dumps([sys.argv[1:], os.getcwd(), dict(os.environ)]).encode())
    server.shutdown(socket.SHUT_WR)
    sys.exit(int(server.recv(10)))
"""


def forked_python(folder):
    """Put a `python` into an empty folder whose `python -m hopperopt` is a fork; return its path."""
    address = str(folder / "socket")
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(address)
    listener.listen()
    python = folder / "python"
    python.write_text(PYTHON.format(python=sys.executable, address=address))
    python.chmod(0o755)

    def listen():
        while True:
            connection, _ = listener.accept()
            with connection:
                _, streams, _, _ = socket.recv_fds(connection, 1, 3)
                message = b"".join(iter(lambda: connection.recv(1 << 16), b""))  # noqa: B023
                given = [DupFd(fd) for fd in [*streams, connection.fileno()]]
                PARENT.Process(target=_job, args=(*json.loads(message), *given)).start()
            for fd in streams:
                os.close(fd)

    threading.Thread(target=listen, daemon=True).start()
    return python


def _job(arguments, directory, environment, *descriptors):
    """What a new process with these arguments would do; the last descriptor takes its status."""
    *streams, connection = [descriptor.detach() for descriptor in descriptors]
    for stream, descriptor in enumerate(streams):
        os.dup2(descriptor, stream)
    sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w")  # noqa: SIM115
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(directory)
    option, package, *arguments = arguments
    assert (option, package) == ("-m", "hopperopt"), arguments
    status = cli.main(arguments)
    sys.stdout.flush()
    os.write(connection, b"%d" % (status or 0))


def snakemake_in_fork(options, directory, environment, output, python=sys.executable):
    """Run Snakemake with these options in a directory, its output to a file; return the completed process.

    python: what the jobs find as `python`.
    """
    child = PARENT.Process(target=_run, args=(options, directory, environment, output, python))
    child.start()
    child.join()
    return subprocess.CompletedProcess(options, child.exitcode, Path(output).read_text())


def _run(options, directory, environment, output, python):
    """What a new process would do: an output, environment, directory and package of its own."""
    sys.executable = str(python)
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

"""Locks of files, which end with the process that holds them, however it ends."""

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def take(descriptor: int, wait: bool = False) -> bool:
    """Take the lock of an open file; False where another process holds it and one does not `wait`.

    A file system without locks is used without.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


@contextmanager
def exclusive(path: Path, waits: Callable[[str], None] = lambda holder: None) -> Iterator[bool]:
    """Hold the lock of a file of its own, made where it is missing; give whether one had to wait for it.

    `waits` is called once, with the number of the process that holds the lock (as text, as far as it is
    known), before one waits. The holder alone may delete the file.
    """
    waited = False
    while True:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a+b", buffering=0) as file:
            if not take(file.fileno()):
                file.seek(0)
                if not waited:
                    waits(file.read().decode() or "unknown")
                waited = True
                take(file.fileno(), wait=True)
            if not _is_at(file.fileno(), path):
                continue  # deleted by its last holder: no other process would see this lock
            with suppress(OSError):  # a full disk: the number is only for people
                file.truncate(0)
                file.write(str(os.getpid()).encode())
            yield waited
            return


def _is_at(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False

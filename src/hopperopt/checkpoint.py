"""A checkpoint: the saved state of a running simulation, under a lock that one process at a time holds.

The file is a plain npz (no pickle), and the SHA-256 of it in 32 bytes behind it. The stamp in it tells what
the state is of; the solver and the experiment know which fields it has.
"""

import hashlib
import io
import json
import logging
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from hopperopt import files, locks

DIGEST = 32  # bytes
STAMP = "stamp"


class Unusable(ValueError):
    """A checkpoint is torn, or of another run; the message says which."""


class Checkpoint:
    """State of one run (arrays by name) in a file, saved at most every `minutes`; None: never."""

    def __init__(self, path: Path, stamp: Mapping[str, str], minutes: float | None):
        self._path, self._stamp, self._minutes = path, stamp, minutes
        self._saved = time.monotonic()

    def load(self) -> dict[str, np.ndarray] | None:
        """The saved state, or None where there is none that can be used; the log says why."""
        try:
            return unpacked(self._path.read_bytes(), self._stamp)
        except FileNotFoundError:
            return None
        except Unusable as reason:
            logging.warning(f"{self._path} is not used: {reason}; the simulation starts anew")
            return None

    def due(self) -> bool:
        """Whether the last save, or the start of this process' part, is long enough ago."""
        return self._minutes is not None and time.monotonic() - self._saved >= 60.0 * self._minutes

    def save(self, state: Mapping[str, np.ndarray]) -> None:
        """Put the state in the place of the last one. A simulation goes on where it cannot be saved."""
        try:
            with files.atomic(self._path) as temporary, temporary.open("w+b") as file:
                np.savez(file, allow_pickle=False, **state, **{STAMP: json.dumps(self._stamp)})
                file.seek(0)
                file.write(hashlib.file_digest(file, "sha256").digest())
        except OSError as error:
            logging.warning(f"{self._path} could not be saved ({error.strerror}); the simulation goes on")
        self._saved = time.monotonic()


def unpacked(data: bytes, stamp: Mapping[str, str]) -> dict[str, np.ndarray]:
    """State from a checkpoint's bytes; raises Unusable unless they are whole and bear the same stamp."""
    if hashlib.sha256(memoryview(data)[:-DIGEST]).digest() != data[-DIGEST:]:
        raise Unusable("it is torn")
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        state = dict(file)
    found = json.loads(state.pop(STAMP).item())
    if differing := [name for name, value in stamp.items() if found.get(name) != value]:
        raise Unusable(f"it was saved with another {' and another '.join(differing)}")
    return state


def place(output: Path, state_dir: Path) -> str:
    """An output's place as seen from the state directory, so that a study may be moved."""
    return os.path.relpath(output.resolve(), state_dir.resolve())


def name_of(output: Path, state_dir: Path) -> str:
    """Name, without a suffix, of the files in the state directory that belong to an output."""
    return f"{output.stem}-{hashlib.sha256(place(output, state_dir).encode()).hexdigest()[:8]}"


@contextmanager
def working_on(output: Path, state_dir: Path, stamp: Mapping[str, str], minutes: float | None) -> Iterator:
    """Let no other process simulate `output`; give its checkpoint, and whether one had to wait.

    stamp: what the state follows from, as text by name. Without an exception the checkpoint is removed at the
    end: the output is written.
    """
    name = name_of(output, state_dir)
    state, lock = state_dir / f"{name}.npz", state_dir / f"{name}.lock"

    def say(holder):
        logging.info(f"process {holder} is still simulating {output}; waiting for it to end")

    with locks.exclusive(lock, say) as waited:
        for path in (state, output):
            files.remove_leftovers(path)
        yield Checkpoint(state, stamp, minutes), waited
        state.unlink(missing_ok=True)
        lock.unlink(missing_ok=True)
    with suppress(OSError):  # others are at work
        state_dir.rmdir()

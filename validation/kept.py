"""Long runs, kept in `.validation/` under a digest of all that they depend on, so that none is done twice."""

import hashlib
import json
import os
from pathlib import Path

import numpy as np

from hopperopt.provenance import PACKAGE, code_digest

STORE = Path(__file__).resolve().parent.parent / ".validation"


def kept(name, key, make, solver=True):
    """Arrays of a long run: those kept under `key`, or what `make()` returns, kept from now on.

    Arguments: `name`, for people; `key`, whatever JSON can hold that the run depends on; `make`, a function
    that returns a dict of arrays; `solver`, whether the run depends on this project's solver.
    """
    text = json.dumps([key, _solver_digest() if solver else None], sort_keys=True)
    path = STORE / f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.npz"
    if not path.exists():
        STORE.mkdir(exist_ok=True)
        torn = path.with_suffix(f".{os.getpid()}.npz")
        np.savez_compressed(torn, **make())
        torn.replace(path)
    with np.load(path) as arrays:
        return dict(arrays)


def _solver_digest():
    """Digest of the solver's code, without comments."""
    names = sorted(path.stem for path in (PACKAGE / "dem").glob("*.py") if path.stem != "__init__")
    return code_digest(*(f"hopperopt.dem.{name}" for name in names))

"""Mutants of the force law.

A test that has never failed proves little. Here the source of the force law is made wrong on purpose, in one
place at a time: a term of a sum with its sign turned, a product without one of its factors, a minus sign
dropped, a constant larger by a quarter, an exponent by one, a minimum for a maximum, `-=` for `+=`. The law
reaches from the constants of the materials over the geometry of a contact and its forces to where these are
added up and move the spheres. What makes no force is left out: monitors, the sensor, the age of the lists,
arithmetic with whole numbers.

Each mutant must make a physics test fail, in a copy of the source of its own. Most fall to a few spheres in
a cup and in a tube, set against the plain solver (`tests/physics/test_heap.py`). Those that survive this and
the tests of single contacts, uncompiled, face all physics tests, compiled. The right source passes the same
tests first. Tolerance: no survivor. Mutants that no test can tell from the right source are listed in the
script, with the reason, and must be there and live.
"""

import hashlib
import json
import os
import subprocess
import sys

from validation import trial
from validation.mutants import mutants, observed
from validation.report import Row

LAW = {  # module -> those of its functions that make forces, and motion of them; "*" for all
    "materials": ("youngs_modulus", "damping_ratio", "contact_law"),
    "laws": "*",
    "contacts": (
        "find_contacts", "gather_pairs", "meet_pairs", "apply_law", "roll_cdt", "scatter_pairs",
        "wall_forces", "deepest", "gather_touch", "scatter_touches",
    ),
    "walls": ("nearest",),
    "integrate": ("clear_sums", "add_windows", "kick_and_drift"),
    "state": ("make_spheres",),
}  # fmt: skip
ASIDE = {  # variables that make no force: statements with one of them are left out
    "worst", "worst_smaller", "smaller", "deeper", "SMALLER",  # deepest overlap
    "twice_weight", "speed2", "head", "fastest",  # fastest sphere
    "gone2", "moved", "beyond",  # age of the lists, sensor
}  # fmt: skip
EQUIVALENT = {  # end of a change -> why it changes nothing
    "- TINY": "1e-300 keeps 0 / 0 away, with either sign",
}
CASES = ("mutants", "mutation", "plain", "revolved", "trial")  # what the result depends on, but for tests
UNCOMPILED, COMPILED, LISTED, ALIVE = "caught uncompiled", "caught compiled", "listed", "alive"
LISTED_DEAD = "listed, yet caught"


def measure(figures):
    """Count the mutants of each module and those that live."""
    from validation.kept import kept  # not in the process that tries the mutants: it imports the solver

    cases = [trial.ROOT / "validation" / f"{name}.py" for name in CASES]
    read = sorted([*trial.ROOT.glob("tests/physics/*.py"), *cases])
    key = {str(path.relative_to(trial.ROOT)): hashlib.sha256(path.read_bytes()).hexdigest() for path in read}
    result = kept("mutation", key, make)
    rows = []
    for module in LAW:
        fates = result["fate"][result["module"] == module].tolist()
        total, compiled = len(fates), fates.count(COMPILED)
        total -= fates.count(LISTED)
        caught = fates.count(UNCOMPILED) + compiled
        text = f"{caught} caught" + (f", {compiled} of them compiled" if compiled else "")
        rows.append(Row(f"`{module}.py`: mutants", f"{total} caught", text, "all", caught == total > 0))
    for end, reason in EQUIVALENT.items():
        of_end = result["fate"][[name.endswith(end) for name in result["name"]]].tolist()
        rows.append(Row(
            f"listed: {end} ({reason})", "alive", f"{of_end.count(LISTED)} of {len(of_end)} alive", "all",
            0 < len(of_end) == of_end.count(LISTED),
        ))  # fmt: skip
    for name in result["name"][result["fate"] == ALIVE]:
        rows.append(Row(f"alive: {name}", "caught", "alive", "", False))
    return rows


def make():
    """Try all mutants in a process where nothing is compiled. Returns arrays: module, name, fate."""
    import numpy as np

    settings = {"NUMBA_DISABLE_JIT": "1", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    command = [sys.executable, "-m", "validation.mutation"]
    done = subprocess.run(
        command, cwd=trial.ROOT, env=os.environ | settings, stdout=subprocess.PIPE, check=True
    )
    module, name, fate = np.array(json.loads(done.stdout)).T
    return {"module": module, "name": name, "fate": fate}


def try_all():
    """Fates of all mutants: [(module, name, fate)]."""
    import numba  # noqa: F401 - once, before this process is copied for each mutant
    import pytest  # noqa: F401

    fates, right_passes = [], False
    for module, names in LAW.items():
        path = trial.ROOT / trial.SOLVER / f"{module}.py"
        whole = trial.whole_numbers(module, observed(path, names, ASIDE, trial.RECORDER))
        for mutant in mutants(path, names, ASIDE):
            if mutant.place in whole:
                continue
            listed = any(mutant.change.endswith(end) for end in EQUIVALENT)
            if trial.fails(module, mutant.source):
                fate = LISTED_DEAD if listed else UNCOMPILED
            elif listed:
                fate = LISTED
            else:
                if not right_passes and trial.fails_compiled(module, path.read_text(encoding="utf-8")):
                    raise RuntimeError("the right source fails a physics test")
                right_passes = True
                fate = COMPILED if trial.fails_compiled(module, mutant.source) else ALIVE
                print(f"{mutant}: {fate}", file=sys.stderr)
            fates.append((module, str(mutant), fate))
    return fates


if __name__ == "__main__":
    print(json.dumps(try_all()))

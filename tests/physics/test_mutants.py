"""What the validation case `mutation` changes in a source."""

import pytest

from validation.mutants import mutants, observed
from validation.mutation import ASIDE, EQUIVALENT, LAW
from validation.trial import ROOT, SOLVER

SOURCE = '''
def force(block, q, k, x, seen):
    """Spring, with a factor 2.0 that is none."""
    f = -k * x / 2.0 - block[3 * q + 1] ** 2
    for a in range(3):
        block[a + q] += min(f, 0.0)
        seen += 2.0 * f
    return 1.0 / f


def other(x):
    return -x
'''
CHANGES = {
    "-k * x / 2.0 - block[3 * q + 1] ** 2 -> -k * x / 2.0 + block[3 * q + 1] ** 2",
    "-k * x / 2.0 - block[3 * q + 1] ** 2 -> -(-k * x / 2.0) - block[3 * q + 1] ** 2",
    "-k * x / 2.0 -> -k * x",
    "-k * x -> -k",
    "-k * x -> x",
    "-k -> k",
    "2.0 -> 2.5",
    "block[3 * q + 1] ** 2 -> block[3 * q + 1]",
    "block[3 * q + 1] ** 2 -> block[3 * q + 1] ** 3",
    "block[a + q] += min(f, 0.0) -> block[a + q] -= min(f, 0.0)",
    "min(f, 0.0) -> max(f, 0.0)",
    "1.0 / f -> 1.0",
    "1.0 -> 1.25",
}


def test_every_sign_and_factor_is_changed_once(tmp_path):
    """Not in docstrings, subscripts, other functions, or statements with a name that is set aside."""
    path = tmp_path / "spring.py"
    path.write_text(SOURCE)
    found = mutants(path, ("force",), {"seen"})
    assert sorted(mutant.change for mutant in found) == sorted(CHANGES)
    assert len({mutant.source for mutant in found}) == len(CHANGES)
    state = {}
    exec(next(m.source for m in found if m.change == "-k -> k"), state)
    assert state["force"]([0.0] * 9, 1, 2.0, 3.0, 0.0) == 1.0 / 3.0


def test_places_report_their_values(tmp_path):
    """What the recorder sees under a mutant's number is the value that this mutant changes."""
    path = tmp_path / "spring.py"
    path.write_text(SOURCE)
    seen = {}
    state = {"record": lambda place, value: seen.setdefault(place, value)}
    exec(observed(path, ("force",), {"seen"}, "record"), state)
    assert state["force"]([0.0] * 9, 1, 2.0, 3.0, 0.0) == -1.0 / 3.0
    values = {m.change: seen[m.place] for m in mutants(path, ("force",), {"seen"})}
    assert values["-k * x -> x"] == -6.0 and values["-k -> k"] == -2.0 and values["2.0 -> 2.5"] == 2.0


@pytest.mark.full
def test_lists_name_what_is_there():
    """Functions, names set aside and equivalent mutants of the force law exist in its source."""
    texts = {module: (ROOT / SOLVER / f"{module}.py") for module in LAW}
    changes = [m.change for module, path in texts.items() for m in mutants(path, LAW[module], ASIDE)]
    assert all(any(change.endswith(end) for change in changes) for end in EQUIVALENT)
    text = "\n".join(path.read_text() for path in texts.values())
    assert all(name in text for name in ASIDE)

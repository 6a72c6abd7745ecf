"""Physics tests against a copy of the source with another text of one module of the solver."""

import builtins
import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOLVER = Path("src", "hopperopt", "dem")
FAST = ("tests/physics/test_heap.py", "tests/physics/test_law.py", "-k", "not swings")  # thousands of steps
ALL = ("tests/physics", "-m", "not slow")
OPTIONS = ("-x", "-q", "--tb=short", "-p", "no:cacheprovider", "-W", "ignore")
RECORDER = "record_value_of_place"
ENDLESS = 600  # s; the fast tests take some three, and who hangs has failed


@contextmanager
def _copy(module, text):
    """A folder with a copy of the source in which `module` has that text."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / "src", Path(folder, "src"))
        Path(folder, SOLVER, f"{module}.py").write_text(text, encoding="utf-8")
        yield Path(folder)


def fails(module, text):
    """Whether the fast tests fail, uncompiled, where `module` has that text."""
    with _copy(module, text) as folder:
        return _forked(folder) != 0


def whole_numbers(module, text):
    """Places of an observed text (see `mutants.observed`) whose values in the fast tests are whole numbers.

    Raises RuntimeError if these tests fail.
    """
    with _copy(module, text) as folder:
        if _forked(folder) != 0:
            raise RuntimeError(f"the right source fails: {Path(folder, 'output').read_text()[-2000:]}")
        kinds = json.loads(Path(folder, "kinds").read_text())
    return {int(place) for place, kind in kinds.items() if kind not in ("float", "float64", "ndarray")}


def fails_compiled(module, text):
    """Whether any physics test fails, compiled, where `module` has that text."""
    with _copy(module, text) as folder:
        path = os.pathsep.join(map(str, (folder / "src", ROOT)))
        settings = {name: value for name, value in os.environ.items() if name != "NUMBA_DISABLE_JIT"}
        settings |= {"PYTHONPATH": path, "XDG_CACHE_HOME": str(folder / "cache")}
        command = [sys.executable, "-m", "pytest", *OPTIONS, *ALL]
        return subprocess.run(command, cwd=ROOT, env=settings, stdout=subprocess.DEVNULL).returncode != 0


def _forked(folder):
    """Exit status of the fast tests in a copy of this process, which must not have imported the solver."""
    if any(name.partition(".")[0] == "hopperopt" for name in sys.modules):
        raise RuntimeError("the right source is loaded already")
    process = multiprocessing.get_context("fork").Process(target=_run, args=(folder,))
    process.start()
    process.join(ENDLESS)
    if process.is_alive():
        process.kill()
        process.join()
    return process.exitcode


def _run(folder):
    """Run the fast tests on a folder's source; leave output and the kinds of recorded values there."""
    import pytest

    output = os.open(folder / "output", os.O_WRONLY | os.O_CREAT)
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.chdir(ROOT)
    sys.path.insert(0, str(folder / "src"))
    os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
    from hopperopt import provenance

    # The tests name the cache of compiled code before numba is imported; here it is imported already.
    cache = folder / "cache" / "hopperopt" / provenance.numba_cache_name()
    os.environ["NUMBA_CACHE_DIR"] = str(cache)
    kinds = {}

    def record(place, value):
        kinds.setdefault(place, type(value).__name__)
        return value

    setattr(builtins, RECORDER, record)
    status = pytest.main([*OPTIONS, *FAST])
    Path(folder, "kinds").write_text(json.dumps(kinds))
    sys.stdout.flush()
    os._exit(int(status))

"""Digests change with what code does and with nothing else; the cache directory follows the solver's code."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hopperopt import provenance

FILES = {
    "__init__.py": '"""A package."""\n',
    "stage.py": "from demo import laws\nfrom .inner.deep import spin\n\ndef run():\n    import demo.lazy\n",
    "laws.py": "def force(x):\n    return 2 * x\n",
    "lazy.py": "import json\n",
    "other.py": "import demo.stage\n",
    "inner/__init__.py": "",
    "inner/deep.py": "from ..shared import constant\n",
    "shared.py": "constant = 1\n",
}


@pytest.fixture
def package(tmp_path):
    root = tmp_path / "demo"
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def digest_after(package, name, text):
    (package / name).write_text(text)
    os.utime(package / name, ns=(0, abs(hash(text))))
    return provenance.code_digest("demo.stage", package=package)


@pytest.mark.parametrize(
    "name", ["stage.py", "laws.py", "lazy.py", "inner/deep.py", "inner/__init__.py", "shared.py"]
)
def test_digest_follows_every_import(package, name):
    before = provenance.code_digest("demo.stage", package=package)
    assert digest_after(package, name, FILES[name] + "\nextra = 1\n") != before
    assert digest_after(package, name, FILES[name]) == before


def test_digest_ignores_comments_docstrings_layout_and_other_modules(package):
    before = provenance.code_digest("demo.stage", package=package)
    text = '"""Laws."""\n\n\ndef force(x):  # N\n    """F.\n\n    Linear.\n    """\n    return (2\n * x)\n'
    assert digest_after(package, "laws.py", text) == before
    assert digest_after(package, "other.py", "value = 3\n") == before


def test_digest_refuses_a_name_that_is_no_module(package):
    with pytest.raises(ValueError, match=r"demo\.typo is no module"):
        provenance.code_digest("demo.typo", package=package)


def test_cache_directory_is_writable_and_named_after_the_solver(package, tmp_path, monkeypatch):
    (package / "dem").mkdir()
    (package / "dem" / "laws.py").write_text("stiffness = 1\n")
    names = [provenance.numba_cache_name(package)]
    for name, stiffness in (("walls", 1), ("laws", 2), ("walls", 2)):
        (package / "dem" / f"{name}.py").write_text(f"stiffness = {stiffness}\n")
        names.append(provenance.numba_cache_name(package))
    assert len(set(names)) == 4
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.setitem(sys.modules, "numba", None)
    del sys.modules["numba"]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert provenance.use_numba_cache().is_relative_to(tmp_path / "cache")
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr(provenance.tempfile, "gettempdir", lambda: str(tmp_path / "elsewhere"))
    assert provenance.use_numba_cache().is_relative_to(tmp_path / "elsewhere")


def test_cache_directory_must_come_before_numba(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "numba", sys)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(RuntimeError, match="before numba"):
        provenance.use_numba_cache()


def test_only_one_process_holds_the_lock(tmp_path):
    """Two processes write a letter at each end of their turn under the lock: the turns never interleave."""
    program = (
        "import sys, time\nfrom hopperopt import provenance\n"
        "for _ in range(5):\n"
        "    with provenance.numba_cache_lock(), open(sys.argv[1], 'a') as log:\n"
        "        log.write('['); log.flush(); time.sleep(0.02); log.write(']')\n"
    )
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    arguments = [sys.executable, "-c", program, str(tmp_path / "log")]
    processes = [subprocess.Popen(arguments, env=environment) for _ in range(2)]
    assert [process.wait(timeout=60) for process in processes] == [0, 0]
    assert (tmp_path / "log").read_text() == "[]" * 10


def test_a_compiled_solver_is_loaded_without_the_lock():
    """While the lock is held: hundreds of simulations that start at once do not load one by one."""
    provenance.compile_solver()
    with provenance.numba_cache_lock():
        program = "from hopperopt import provenance; provenance.compile_solver()"
        subprocess.run([sys.executable, "-c", program], check=True, timeout=300)


def test_git_state_is_unknown_without_git(monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert provenance.git_state() == "unknown"
    assert provenance.attributes()["git"] == "unknown"


def test_git_state_is_unknown_inside_another_repository(monkeypatch, tmp_path):
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    (tmp_path / "__init__.py").write_text("")
    monkeypatch.setattr(provenance, "PACKAGE", Path(tmp_path))
    assert provenance.git_state() == "unknown"

"""Where a result comes from: digests of code, git, versions and host; and the compiled code's cache.

Digests decide what must be computed anew; git, versions and host are only recorded.
"""

import ast
import functools
import hashlib
import json
import logging
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from hopperopt import locks

PACKAGE = Path(__file__).resolve().parent
LIBRARIES = ("numpy", "numba", "scipy", "pandas", "xarray", "netCDF4", "scikit-learn", "pymoo", "snakemake")


def code_digest(*modules: str, package: Path = PACKAGE) -> str:
    """Digest of what the named modules can execute of this package.

    modules: dotted names, e.g. "hopperopt.experiment". The digest covers the code, without comments,
    docstrings and layout, of these modules and of all that they import from the package, at their top or
    inside functions. It is the same on every Python version. Nothing is imported. Raises ValueError for a
    name that is no module.
    """
    for module in modules:
        if _source_file(package, module) is None:
            raise ValueError(f"{module} is no module of {package}")
    texts, waiting = {}, list(modules)
    while waiting:
        module = waiting.pop()
        path = _source_file(package, module)
        if path is None or module in texts:
            continue
        texts[module], imports = _read_module(package, module, path, path.stat().st_mtime_ns)
        waiting += imports
    return hashlib.sha256(json.dumps(texts, sort_keys=True).encode()).hexdigest()[:20]


def files_digest(folder: Path, *names: str) -> str:
    """Digest of what stands in files of a folder."""
    return hashlib.sha256(b"\0".join((folder / name).read_bytes() for name in names)).hexdigest()[:20]


def numba_cache_name(package: Path = PACKAGE) -> str:
    """Name of the compiled solver's folder: another one after any change of the solver's files."""
    folder = package / "dem"
    return f"numba-{files_digest(folder, *sorted(path.name for path in folder.glob('*.py')))}"


def _source_file(package: Path, module: str) -> Path | None:
    """Path of a module of the package, None for anything else."""
    first, *rest = module.split(".")
    if first != package.name:
        return None
    place = package.joinpath(*rest)
    candidates = (place / "__init__.py", place.with_suffix(".py") if rest else place / "__init__.py")
    return next((path for path in candidates if path.is_file()), None)


@functools.cache
def _read_module(package: Path, module: str, path: Path, _mtime: int) -> tuple[str, tuple[str, ...]]:
    """Return a module's code as normalised text, and the names that it may import (some are no modules)."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    parent = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = parent[: len(parent) - node.level + 1] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            names += [source, *(f"{source}.{alias.name}" for alias in node.names)]
    # Importing a.b.c runs a and a.b as well.
    names += [
        ".".join(name.split(".")[:n]) for name in [module, *names] for n in range(1, name.count(".") + 1)
    ]
    return ast.unparse(_WithoutDocstrings().visit(tree)), tuple(sorted(set(names)))


class _WithoutDocstrings(ast.NodeTransformer):
    """Drops strings that stand alone as statements; a body left empty becomes `pass`."""

    def visit_Expr(self, node):
        return None if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str) else node

    def generic_visit(self, node):
        super().generic_visit(node)
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and not node.body:
            node.body = [ast.Pass()]
        return node


def version() -> str:
    """Version of this package, `unknown` where it is not installed."""
    return _version(PACKAGE.name)


def _version(library: str) -> str:
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return "unknown"


def git_state() -> str:
    """Commit of the clone that this package runs from, `-dirty` after local edits; `unknown` without git."""
    try:
        # A package inside another project's repository (say, its environment) is not tracked there.
        _git("ls-files", "--error-unmatch", "__init__.py")
        return _git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.SubprocessError):
        return "unknown"


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(PACKAGE), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=10).stdout.strip()


def attributes() -> dict[str, str]:
    """Attributes that say by what, where and when a file was made."""
    versions = {"python": platform.python_version(), **{name: _version(name) for name in LIBRARIES}}
    git, created = git_state(), datetime.now(UTC).isoformat(timespec="seconds")
    return {
        "hopperopt_version": version(),
        "git": git,
        "versions": json.dumps(versions),
        "host": f"{platform.node()} ({platform.system()} {platform.machine()}, {os.cpu_count()} cores)",
        "created": created,
        "history": f"{created} made by hopperopt {version()} (git {git})",
    }


def use_numba_cache() -> Path:
    """Give numba a cache directory of this solver's code and return it, before numba is imported.

    Numba does not see that a function called from another file has changed, hence a directory per digest of
    all of the solver's files, below $XDG_CACHE_HOME or ~/.cache, or below the temporary directory where that
    cannot be written.
    """
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~", ".cache").expanduser())
    fallback = Path(tempfile.gettempdir(), f"cache-{os.getuid()}")
    for base in (home, fallback):
        directory = base.absolute() / "hopperopt" / numba_cache_name()
        try:
            directory.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=directory).close()
        except OSError:
            continue
        break
    else:
        raise OSError(
            f"neither {home} nor {fallback} can be written: set XDG_CACHE_HOME to a writable directory"
        )
    if "numba" in sys.modules and os.environ.get("NUMBA_CACHE_DIR") != str(directory):
        raise RuntimeError("use_numba_cache() must be called before numba is imported")
    os.environ["NUMBA_CACHE_DIR"] = str(directory)
    return directory


@contextmanager
def numba_cache_lock() -> Iterator[None]:
    """Hold the lock of the compiled code's cache: the first process compiles, the others wait, then load.

    The lock ends with the process that holds it. A file system without locks is used without.
    """
    with locks.exclusive(use_numba_cache() / "lock"):
        yield


def is_compiled(threads: int = 1) -> bool:
    """Whether the solver for so many threads is in the cache."""
    return _mark(threads).exists()


def compile_solver(threads: int = 1) -> None:
    """Compile the solver for so many threads, or load it compiled: before a process's first time step.

    Who compiles marks the cache at its end, so that all others load at the same time and not one by one.
    """
    compiled = _mark(threads)
    if not compiled.exists():
        logging.info("compiling the solver, once for this code and kind of processor: a minute or two")
        with numba_cache_lock():
            if not compiled.exists():
                _load_solver(threads)
                compiled.touch()
                return
    _load_solver(threads)


def _mark(threads: int) -> Path:
    return use_numba_cache() / f"compiled-{_compiled_from(threads > 1)}"


def _compiled_from(parallel: bool) -> str:
    """Digest of all that numba looks at before it takes compiled code from its cache."""
    from llvmlite import binding  # slow to import

    sources = [(path.name, path.stat().st_mtime_ns) for path in sorted((PACKAGE / "dem").glob("*.py"))]
    processor = binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    things = [str(PACKAGE), sources, sys.version, _version("numba"), processor, parallel]
    return hashlib.sha256(json.dumps(things).encode()).hexdigest()[:20]


def _load_solver(threads: int) -> None:
    from hopperopt.dem.simulation import compile_solver as compile_all

    compile_all(threads)

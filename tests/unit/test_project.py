"""What the project promises about its own files: the lock, and which module may import which."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def lock():
    return (ROOT / "requirements.lock").read_text()


def requirements(lock):
    """Map each library of the lock to the versions it is listed with."""
    versions = {}
    for name, version in re.findall(r"^([\w.-]+)==(\S+)", lock, re.MULTILINE):
        versions.setdefault(name, []).append(version)
    return versions


def test_lock_holds_one_version_of_each_library(lock):
    assert {name: found for name, found in requirements(lock).items() if len(found) > 1} == {}


def test_no_library_is_bound_to_some_of_the_pythons(lock):
    assert [line for line in lock.splitlines() if re.search(r";.*python_(full_)?version", line)] == []


def test_lock_pins_the_build_backend(lock):
    assert "setuptools" in requirements(lock)


def test_lock_names_no_host_and_no_place(lock):
    assert re.findall(r"^.*(?://|--index|--find-links|-e |@ ).*$", lock, re.MULTILINE) == []


def test_boundaries_between_modules():
    command = [Path(sys.executable).with_name("lint-imports"), "--no-cache", "--no-logo"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr

"""A running simulation says that it lives, every few seconds, and takes it back at its end."""

import os
from types import SimpleNamespace

import pytest

from hopperopt import files, heartbeat


@pytest.fixture
def places(tmp_path):
    """Output and state directory."""
    return tmp_path / "simulations" / "a_rep_1.nc", tmp_path / ".state"


def report(particles=750, **changes):
    values = {"stage": "discharge", "time": 0.4, "particles": particles, "rate": 7.0e6, "remaining": 12.0}
    return SimpleNamespace(**values | changes)


def test_what_a_simulation_reports_can_be_read_until_its_end(places):
    now = 0.0
    with heartbeat.beating(*places, 1000, clock=lambda: now) as beat:
        (starting,) = heartbeat.read(places[1])
        assert (starting.stage, starting.output) == ("starting", "../simulations/a_rep_1.nc")
        now = 3.5
        beat(report())
        (told,) = heartbeat.read(places[1])
        assert (told.stage, told.time, told.rate, told.remaining) == ("discharge", 0.4, 7.0e6, 12.0)
        assert told.discharged == pytest.approx(0.25)
        assert told.pid == os.getpid() and told.host
        assert told.age < 30
    assert list(places[1].iterdir()) == []


def test_it_writes_every_few_seconds_at_most(places):
    now, seen = 0.0, set()
    with heartbeat.beating(*places, 1000, clock=lambda: now) as beat:
        for tenth in range(100):
            now = tenth / 10
            beat(report(time=now))
            seen.add(heartbeat.read(places[1])[0].time)
    assert len(seen) == 1 + int(9.9 / heartbeat.INTERVAL)


def test_an_interrupted_simulation_takes_it_back(places):
    with pytest.raises(KeyboardInterrupt), heartbeat.beating(*places, 1000):
        raise KeyboardInterrupt
    assert heartbeat.read(places[1]) == []


def test_the_next_attempt_takes_the_place_of_one_that_was_killed(places):
    path = heartbeat._file(*places)
    path.parent.mkdir()
    path.write_text("{")
    path.with_name(f".0123abcd.{path.name}").touch()
    assert heartbeat.read(places[1]) == []
    with heartbeat.beating(*places, 1000):
        assert [beat.stage for beat in heartbeat.read(places[1])] == ["starting"]
    assert list(places[1].iterdir()) == []


def test_a_full_disk_stops_nothing(places, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    with heartbeat.beating(*places, 1000) as beat:
        beat(report())
    assert list(places[1].iterdir()) == []


def test_the_age_is_by_the_clock_that_dates_the_files(places):
    """On a shared disk that may be hours apart from this machine's."""
    with heartbeat.beating(*places, 1000):
        path = heartbeat._file(*places)
        now = path.stat().st_mtime
        os.utime(path, (now - 90, now - 90))
        assert heartbeat.read(places[1])[0].age == pytest.approx(90, abs=30)
        os.utime(path, (now + 90, now + 90))
        assert heartbeat.read(places[1])[0].age == 0

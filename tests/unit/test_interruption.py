"""A command that is told to stop stops, even where a library swallows what it is told by."""

import os
import signal
import time

import pytest

from hopperopt import cli, dataset, files, interruption

LONG = 600.0  # s, which no command may go on


@pytest.fixture
def told(monkeypatch):
    """Function that runs a command whose stage does something; returns the exit status."""
    monkeypatch.setattr(interruption, "AGAIN", 0.05)

    def run(stage):
        monkeypatch.setattr(dataset, "write_plan", lambda *_: stage())
        before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
        status = cli.main(["design", "--params", "{}", "--output", "design.csv"])
        assert before == (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT))
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
        return status

    ignored = signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background of a shell
    yield run
    signal.signal(signal.SIGINT, ignored)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_an_interrupt_that_a_library_swallows_comes_again(told, capsys, number):
    swallowed = []

    def stage():
        try:
            os.kill(os.getpid(), number)
            time.sleep(LONG)
        except:  # noqa: E722 as netCDF4's own
            swallowed.append(number)
        time.sleep(LONG)

    assert told(stage) == 130
    assert swallowed
    assert capsys.readouterr().err.endswith("interrupted; the same command, or `make resume`, goes on\n")


def test_an_interrupt_that_a_library_takes_for_a_damaged_file_is_one(told, capsys):
    def stage():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(LONG)
        except:  # noqa: E722
            raise files.InputError("run.nc: is damaged") from None

    assert told(stage) == 130
    assert "damaged" not in capsys.readouterr().err


def test_what_ends_in_spite_of_a_swallowed_interrupt_has_ended_well(told, monkeypatch):
    monkeypatch.setattr(interruption, "AGAIN", LONG)

    def stage():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(LONG)
        except:  # noqa: E722
            pass

    assert told(stage) == 0


def test_an_interrupt_that_is_to_be_ignored_is(told):
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        assert told(lambda: os.kill(os.getpid(), signal.SIGINT)) == 0
    finally:
        signal.signal(signal.SIGINT, before)

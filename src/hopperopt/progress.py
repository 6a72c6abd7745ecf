"""How a simulation's progress is shown: one live line on a terminal, a plain line now and then in a log."""

import time
from collections.abc import Callable
from contextlib import suppress
from typing import TextIO

LOG_INTERVAL = 10.0  # s


class Reporter:
    """Callable that shows each progress report of a simulation on a text stream.

    A report has `stage`, `time` (simulated s), `particles` (left), `rate` (particle-steps/s) and `remaining`
    (s to go, None where it cannot be told). Used as a context, it ends a live line at the end.
    """

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic):
        self._stream = stream
        self._clock = clock
        self._live = stream.isatty()
        self._stage, self._due = None, 0.0
        self._open_line = False

    def __call__(self, report) -> None:
        """Show a report; in a log, only at a new stage and every ten seconds.

        A log that cannot be written, on a full disk, stops no simulation.
        """
        with suppress(OSError):
            if self._live:
                self._open_line = True
                self._stream.write(f"\r\x1b[2K{line(report)}")
            elif report.stage != self._stage or self._clock() >= self._due:
                self._stage, self._due = report.stage, self._clock() + LOG_INTERVAL
                self._stream.write(f"{line(report)}\n")
            self._stream.flush()

    def __enter__(self) -> "Reporter":
        return self

    def __exit__(self, *_) -> None:
        if self._open_line:
            self._stream.write("\n")
            self._stream.flush()


def line(report) -> str:
    """One line: stage, simulated time, particles left, speed, time to go."""
    to_go = "" if report.remaining is None else f", {duration(report.remaining)} to go"
    return (
        f"{report.stage:9} {report.time:7.3f} s simulated, {report.particles:6d} particles left, "
        f"{report.rate / 1e6:5.1f} million particle-steps/s{to_go}"
    )


def duration(seconds: float) -> str:
    """A time in words, to the second or, from an hour on, to the minute."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return (
        f"{hours} h {minutes:02d} min"
        if hours
        else f"{minutes} min {seconds:02d} s"
        if minutes
        else f"{seconds} s"
    )

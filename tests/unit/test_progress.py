"""A terminal gets one live line, a log a plain line now and then."""

import io
from types import SimpleNamespace

from hopperopt.progress import Reporter


class Terminal(io.StringIO):
    def isatty(self):
        return True


def report(stage="discharge", time=0.5, remaining=75.2):
    return SimpleNamespace(stage=stage, time=time, particles=8431, rate=7.1e6, remaining=remaining)


def test_a_terminal_has_one_line_that_ends_when_the_run_does():
    stream = Terminal()
    with Reporter(stream) as progress:
        for time in (0.5, 0.6, 0.7):
            progress(report(time=time))
        assert stream.getvalue().count("\n") == 0 and stream.getvalue().count("\r") == 3
    assert stream.getvalue().count("\n") == 1
    last = stream.getvalue().rsplit("\r", 1)[1]
    assert all(text in last for text in ("discharge", "0.700 s", "8431", "7.1 million", "1 min 15 s to go"))


def test_a_log_has_plain_lines_every_ten_seconds_and_at_a_new_stage():
    now = 0.0
    stream = io.StringIO()
    with Reporter(stream, clock=lambda: now) as progress:
        for second in range(25):
            now = float(second)
            progress(report("filling" if second < 3 else "discharge", time=now))
    lines = stream.getvalue().splitlines()
    assert [line.split()[:2] for line in lines] == [
        ["filling", "0.000"],
        ["discharge", "3.000"],
        ["discharge", "13.000"],
        ["discharge", "23.000"],
    ]
    assert "\r" not in stream.getvalue() and "\x1b" not in stream.getvalue()


def test_no_time_to_go_is_shown_where_none_is_known():
    stream = io.StringIO()
    Reporter(stream)(report(remaining=None))
    assert "to go" not in stream.getvalue()

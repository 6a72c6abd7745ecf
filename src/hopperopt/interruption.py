"""Being told to stop, by SIGTERM or Ctrl-C: a KeyboardInterrupt that cannot get lost."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

AGAIN = 5.0  # s, longer than what is left to do after an interrupt


@contextmanager
def interruptible() -> Iterator[None]:
    """Raise KeyboardInterrupt in the block at SIGTERM or SIGINT, and each 5 s anew until the block has ended.

    netCDF4 has places with a bare `except:`, where one in some hundred interrupts of a reading loop ends, or
    turns into an error of the file. So one is repeated, and whatever else the block raises after it is taken
    for it. A signal that the process was started to ignore stays ignored. For the main thread.
    """
    told = False

    def tell(*_):
        nonlocal told
        told = True
        signal.setitimer(signal.ITIMER_REAL, AGAIN)
        raise KeyboardInterrupt

    wanted = [s for s in (signal.SIGTERM, signal.SIGINT) if signal.getsignal(s) != signal.SIG_IGN]
    before = {number: signal.signal(number, tell) for number in (*wanted, signal.SIGALRM)}
    try:
        yield
    except Exception:
        if told:
            raise KeyboardInterrupt from None
        raise
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in before.items():
            signal.signal(number, handler)

"""The seconds of a run, shared among its parts: who takes too long is stopped, and the run goes on without."""

from __future__ import annotations

import faulthandler
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

#: A part may take so many times an equal share of what is left, since most need less; but half of it at most, if others follow.
SHARES = 3
#: A program that goes on so many seconds after its time is ended.
LAST = 60.0
#: Whoever goes on although it was stopped is stopped again after so many seconds.
AGAIN = 1.0


class StoppedError(BaseException):
    """Its time is over, as the message says. No ``Exception``, since contestants handle those."""


@dataclass
class Budget:
    """Seconds for so many parts, from now on. What a part does not need is left for those after it."""

    seconds: float
    parts: int = 1

    def __post_init__(self) -> None:
        """Begins."""
        self.end = time.perf_counter() + self.seconds

    def part(self, parts: int = 1) -> Budget:
        """That of the next part, which has so many parts itself."""
        left = max(0.0, self.end - time.perf_counter())
        share = min(0.5, SHARES / self.parts) if self.parts > 1 else 1.0
        self.parts -= 1
        return Budget(share * left, parts)

    @contextmanager
    def last_resort(self) -> Iterator[None]:
        """A call of C that never returns cannot be stopped alone: it ends the program, with a trace that says where."""
        faulthandler.dump_traceback_later(self.seconds + LAST, exit=True)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()

    @contextmanager
    def limit(self) -> Iterator[None]:
        """Stops what is inside when the time is over, as Ctrl-C would: Python, stepwell, and others between their calls of C."""

        def stop(*_: object) -> None:
            raise StoppedError(f"stopped after {self.seconds:.3g} s")

        if not hasattr(signal, "setitimer"):
            yield
            return
        before = signal.signal(signal.SIGALRM, stop)
        signal.setitimer(signal.ITIMER_REAL, max(1e-3, self.end - time.perf_counter()), AGAIN)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)

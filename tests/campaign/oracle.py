"""What a fuzzed call may do: end in one of stepwell's own errors that names an argument, or return what is whole.

Everything else is a failure: whatever NumPy, Python or the core raise by themselves, a panic, a result that is not finite where
it says that it is, bits that differ from those of the reference, a call that cannot be interrupted.
"""

from __future__ import annotations

import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
import stepwell as sw

#: Seconds of the CPU after which a call is stopped: a call that asks for much work, and any other.
ASKED, ENOUGH = 0.01, 1.0

#: A call that was told to stop ends so many seconds of the CPU later. The test of Ctrl-C says a tenth on a free machine.
UNTIL_STOPPED = 1.0

#: The longest message.
LONGEST_MESSAGE = 1500


class StoppedError(BaseException):
    """A call took its time."""


class Outcome(NamedTuple):
    """What became of a call.

    Attributes:
        kind: "refused", "worked", "stopped", "memory", or "failed".
        text: what is wrong, for a failure.
        place: where it was raised: two failures of one place are one.
    """

    kind: str
    text: str = ""
    place: str = ""


class Timer:
    """Stops a call after so many seconds of the CPU; other processes of the machine do not count."""

    def __init__(self) -> None:
        self.armed = False

    def __enter__(self) -> Timer:
        self.before = signal.signal(signal.SIGPROF, self._ring)
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        signal.signal(signal.SIGPROF, self.before)

    def _ring(self, _: int, frame: Any) -> None:
        while frame is not None and frame.f_code is not judged.__code__:  # what is around a call does not count
            # No places to raise from: a module that is half imported stays so.
            if frame.f_code.co_name == "__del__" or any(each in frame.f_code.co_filename for each in ("hypothesis", "importlib")):
                return
            frame = frame.f_back
        if self.armed:
            raise StoppedError

    def start(self, seconds: float) -> None:
        """From now on."""
        self.armed = True
        # Again and again: one that comes where nothing can be raised is lost.
        signal.setitimer(signal.ITIMER_PROF, seconds, 0.05)

    def stop(self) -> None:
        """Not any more."""
        self.armed = False
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def judged(timer: Timer, call: Callable[..., Any], arguments: dict[str, Any], names: Iterable[str], seconds: float) -> Outcome:
    """Make a call whose strange arguments have these names."""
    begin = time.process_time()
    try:
        try:
            timer.start(seconds)
            result = call(**arguments)
        finally:
            timer.armed = False
        timer.stop()
    except StoppedError:
        timer.stop()
        late = time.process_time() - begin - seconds
        return Outcome("failed", f"stopped {late:.1f} s late", "late") if late > UNTIL_STOPPED else Outcome("stopped")
    except sw.StepwellError as error:
        timer.stop()
        return _refusal(str(error), [*names, *arguments])
    except MemoryError as error:
        timer.stop()
        return Outcome("memory", str(error))
    except BaseException as error:  # a panic of the core is no Exception
        timer.stop()
        if isinstance(error, KeyboardInterrupt):
            raise
        return Outcome("failed", f"{type(error).__name__}: {str(error)[:300]}", place_of(error))
    wrong = unsound(result)
    return Outcome("failed", wrong, wrong[:30]) if wrong else Outcome("worked")


#: Words beside the arguments' names by which a message says what it is about.
OTHERS = ("method", "scene", "peers", "not installed", "path", "carry", "n: ", "steps: ", "at: ", "omega", "relative")


def _refusal(text: str, names: list[str]) -> Outcome:
    if len(text) > LONGEST_MESSAGE:
        return Outcome("failed", f"a message of {len(text)} characters: {text[:200]}", "long message")
    if not any(name in text for name in (*names, *OTHERS)):
        return Outcome("failed", f"names no argument: {text[:200]}", f"unnamed: {text[:20]}")
    return Outcome("refused")


def place_of(error: BaseException) -> str:
    """The last line of the package that an error went through."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "/stepwell/" in frame.filename] or frames
    last = own[-1] if own else None
    where = f"{last.filename.rpartition('/stepwell/')[2]}: {last.name}" if last else "?"
    return f"{type(error).__name__} in {where}"


def unsound(result: Any) -> str:
    """What is wrong with a result; nothing if there is nothing."""
    if isinstance(result, sw.Run):
        return _unsound_run(result)
    if isinstance(result, sw.World) and not (result.v.dtype == result.y.dtype == np.float64):
        return f"a world of {result.v.dtype}"
    return ""


def _unsound_run(run: sw.Run) -> str:
    saved = len(run.t)
    if len(run.v) != saved or len(run.y) != saved or run.status.shape != run.first_bad_step.shape:
        return f"shapes: t {run.t.shape}, v {run.v.shape}, y {run.y.shape}, status {run.status.shape}"
    batch = run.status.shape
    for block, shape in (("v", run.system.v_shape), ("y", run.system.y_shape)):
        array = getattr(run, block)
        if array.shape != (saved, *shape, *batch) or array.dtype != np.float64:
            return f"{block}: {array.dtype} of shape {array.shape} for {saved} states of {shape} and a batch of {batch}"
        if not np.isfinite(array[..., run.status == sw.Status.OK]).all():
            return f"{block} is not finite, though it says so"
    if not np.isfinite(run.t).all() or (len(run.t) > 1 and (np.diff(run.t) < 0.0).any()):
        return f"times: {run.t[:5]}"
    if ((run.first_bad_step >= 0) != np.isin(run.status, [1, 2, 3, 4])).any():
        return f"status {run.status} with first bad steps {run.first_bad_step}"
    return ""


def quiet() -> None:
    """Make of every warning an error, but those of stepwell that say what a run did."""
    import warnings

    warnings.resetwarnings()
    warnings.simplefilter("error")
    for kind in (sw.DivergenceWarning, sw.ToleranceWarning, sw.ControlWarning, sw.AccuracyWarning):
        warnings.simplefilter("ignore", kind)
    warnings.filterwarnings("ignore", "a rod is .* off its length")
    warnings.filterwarnings("ignore", "Implicitly cleaning up")  # folders of the tests, when the process ends
    sys.set_int_max_str_digits(0)

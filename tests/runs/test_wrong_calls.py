"""Wrong calls by the hundred: each argument of every public function, given what it is not made for.

Such a call either works or ends, quickly, in one of stepwell's own errors that names an argument. Everything raw that is raised
by something below (NumPy, the core, Python inside a function) is a failure of the checks.
"""

import inspect
import random
import signal
import time
import warnings
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import pytest
import stepwell as sw
from stepwell.analysis import stability
from stepwell.views import charts
from support import own_systems as own
from support.cases import number
from support.families import family
from support.wrong_calls import A_RUN, CALLS, JUNK, SAVED, SAVED_OWN

#: What a call may take: ten times what the slowest right one does on a busy machine. What takes longer was accepted and works.
SECONDS = 1.0


A_RUN.save(SAVED)
sw.integrate(own.pendulum, "rk4", v=0.0, y=1.0, dt=0.1, steps=3).save(SAVED_OWN)


timer = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="there is no timer here")


@pytest.fixture(autouse=True, scope="module")
def slow_imports() -> None:
    """What calls import: an import that the timer cuts short would break all later ones."""
    for name in ("pandas", "xarray", "matplotlib.figure"):
        if find_spec(name.partition(".")[0]):
            import_module(name)


class TookLongError(Exception):
    """A call was accepted and works."""


def wrong(call: Callable[..., Any], options: dict[str, Any], argument: str, make: Callable[[], Any]) -> str | None:
    """What is wrong with how a call treats something strange, or None."""

    calls = True

    def enough(_: int, frame: Any) -> None:
        if not calls:  # the time was over as the call ended
            return
        while frame is not None:
            if "hypothesis" in frame.f_code.co_filename:  # its callback within a collection of garbage: no place to raise from
                signal.setitimer(signal.ITIMER_REAL, 0.01)
                return
            frame = frame.f_back
        raise TookLongError

    value = make()
    before = signal.signal(signal.SIGALRM, enough)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    begin = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for kind in (sw.DivergenceWarning, sw.ToleranceWarning, sw.ControlWarning, sw.AccuracyWarning, sw.StiffnessWarning):
                warnings.simplefilter("ignore", kind)
            call(**options | {argument: value})
    except TookLongError:
        return None
    except sw.StepwellError as error:
        text, took = str(error), time.perf_counter() - begin
        if took > SECONDS:
            return f"refused after {took:.1f} s: {text[:200]}"
        if len(text) > 1500:
            return f"a message of {len(text)} characters: {text[:200]}"
        names = [argument, *options, "elements", "method", "scene", "peers", "not installed"]
        return None if any(name in text for name in names) else f"names no argument: {text[:200]}"
    except BaseException as error:  # a panic of the core is no Exception
        return f"{type(error).__name__}: {str(error)[:200]}"
    finally:
        calls = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    return None


#: What is known and left: steps so long that the elements of P overflow are not refused, and NumPy warns of them.
KNOWN = {("analyse at", "dt", "10**12"), ("analyse v y", "dt", "10**12")}

#: An ordinary run of the tests takes every SHARE-th of them, others for each argument; the long one takes all.
SHARE = 19


@timer
@pytest.mark.parametrize("share", family((SHARE, 1), lambda share: share > 1))
@pytest.mark.parametrize("name", CALLS)
def test_calls_work_or_say_what_is_wrong(name: str, share: int) -> None:
    call, options = CALLS[name]
    bad = {
        f"{argument} = {junk}": text
        for i, argument in enumerate(options)
        for junk in list(JUNK)[(i + number(name)) % share :: share]
        if (name, argument, junk) not in KNOWN and (text := wrong(call, options, argument, JUNK[junk])) is not None
    }
    assert not bad, "\n" + "\n".join(f"{strange}: {text}" for strange, text in bad.items())


@timer
def test_several_strange_arguments_at_once() -> None:
    """What is looked at first may hide what comes next: two to four arguments of ``integrate``, drawn once and for all."""
    draw = random.Random(1)
    names = [name for name in CALLS if name.startswith("integrate")]
    for _ in range(700):
        call, options = CALLS[name := draw.choice(names)]
        chosen = {argument: draw.choice(list(JUNK)) for argument in draw.sample(list(options), draw.randint(2, 4))}
        (last, junk), *others = chosen.items()
        text = wrong(call, options | {argument: JUNK[each]() for argument, each in others}, last, JUNK[junk])
        assert text is None, f"{name} with {chosen}: {text}"


def test_right_calls_are_right() -> None:
    """Else what is strange would hide behind what is wrong anyway; peers are not installed everywhere."""
    for name, (call, options) in CALLS.items():
        if not name.startswith("charts.peers."):
            call(**options)


def test_every_public_function_is_here() -> None:
    """And every class that users make, which is what has no base beside ``Exception`` and is not returned by a function."""
    modules = (sw, charts, stability, charts.peers, sw.scenes)
    every = {name: getattr(module, name) for module in modules for name in dir(module) if not name.startswith("_")}
    classes = (sw.System, sw.Sinusoid, sw.Sampled, sw.EnergyControl, sw.Projection, charts.Peer, sw.Scene)
    wanted = {
        name
        for name, each in every.items()
        if getattr(each, "__module__", "").startswith("stepwell.")
        and (inspect.isfunction(each) or (isinstance(each, type) and issubclass(each, classes)))
        and inspect.signature(each).parameters
    }
    here = {call for call, _ in CALLS.values()}
    assert {name for name in wanted if every[name] not in here} <= {
        *("known", "count", "numbers", "short", "same"),  # imported
        *("system", "controller"),  # decorators, whose wrong calls are in test_equations.py and test_controllers.py
    }
    assert len(wanted) > 30

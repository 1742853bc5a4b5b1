"""All errors and warnings of stepwell, in one hierarchy.

A message has the argument's name, what was expected, and what was given.
"""

from __future__ import annotations

from contextvars import ContextVar

#: The errors of the function that is being traced, in their order; None while none is.
REFUSED: ContextVar[list[TraceError] | None] = ContextVar("refused", default=None)


class StepwellError(Exception):
    """The base class of every error that stepwell raises intentionally.

    Example:
        >>> try:
        ...     sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.0, steps=10)
        ... except sw.StepwellError as error:
        ...     print(error)
        dt: expected a number other than zero in units of time, got 0
    """


class ArgumentError(StepwellError, ValueError):
    """An argument has a value that cannot be used."""


class UnknownNameError(ArgumentError, LookupError):
    """No method, system, scene or option has that name; the message names the nearest one."""


class ShapeError(ArgumentError):
    """An array has a shape that does not fit."""


class DTypeError(ArgumentError, TypeError):
    """A value is not a number, or an array has a dtype that cannot be stepped in place."""


class NotFiniteError(ArgumentError):
    """An input holds NaN or an infinity."""


class TraceError(ArgumentError):
    """A user's own equations do something that cannot be traced; the message names the line and what to write instead."""

    #: True if the cause may be that the state has another shape than the function expects.
    of_shape = False

    def __init__(self, *args: object) -> None:
        super().__init__(*args)
        # A user's `except Exception` may swallow it; what is traced after that are not the user's equations.
        if (refused := REFUSED.get()) is not None:
            refused.append(self)


class TooLargeError(ArgumentError, MemoryError):
    """The results of a call would not fit in memory."""


class UnsupportedError(StepwellError, ValueError):
    """A method cannot step a system, or an option is not supported for it."""


class BusyError(StepwellError, RuntimeError):
    """Another thread is stepping the same world, or a world over the same arrays."""


class FixedError(StepwellError, AttributeError):
    """A fixed attribute was assigned; the message says what to do instead."""


class DivergenceWarning(UserWarning):
    """Some members left the range of finite numbers. ``Run.first_bad_step`` says when; the others are not affected.

    Example:
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always", sw.DivergenceWarning)
        ...     run = sw.integrate(sw.Oscillator(30.0), "false_euler", v=0.0, y=1.0, dt=0.1, steps=1000)
        >>> str(caught[0].message)
        'the run diverged at step 369 (t = 36.9), by false_euler with dt = 0.1'
    """


class ToleranceWarning(UserWarning):
    """Some members stopped before the last output time: out of steps, or their steps became too short to change the time.

    A run also warns if an absolute tolerance is so large that the motion is lost in it.

    Example:
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always", sw.ToleranceWarning)
        ...     run = sw.integrate(sw.Oscillator(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[99.0], max_steps=9)
        >>> bool(run.status == sw.Status.BUDGET)
        True
    """


class StiffnessWarning(UserWarning):
    """Stability, and not the tolerance, holds down the adaptive steps of some members: their equations are stiff.

    The results are right. A method that is stable with longer steps would need far fewer of them.

    Example:
        >>> @sw.system(order=1)
        ... def stiff(t, y): return np.array([-y[0], -1e4 * (y[1] - y[0])])
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always", sw.StiffnessWarning)
        ...     run = sw.integrate(stiff, "merson", y=np.ones(2), tolerance=1e-6, at=[5.0])
        >>> str(caught[0].message).partition(":")[0]
        'stability, and not the tolerance, held down the steps of the run'
    """


class ControlWarning(UserWarning):
    """A control is so strong that it overshoots.

    Example:
        >>> bodies = sw.scenes.energy_control()
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always", sw.ControlWarning)
        ...     run = bodies.run("standard_euler", steps=1, control=sw.EnergyControl(1e3, "printed"))
        >>> caught[0].category.__name__
        'ControlWarning'
    """


class EventWarning(UserWarning):
    """Some members came to rest at an event: its changes of the state follow each other within no time, or lead back onto it.

    Example:
        >>> @sw.system
        ... def ball(t, v, y): return -9.81
        >>> ground = sw.Event(lambda t, v, y: y, direction=-1, then=lambda t, v, y: (-0.5 * v, y), name="ground")
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always", sw.EventWarning)
        ...     run = sw.integrate(ball(), "rk4", v=0.0, y=1.0, dt=0.01, steps=300, events=ground)
        >>> bool(run.status == sw.Status.REST), float(run.stopped_at.round(6))  # √(2/9.81)·(1 + 0.5)/(1 − 0.5)
        (True, 1.354571)
    """


class AccuracyWarning(UserWarning):
    """A run stayed finite, but its numbers are known to be meaningless.

    Example:
        >>> bodies = sw.scenes.pythagorean()
        >>> with warnings.catch_warnings(record=True) as caught:
        ...     warnings.simplefilter("always", sw.AccuracyWarning)
        ...     run = bodies.run("rk4", bodies.horizon / 30_000)
        >>> str(caught[0].message)[:41]
        'the run has another energy at the end: 5.'
    """

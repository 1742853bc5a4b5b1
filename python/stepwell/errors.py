"""All errors and warnings of stepwell, in one hierarchy.

A message says what was given, what was expected, and the argument's name.
"""

from __future__ import annotations


class StepwellError(Exception):
    """The base class of every error that stepwell raises intentionally."""


class ArgumentError(StepwellError, ValueError):
    """An argument has a value that cannot be used."""


class UnknownNameError(ArgumentError, LookupError):
    """There is no method, system, scene or option of that name; the message names the nearest one."""


class ShapeError(ArgumentError):
    """An array has a shape that does not fit."""


class DTypeError(ArgumentError, TypeError):
    """A value is not a number, or an array has a dtype that cannot be stepped in place."""


class NotFiniteError(ArgumentError):
    """An input holds NaN or an infinity."""


class TraceError(ArgumentError):
    """A user's own equations do something that cannot be traced; the message names the line and what to write instead."""

    #: Whether the cause may be a state of another shape than the function expects.
    of_shape = False


class TooLargeError(ArgumentError, MemoryError):
    """The results of a call would not fit in memory."""


class UnsupportedError(StepwellError, ValueError):
    """A method cannot step a system, or an option is not supported for it."""


class BusyError(StepwellError, RuntimeError):
    """A thread called ``World.step`` while another thread steps the same world."""


class FixedError(StepwellError, AttributeError):
    """A fixed attribute was assigned; the message says what to do instead."""


class DivergenceWarning(UserWarning):
    """Some members left the range of finite numbers. ``Run.first_bad_step`` says when; the others are not affected."""


class ToleranceWarning(UserWarning):
    """Some members stopped before the last output time: out of steps, or their steps became too short to change the time.

    It is also given if an absolute tolerance is so large that the motion is lost in it.
    """


class ControlWarning(UserWarning):
    """A control is so strong that it overshoots."""


class AccuracyWarning(UserWarning):
    """A run stayed finite, but its numbers are known to be meaningless."""

"""Everything that stepwell raises or warns of, in one tree.

A message says what was given, what was expected, and the argument's name.
"""

from __future__ import annotations


class StepwellError(Exception):
    """The root: catching it catches every error that stepwell raises by intention."""


class ArgumentError(StepwellError, ValueError):
    """An argument has a value that cannot be used."""


class UnknownNameError(ArgumentError, LookupError):
    """There is no method, system, scene or option of that name; the message names the nearest one."""


class ShapeError(ArgumentError):
    """An array has a shape that does not fit."""


class DTypeError(ArgumentError, TypeError):
    """A value is of a kind that is no number, or an array of a kind that cannot be stepped in place."""


class NotFiniteError(ArgumentError):
    """An input holds NaN or an infinity."""


class TraceError(ArgumentError):
    """A function of a user's own equations does what cannot be traced; the message names its line and what to write instead."""

    #: Whether it may be that the state had another shape than the function is for.
    of_shape = False


class TooLargeError(ArgumentError, MemoryError):
    """What was asked for does not fit in memory."""


class UnsupportedError(StepwellError, ValueError):
    """A method cannot do what a system asks for."""


class BusyError(StepwellError, RuntimeError):
    """A ``World`` was asked to step by one thread while another one steps it."""


class FixedError(StepwellError, AttributeError):
    """What stands once and for all was assigned; the message says how to have another."""


class DivergenceWarning(UserWarning):
    """Some members left the range of finite numbers. Their rows say when; their neighbours are not touched."""


class ToleranceWarning(UserWarning):
    """Some members stopped before the last asked time: out of steps, or their steps became too small to move the time.

    Or an absolute tolerance is so large that the motion is lost in it.
    """


class ControlWarning(UserWarning):
    """A control is so strong that it overshoots."""


class AccuracyWarning(UserWarning):
    """A run stayed finite, and yet it can be seen that its numbers mean nothing."""

"""Events: locate sign changes of a quantity along a trajectory, and stop or change the member there if asked."""

from .event import Event
from .result import Occurrences

__all__ = ["Event", "Occurrences"]

"""Events: locate sign changes of a quantity along a trajectory, and stop or change the member there if asked."""

from ..occurrences import Occurrences
from .event import Event

__all__ = ["Event", "Occurrences"]

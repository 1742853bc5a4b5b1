"""Events: where in its motion a quantity of a member changes its sign; whether the member goes on from there."""

from .event import Event
from .result import Occurrences

__all__ = ["Event", "Occurrences"]

"""Derivatives of what a tape computes, as further operations on the same tape.

In ``stepwell.reference.tape``, ``modes`` differentiates forwards and backwards, ``rules`` has a derivative for each operation and
each function, ``listing`` reads a tape back, and ``evaluate`` runs one over NumPy arrays. ``traced`` does all of it for the rates
of a system and for a step of a method. ``stepwell.analysis.dynamics`` uses it.
"""

from ...reference.tape.evaluate import Evaluation
from ...reference.tape.modes import directional, gradient, jacobian

__all__ = ["Evaluation", "directional", "gradient", "jacobian"]

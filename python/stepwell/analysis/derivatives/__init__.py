"""Derivatives of what a tape computes, as further operations on the same tape.

``modes`` differentiates forwards and backwards, ``rules`` has a derivative for each operation and each function, ``listing``
reads a tape back, ``evaluate`` runs one over NumPy arrays, ``traced`` does all of it for a system's rates and for a step of a
method. Their uses are in ``stepwell.dynamics``.
"""

from ...reference.tape.evaluate import Evaluation
from ...reference.tape.modes import directional, gradient, jacobian

__all__ = ["Evaluation", "directional", "gradient", "jacobian"]

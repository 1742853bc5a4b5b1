"""Derivatives of a tape, under the name that users write."""

from ..model.derivatives import Evaluation, directional, gradient, jacobian

__all__ = ["Evaluation", "directional", "gradient", "jacobian"]

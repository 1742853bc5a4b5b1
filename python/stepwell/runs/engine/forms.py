"""A run in its form: by the formulas of the method, or by the transition matrix."""

from __future__ import annotations

from ... import _core
from ...base.arrays import Array, Whole
from .direct import advance_direct, first_bad_steps
from .plan import Outcome, Plan
from .plan import model as model_of_operations


def model(plan: Plan) -> _core.ModelSpec:
    """The model of a plan, as the core takes it."""
    if plan.method.is_exact:
        from . import linear  # only such runs need it

        spec: _core.ModelSpec = linear.exact_model(plan)
        return spec
    return model_of_operations(plan)


def advance(plan: Plan, v: Array, y: Array, before: Whole | None = None, *, carried: bool = False) -> Outcome:
    """Make the run. ``v`` is what the method carries if ``carried``; v and y have the shape of a block and the batch.

    ``before`` has the first bad steps of earlier runs, −1 for members that were finite so far.
    """
    if plan.form == "direct":
        return advance_direct(plan, v, y, before, carried=carried)
    from . import linear  # only such runs need it

    return linear.by_matrix(plan, v, y, first_bad_steps(plan, before), carried)

"""The digest of an own system's operations, by which a resumed or saved run recognises the system."""

from __future__ import annotations

import hashlib
from typing import Any

from ... import _core
from ...base.immutable import changed
from ...reference.traced import Tracer
from ..controls import Projection
from .base import System


def digest(system: System) -> str:
    """A hash of the operations of an own system: rates, friction, invariants, and the gradient of one that is kept."""
    known: Any = system
    if known.equations is None:
        known = known.for_state_shapes()
    tape = _core.Tape()
    tracer = Tracer(changed(known, around=()), tape)
    v, y, _ = tracer.state()
    s = tracer.scaled(tape.step())
    values = tracer.flat(*s.rates(tape.time(), v, y))
    for name in known.quantities:
        values += tracer.flat(s.record(name, v, y))
    if isinstance(known.keeper, Projection):
        values += tracer.flat(*s.gradient(v, y))
    values += [each for block in known.friction_operations(tracer, s, v, y) for each in block]
    operations = repr(tape.operations(values))
    if known.friction_on is not None:
        operations += repr((known.friction_on.of, known.friction_on.component))
    if known.mass_matrix is not None:
        operations += repr(known.mass_matrix.rows)
    return hashlib.sha256(operations.encode()).hexdigest()

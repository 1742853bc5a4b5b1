"""The methods of ``solve_ivp``: those of stepwell that estimate their error, and what stands in for SciPy's others."""

from __future__ import annotations

import warnings
from typing import Any

from ..base import checks
from ..errors import DTypeError, UnsupportedError
from ..model.methods import Method, for_stiff
from ..model.methods import method as find_method
from ..model.methods import methods as every_method

#: Method if none is named. SciPy then takes RK45, which mostly costs more.
DEFAULT = "dop853"

#: Methods for stiff equations that are not here. With a warning, that of the tolerance is taken for them.
FOR_STIFF = ("Radau", "BDF", "LSODA", "Rosenbrock")


def chosen(method: Any, tolerance: float) -> tuple[Method, Method | None]:
    """The method of that name, or of that class of SciPy, and the one to go over to if equations are stiff, or None.

    In place of methods for stiff equations that are not here the one for this relative tolerance is taken, with a warning.
    """
    if method is None:
        return find_method(DEFAULT), None
    name = method.__name__ if isinstance(method, type) else method
    if not isinstance(name, (str, Method)):
        raise DTypeError(f"method: expected a name, got {checks.short(method)} ({type(method).__name__})")
    if absent := next((each for each in FOR_STIFF if each.lower() == str(name).lower()), None):
        stiff = for_stiff(tolerance)
        assert stiff is not None
        is_both = absent == "LSODA"
        taken, names = f"{stiff.name} is taken, a Rosenbrock method for stiff equations", f"method={stiff.name!r}"
        if is_both:
            taken, names = f"{DEFAULT} is taken, and {stiff.name} if equations are stiff", f"method={DEFAULT!r} or {names}"
        warnings.warn(f"method: {absent} is not here; {taken}. Write {names} to agree", UserWarning, stacklevel=3)
        return (find_method(DEFAULT), stiff) if is_both else (stiff, None)
    solver = find_method(name)
    if solver.error_order is None:
        able = ", ".join(repr(each.name) for each in every_method() if each.error_order is not None)
        raise UnsupportedError(
            f"method: {solver.name} does not estimate its error, so it cannot choose its steps; write one of these: {able}; "
            f"or use stepwell.integrate with dt= and steps="
        )
    return solver, None

"""The methods of ``solve_ivp``: those of stepwell that estimate their error, and what stands in for SciPy's others."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import Any

from ..base import checks
from ..errors import DTypeError, UnknownNameError, UnsupportedError
from ..model.methods import Method
from ..model.methods import method as find_method
from ..model.methods import methods as every_method

#: What is taken if no method is named. SciPy then takes RK45, which is not here.
DEFAULT = "dop853"

#: SciPy's methods that are not here: what they are.
ABSENT = {
    "RK45": "Dormand-Prince 5(4), which is not here",
    "RK23": "Bogacki-Shampine 3(2), which is not here",
}

#: What is taken, with a warning, in place of methods for stiff equations that are not here: of like order, and L-stable.
STAND_IN = {"Radau": "rodas5p", "BDF": "rodas4", "LSODA": "rodas4", "Rosenbrock": "rodas4"}


def chosen(method: Any) -> Method:
    """The method of that name, or of that class of SciPy; with a warning the nearest to one for stiff equations.

    Raises:
        UnknownNameError: if it is a method of SciPy that is not here, or if there is none of that name.
        UnsupportedError: if it cannot choose its steps.
    """
    if method is None:
        return find_method(DEFAULT)
    name = method.__name__ if isinstance(method, type) else method
    if not isinstance(name, (str, Method)):
        raise DTypeError(f"method: expected a name, got {checks.short(method)} ({type(method).__name__})")
    if stand_in := _same_but_case(name, STAND_IN):
        warnings.warn(
            f"method: {stand_in} is not here; {STAND_IN[stand_in]} is taken, a Rosenbrock method for stiff equations. Write "
            f"method={STAND_IN[stand_in]!r} to agree",
            UserWarning,
            stacklevel=3,
        )
        return find_method(STAND_IN[stand_in])
    try:
        solver = find_method(name)
    except UnknownNameError:
        if (absent := _same_but_case(name, ABSENT)) is None:
            raise
        advice = "for another method that chooses its steps, write one of these"
        raise UnknownNameError(f"method: {absent} is {ABSENT[absent]}; {advice}: {_able()}") from None
    if solver.error_order is None:
        raise UnsupportedError(
            f"method: {solver.name} does not estimate its error, so it cannot choose its steps; write one of these: {_able()}; "
            f"or use stepwell.integrate with dt= and steps="
        )
    return solver


def _same_but_case(name: Any, names: Iterable[str]) -> str | None:
    return next((each for each in names if each.lower() == str(name).lower()), None)


def _able() -> str:
    return ", ".join(repr(each.name) for each in every_method() if each.error_order is not None)

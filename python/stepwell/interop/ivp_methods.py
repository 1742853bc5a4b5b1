"""The methods of ``solve_ivp``: those of stepwell that estimate their error, and what is said of SciPy's others."""

from __future__ import annotations

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
    "Radau": "an implicit method for stiff equations, and there are none here",
    "BDF": "an implicit method for stiff equations, and there are none here",
    "LSODA": "a method that becomes implicit where equations are stiff, and there are none here",
}

#: Of these the equations need an implicit method, so another program is recommended.
IMPLICIT = ("Radau", "BDF", "LSODA")


def chosen(method: Any) -> Method:
    """The method of that name, or of that class of SciPy.

    Raises:
        UnknownNameError: if it is a method of SciPy that is not here, or if there is none of that name.
        UnsupportedError: if it cannot choose its steps.
    """
    if method is None:
        return find_method(DEFAULT)
    name = method.__name__ if isinstance(method, type) else method
    if not isinstance(name, (str, Method)):
        raise DTypeError(f"method: expected a name, got {checks.short(method)} ({type(method).__name__})")
    try:
        solver = find_method(name)
    except UnknownNameError:
        absent = next((each for each in ABSENT if each.lower() == str(name).lower()), None)
        if absent is None:
            raise
        advice = (
            "if they are stiff, stay with SciPy for them; if not,"
            if absent in IMPLICIT
            else "for another method that chooses its steps,"
        )
        raise UnknownNameError(f"method: {absent} is {ABSENT[absent]}; {advice} write one of these: {_able()}") from None
    if solver.error_order is None:
        raise UnsupportedError(
            f"method: {solver.name} does not estimate its error, so it cannot choose its steps; write one of these: {_able()}; "
            f"or use stepwell.integrate with dt= and steps="
        )
    return solver


def _able() -> str:
    return ", ".join(repr(each.name) for each in every_method() if each.error_order is not None)

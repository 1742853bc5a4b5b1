"""Dynamics of a system near its states: Jacobians, equilibria, Lyapunov exponents.

All of it comes from derivatives of the tape (``stepwell.derivatives``), so it holds for any system, a user's own equations
included.
"""

from .at_state import Jacobian, jacobian
from .exponents import Lyapunov, lyapunov
from .fixed_points import Equilibria, Equilibrium, equilibria

__all__ = ["Equilibria", "Equilibrium", "Jacobian", "Lyapunov", "equilibria", "jacobian", "lyapunov"]

"""The systems that users describe: parameters, checks, energies. Their formulas are in ``stepwell.reference.systems``.

``Aircraft`` is imported on first use: its rates are traced like users' own equations, by modules that other systems do not need.
"""

from typing import TYPE_CHECKING, Any

from ..inputs import Sampled, Sinusoid
from .base import System
from .chain import Chain
from .linear import LinearSystem
from .nbody import NBody
from .oscillator import Oscillator
from .particles import Particles
from .pendulum import Pendulum
from .pendulum_3d import Pendulum3D
from .restricted_three_body import RestrictedThreeBody
from .rigid_body import RigidBody
from .rods import Rods
from .springs import Springs

if TYPE_CHECKING:
    from .aircraft import Aircraft

__all__ = [
    "Aircraft", "Chain", "LinearSystem", "NBody", "Oscillator", "Particles", "Pendulum", "Pendulum3D", "RestrictedThreeBody",
    "RigidBody", "Rods", "Sampled", "Sinusoid", "Springs", "System",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name != "Aircraft":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from .aircraft import Aircraft

    return Aircraft

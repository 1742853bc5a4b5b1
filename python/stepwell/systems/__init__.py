"""The systems that users describe: parameters, checks, energies. Their formulas are in ``stepwell.reference.systems``."""

from .base import System
from .chain import Chain
from .inputs import Sampled, Sinusoid
from .linear import LinearSystem
from .nbody import NBody
from .oscillator import Oscillator
from .pendulum import Pendulum
from .pendulum_3d import Pendulum3D
from .restricted_three_body import RestrictedThreeBody
from .rods import Rods

__all__ = [
    "Chain",
    "LinearSystem",
    "NBody",
    "Oscillator",
    "Pendulum",
    "Pendulum3D",
    "RestrictedThreeBody",
    "Rods",
    "Sampled",
    "Sinusoid",
    "System",
]

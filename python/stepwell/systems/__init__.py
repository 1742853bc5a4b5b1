"""The systems that users describe: parameters, checks, energies. Their formulas are in ``stepwell.reference.systems``."""

from .base import System
from .chain import Chain
from .inputs import Sampled, Sinusoid
from .linear import LinearSystem
from .nbody import NBody
from .oscillator import Oscillator
from .particles import Particles
from .pendulum import Pendulum
from .restricted_three_body import RestrictedThreeBody

__all__ = [
    "Chain",
    "LinearSystem",
    "NBody",
    "Oscillator",
    "Particles",
    "Pendulum",
    "RestrictedThreeBody",
    "Sampled",
    "Sinusoid",
    "System",
]

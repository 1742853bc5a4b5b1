"""The systems that users describe: parameters, checks, energies. Their formulas are in ``stepwell.reference.systems``."""

from .base import System
from .chain import Chain
from .inputs import Sampled, Sinusoid
from .linear import LinearSystem
from .nbody import NBody
from .oscillator import Oscillator
from .pendulum import Pendulum
from .restricted_three_body import RestrictedThreeBody
from .springs import Springs

__all__ = [
    "Chain",
    "LinearSystem",
    "NBody",
    "Oscillator",
    "Pendulum",
    "RestrictedThreeBody",
    "Sampled",
    "Sinusoid",
    "Springs",
    "System",
]

"""The systems that users describe: parameters, checks, energies. Their formulas are in ``stepwell.reference.systems``."""

from .base import System
from .chain import Chain
from .inputs import Sampled, Sinusoid
from .linear import LinearSystem
from .nbody import NBody
from .oscillator import Oscillator

__all__ = ["Chain", "LinearSystem", "NBody", "Oscillator", "Sampled", "Sinusoid", "System"]

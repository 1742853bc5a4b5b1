"""Sampled systems (§4): a linear system from sample to sample, exactly or by a method, and its frequency response.

``systems`` makes the matrices of a step, ``response`` computes frequency responses, ``margins`` those of
a loop; ``loops`` closes one by a sampled controller; ``around`` linearises a system with one around it.
"""

from .around import LinearisedLoop, linearised_loop
from .loops import sampled_loop, sampling_limit
from .margins import Margins, frequency_response, margins
from .systems import DiscreteSystem, SampledRun, discretise

__all__ = [
    "DiscreteSystem", "LinearisedLoop", "Margins", "SampledRun", "discretise", "frequency_response", "linearised_loop", "margins",
    "sampled_loop", "sampling_limit",
]  # fmt: skip

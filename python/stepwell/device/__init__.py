"""Devices: a second core, which steps members on a GPU or on any other device of OpenCL, with the same bits.

``opencl`` finds devices and builds kernels, ``listing`` tells what there is, ``promise`` tries what a device does with the bits
of numbers, ``printer`` writes the operations of a tape as OpenCL C. ``stages`` has the tapes of a run and the numbers that they
read; ``fixed`` makes runs of fixed steps, and ``adaptive`` those with a tolerance; runs of many bodies are made by ``bodies``,
by a method's operations on ``blocks``; ``reductions`` has what becomes of states that are not saved. They take models, plans and
arrays as ``_core`` does, and fill the same arrays.
"""

from __future__ import annotations

from .listing import devices
from .opencl import Device, device_of

__all__ = ["Device", "device_of", "devices"]

"""Listing of the available devices, and of what each can promise."""

from __future__ import annotations

import os

from ..base.available_memory import available_memory
from ..errors import UnsupportedError
from .opencl import Device, machines
from .promise import broken


def devices() -> list[Device]:
    """The devices on which runs can be made, the CPU first.

    Each device of OpenCL is tried for some milliseconds: it must round as the core does, keep subnormal numbers and contract
    nothing. What it cannot promise it says in ``float64`` and ``float32``, with the reason.

    Returns:
        A list of ``Device``; only the CPU if pyopencl is missing (``pip install "stepwell[gpu]"``) or finds none.

    Example:
        >>> sw.devices()[0].name
        'cpu'
    """
    cores = os.cpu_count() or 1
    every = [Device("cpu", "the core of stepwell", "machine code", int(available_memory()[0]), cores)]
    try:
        found = machines()
    except UnsupportedError:
        return every
    for machine in found:
        of_double, of_single = (broken(machine, single) for single in (False, True))
        every.append(machine.described._replace(float64=of_double, float32=of_single))
    return every

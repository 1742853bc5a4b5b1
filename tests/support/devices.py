"""The devices of OpenCL on which tests run; in CI this is the CPU, by PoCL."""

from __future__ import annotations

import pytest
from stepwell.device import devices

#: Those that have the bits of the core in float64.
NAMES = [each.name for each in devices() if each.name != "cpu" and not each.float64]

needs_device = pytest.mark.skipif(not NAMES, reason="there is no device of OpenCL here")

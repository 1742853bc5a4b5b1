"""The devices of OpenCL on which tests run; in CI this is the CPU, by PoCL."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from stepwell.device import devices

#: Those that have the bits of the core in float64.
NAMES = [each.name for each in devices() if each.name != "cpu" and not each.float64]

needs_device = pytest.mark.skipif(not NAMES, reason="there is no device of OpenCL here")


def assert_alike(one: Any, other: Any) -> None:
    """Two sweeps have the same results, down to the sign of a zero."""
    assert list(one.data_vars) == list(other.data_vars)
    assert one.attrs["bits"] == other.attrs["bits"]
    for name in one.data_vars:
        a, b = one[name].values, other[name].values
        assert a.dtype == b.dtype, name
        if a.dtype.kind == "f":
            a, b = (np.where(np.isnan(each), np.nan, each).view(f"u{each.itemsize}") for each in (a, b))
        assert np.array_equal(a, b), (
            name,
            np.argwhere(a != b)[:5].tolist(),
            one[name].values[a != b][:5],
            other[name].values[a != b][:5],
        )


def assert_same(got: Any, core: Any, *names: str) -> None:
    """These arrays of two runs are the same to the last bit, but for the bits of a NaN."""
    for name in names:
        one, other = getattr(got, name), getattr(core, name)
        assert (one is None) == (other is None), name
        if one is None:
            continue
        one, other = np.asarray(one), np.asarray(other)
        assert one.dtype == other.dtype
        is_float = one.dtype.kind == "f"
        assert np.array_equal(one, other, equal_nan=is_float), name
        if is_float:
            assert np.array_equal(np.signbit(one) | np.isnan(one), np.signbit(other) | np.isnan(other)), name

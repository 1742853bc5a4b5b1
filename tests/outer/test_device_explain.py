"""What a device makes of a step."""

from __future__ import annotations

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, UnsupportedError
from support.devices import NAMES, needs_device

pytestmark = needs_device


@pytest.mark.parametrize("name", NAMES)
def test_the_kernel_of_a_step(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pendulum = sw.Pendulum(np.ones(4))
    plain, explained = sw.explain(pendulum, "rk4"), sw.explain(pendulum, "rk4", device=name)
    kernel = explained.kernel
    assert plain.kernel is None
    assert explained.listing == plain.listing
    assert kernel is not None
    assert (kernel.device, kernel.numbers) == (name, 2)
    assert kernel.member_bytes == 8 * (2 * 2 + 1) + 8  # twice the state, omega, and where it diverged
    assert "__kernel void steps(" in kernel.text
    assert kernel.lines == len(kernel.text.splitlines())
    assert str(kernel) in str(explained)
    assert explained.as_dict()["kernel"]["text"] == kernel.text
    assert sw.explain(sw.Pendulum(), "rk4", device=name, dtype="float32").kernel.member_bytes == 4 * 4 + 8  # type: ignore[union-attr]
    monkeypatch.setenv("STEPWELL_DEVICE", name)
    assert sw.explain(pendulum, "rk4").kernel == kernel
    assert sw.explain(pendulum, "rk4", device="cpu").kernel is None
    assert sw.explain(pendulum, "dop853", attempt=True).kernel is None


def test_wrong_calls() -> None:
    with pytest.raises(ArgumentError, match="device: expected 'cpu'"):
        sw.explain(sw.Pendulum(), "rk4", device="gpu")
    with pytest.raises(UnsupportedError, match="goes without attempt"):
        sw.explain(sw.Pendulum(), "dop853", attempt=True, device=NAMES[0])

"""What is said of members that stopped by themselves, or whose rates are not finite at the start."""

from __future__ import annotations

import re
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.stiff import robertson, van_der_pol

CHOOSE = [m.name for m in sw.methods() if m.error_order is not None]
#: Those whose steps stability can hold down.
BOUND = [name for name in CHOOSE if not sw.method(name).is_always_stable]


pole = sw.system(order=1)(lambda t, y, *, k=1.0: np.array([0.1 * y[0], k * y[1] * y[1]]))

root = sw.system(order=1)(lambda t, y, *, below=0.0: np.array([y[0], np.sqrt(y[1] - below)]))


def stopped(system: Any, method: str, **options: Any) -> tuple[sw.Run, str]:
    """The run and its one warning, of which other kinds are ignored."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = sw.integrate(system, method, **options)
    (text,) = (str(each.message) for each in caught if "stopped before" in str(each.message))
    return run, text


def test_out_of_steps_tells_how_many_and_how_long() -> None:
    for method in BOUND:
        run, text = stopped(sw.Oscillator(), method, v=0.0, y=1.0, tolerance=1e-8, at=[1e6], max_steps=3000)
        paces = run.paces
        mean = float(paces.t) / int(paces.accepted)
        words = f"out of max_steps: 3000 attempts, {int(paces.rejected)} of them rejected, steps of {mean:.2g} on average"
        assert f"{words}, not held down by stability; max_steps=" in text, method
        assert run.stopped_at == paces.t


@pytest.mark.parametrize("method", BOUND)
def test_stiffness_is_named_by_its_rate(method: str) -> None:
    """The fastest rate of Robertson's reaction is there −(1e4·y₃ + 6e7·y₂ + 0.04) to within a part in a thousand."""
    members = (2,) if method == "merson" else ()
    y = np.array([1.0, 0.0, 0.0]).reshape(3, *(1,) * len(members)) * np.ones(members)
    run, text = stopped(robertson(), method, y=y, tolerance=(1e-6, 1e-9), at=[1e4], max_steps=20_000)
    state = run.controller_state.y[:, 0] if members else run.controller_state.y
    match = re.search(r"the fastest rate there, 1/([\d.e-]+), lets no steps beyond ([\d.e-]+) be stable \(stiff", text)
    # Both are told with three digits.
    assert float(match[1]) == pytest.approx(1.0 / (1e4 * state[2] + 6e7 * state[1]), rel=0.006)
    if method != "taylor":  # its order goes by the tolerance: see tests/runs/test_stiffness.py
        longest = float(sw.stability_limit(sw.LinearSystem([[-1.0 / float(match[1])]]), method))
        assert float(match[2]) == pytest.approx(longest, rel=0.01)


def test_what_turns_or_is_only_fast_is_not_called_stiff() -> None:
    for system, start in (
        (sw.Oscillator(40.0), {"v": 0.0, "y": 1.0}),
        (sw.Oscillator(1.0, damping=0.0005), {"v": 0.0, "y": 1.0}),
        (van_der_pol(mu=1.0), {"v": 0.0, "y": 2.0}),
    ):
        for method in CHOOSE:
            _, text = stopped(system, method, tolerance=1e-9, at=[1e7], max_steps=4000, **start)
            assert "stiff" not in text, (system, method)


def test_the_stop_of_a_batch_is_told_by_member() -> None:
    """ẏ = k·y² from 1 ends at 1/k; of three members the second is the first, and the third goes on."""
    k = np.array([1.0, 2.0, 0.1])
    for method in CHOOSE:
        run, text = stopped(pole(k=k), method, y=np.ones((2, 3)), tolerance=1e-9, at=[2.0])
        assert text.startswith("2 of 3 members stopped before t = 2; the first was member 1 at t = 0.5; "), method
        # A pole is passed or met where the relative error of 1/y, a tolerance a step over some hundred steps, allows.
        np.testing.assert_allclose(run.stopped_at[:2], [1.0, 0.5], rtol=1e-6)
        assert np.isnan(run.stopped_at[2])
        small = r"; the largest rate there is that of y\[1\], [\d.]+e\+\d\d$"
        infinite = r"no step, however small, gives finite numbers: the state reached [\d.]+e\+\d+$"
        assert re.search(small if "too small" in text else infinite, text), method


def test_a_rate_that_is_nan_at_the_start_is_named() -> None:
    """By steps of fixed length, too."""
    of_rate = "the rate of y[1] is NaN at the start"
    for method in CHOOSE:
        run, text = stopped(root(below=2.0), method, y=np.ones(2), t0=3.0, tolerance=1e-6, at=[4.0])
        assert text == f"the run stopped before t = 4, at t = 3; no step, however small, gives finite numbers: {of_rate}", method
        assert run.stopped_at == 3.0
    match = re.escape(f"{of_rate}, t = 3")
    for each in sw.methods():
        for below, words in ((2.0, match), (np.array([0.0, 2.0]), r"^1 of 2 members diverged: member 1 at step 1 .*" + match)):
            if not each.needs_acceleration:
                with pytest.warns(sw.DivergenceWarning, match=words):
                    sw.integrate(root(below=below), each, y=np.ones(2), t0=3.0, dt=0.1, steps=3)


def test_a_rate_that_becomes_nan_is_named() -> None:
    """√(1 − t) with the time."""
    late = sw.system(lambda t, v, y: -y + np.sqrt(1.0 - t))
    run, text = stopped(late(), "merson", v=0.0, y=1.0, tolerance=1e-6, at=[4.0])
    assert float(run.stopped_at) == pytest.approx(1.0, abs=1e-6)
    assert "no step, however small, gives finite numbers" in text


def test_an_event_and_a_stop_are_told_side_by_side() -> None:
    """The event stops the one member, and the pole the other."""
    event = sw.Event(lambda t, y: y[0] - 1.04, terminal=True, name="there")
    k = np.array([1.0, 4.0])
    run, _ = stopped(pole(k=k), "dop853", y=np.ones((2, 2)), tolerance=1e-9, at=[2.0], events=event)
    assert run.status.tolist() == [sw.Status.EVENT, sw.Status.UNDERFLOW]
    np.testing.assert_allclose(run.stopped_at, [np.log(1.04) / 0.1, 0.25], rtol=1e-6)


def message_of(system: Any, **options: Any) -> str:
    return stopped(system, "merson", **{"tolerance": 1e-6} | options)[1]


def test_what_positive_keeps_is_told_first() -> None:
    """Not that the solution blows up: it would be negative from there on. Two tanks: the one that is empty first is named."""
    tanks = sw.system(order=1, shape=(2,))(lambda t, y: np.array([-1.0, -0.3]))()
    message = message_of(tanks, y=np.array([1.0, 0.1]), at=[2.0], positive=True)
    assert re.search(r"at t = 0\.333333; y\[1\] becomes negative in every step, however short, which positive= does", message)
    assert "blows up" not in message
    message = message_of(tanks, y=np.array([1.0, 0.1]), at=[2.0], positive=[0])
    assert "at t = 1; y[0] becomes negative" in message
    assert "at t = 3; v becomes negative" in message_of(
        sw.system(lambda t, v, y: -1.0)(), v=3.0, y=0.0, at=[9.0], positive=[("v",)]
    )


def test_a_time_of_too_many_digits_is_no_collision() -> None:
    """An oscillator's step of about 0.1 to 1 at a time whose roundings are 16, or after some steps where the step shrinks."""
    message = message_of(sw.Oscillator(), v=0.0, y=1.0, t0=1e17, at=[1e17 + 1600.0])
    assert "too small to move the time, whose roundings there are 16: count times from a nearer origin" in message
    assert "collision" not in message
    message = message_of(sw.Oscillator(3e3), v=0.0, y=1.0, t0=1e12, at=[1e12 + 10.0])
    assert "whose roundings there are 0.00012" in message
    # A pole remains one, at t = 1 and at 1e9 + 1, where the time has 24 binary digits for a unit.
    pole = sw.system(order=1)(lambda t, y: y * y)()
    assert "the solution blows up there" in message_of(pole, y=1.0, at=[2.0])
    assert "the solution blows up there" in message_of(pole, y=1.0, t0=1e9, at=[1e9 + 2.0])

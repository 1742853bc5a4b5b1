"""The safe step of nets of springs, and the exact limit of small ones."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import UnsupportedError
from support.families import family
from support.springs import lattice, tangled

LOSSES: list[dict[str, Any]] = [{}, {"damping": 0.6}, {"drag": 0.8}, {"damping": np.linspace(0.0, 1.5, 9), "drag": 0.3}]


#: By which losses each method is tried every day; steps with derivatives go number by number.
TURNS = {m.name: 0 if m.has_derivatives else i % len(LOSSES) for i, m in enumerate(sw.methods()) if m.name != "taylor"}
NETS = family(itertools.product([m.name for m in sw.methods()], range(len(LOSSES))), lambda method, i: TURNS.get(method) == i)


@pytest.mark.parametrize(("method", "i"), NETS)
def test_the_safe_step_is_never_above_the_exact_limit(method: str, i: int) -> None:
    """Of a stretched net in space, at a state; ``stability_limit`` knows its eigenvalues."""
    losses = LOSSES[0 if sw.method(method).needs_acceleration else i]
    net, state = tangled(1 + i % 2, 5, 3, 9, fixed=[0], **losses)
    same = ("pairs", "stiffness", "masses", "fixed", "damping", "drag")
    net = sw.Springs(**{name: getattr(net, name) for name in same}, rest=0.1)
    y = 3.0 * state["y"]
    safe = net.safe_step(method)
    if math.isinf(safe):
        assert sw.method(method).is_implicit
        assert sw.stability_limit(net, method, v=0.0, y=y) == math.inf
    elif safe > 0.0:
        exact = float(sw.stability_limit(net, method, v=0.0, y=y))
        # Tsitouras' step is stable for long where there is friction, and of the undamped oscillator for Φ < 0.48 alone.
        assert (0.1 if method == "tsit5" else 0.2) * exact < safe <= exact * (1 + 1e-6)
    else:
        assert sw.method(method).limit == 0.0


def test_the_exact_limit_of_nets_that_drift_or_are_fixed_is_known() -> None:
    """A triangle at rest breathes with ω² = 3k/m, whichever way it drifts and turns; a mode has the shape of the net."""
    net = sw.Springs([(0, 1), (1, 2), (2, 0)], stiffness=np.array([[1.0, 4.0]]), rest=1.0)
    y = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, math.sqrt(0.75)]])
    limits = sw.stability_limit(net, "leapfrog", v=0.0, y=y)
    np.testing.assert_allclose(limits, 2.0 / np.sqrt([3.0, 12.0]), rtol=1e-9)
    assert limits.decided.all()
    mode = limits.modes[0].y
    assert mode.shape == (3, 2)
    out = y - y.mean(axis=0)
    assert abs(np.vdot(mode, out)) == pytest.approx(np.linalg.norm(mode) * np.linalg.norm(out), rel=1e-6)
    fixed = sw.Springs([(0, 1)], stiffness=4.0, rest=1.0, fixed=[0])
    limit = sw.stability_limit(fixed, "leapfrog", v=0.0, y=[[0.0, 0.0], [1.2, 0.0]])
    assert limit == pytest.approx(1.0, rel=1e-12)
    assert (limit.mode.y[0] == 0.0).all()
    with pytest.raises(UnsupportedError, match=r"give at=.* or ask its safe_step for a bound"):
        sw.stability_limit(fixed, "leapfrog")


@pytest.mark.filterwarnings("ignore:the run gained energy")
def test_a_lattice_needs_the_safe_step() -> None:
    """Springs of no rest length resist all displacements alike, so the lattice is two of graphs: in its fastest mode all
    neighbours swing against each other, with ω² = (8k/m)·sin²(½π(n − 1)/n); the bound is 8k/m. It holds below that, and grows
    above."""
    n = 24
    pairs, layout = lattice(n, n, 2)
    net = sw.Springs(pairs, stiffness=3.0, rest=0.0, masses=0.5, dim=2)
    safe = net.safe_step("false_euler")
    assert safe == pytest.approx(2.0 / math.sqrt(8 * 3.0 / 0.5), rel=1e-14)
    exact = safe / math.sin(0.5 * math.pi * (n - 1) / n)
    assert exact < 1.003 * safe
    y = 1e-3 * np.random.default_rng(1).normal(size=layout.shape)
    start = float(net.energy(np.zeros_like(y), y))
    for h, stays in ((0.999 * safe, True), (1.002 * exact, False)):
        run = sw.integrate(net, "false_euler", v=0.0, y=y, dt=h, steps=1000, record="energy")
        # Below: an amplitude of 1/√(1 − Φ²/4) at most, of energy 1/(2·0.001); above: |z| > 1 + √(2·0.002), e^60 at the end.
        assert (float(run.recorded["energy"][-1]) < 1000.0 * start) == stays


@pytest.mark.filterwarnings("ignore:the run gained energy")
def test_the_safe_step_with_damping_of_batches_and_of_nothing() -> None:
    """One spring is exact: h²κ + 2hc = 4 by False Euler, κ = k/m, c = d/m."""
    for damping in (0.1, 1.0, 10.0):
        one = sw.Springs([(0, 1)], stiffness=2.0, rest=1.0, masses=0.5, fixed=[0], damping=damping, dim=1)
        kappa, c = 2.0 / 0.5, damping / 0.5
        limit = (math.sqrt(c * c + 4.0 * kappa) - c) / kappa
        assert one.safe_step("false_euler") == pytest.approx(limit, rel=1e-9)
        for factor, stays in ((0.99, True), (1.01, False)):
            run = sw.integrate(one, "false_euler", v=0.0, y=[[0.0], [1.0 + 1e-9]], dt=factor * limit, steps=3000)
            assert (abs(float(run.y[-1, 1, 0]) - 1.0) < 1e-9) == stays
    batch = sw.Springs([(0, 1)], stiffness=np.array([[1.0, 4.0, 0.0]]), rest=1.0, masses=0.5)
    np.testing.assert_allclose(batch.safe_step("verlet"), [1.0, 0.5, np.inf], rtol=1e-14)
    damped = sw.Springs([(0, 1)], stiffness=np.array([[1.0, 4.0]]), damping=np.array([[0.5, 0.0]]), rest=1.0, masses=0.5)
    each = [
        sw.Springs([(0, 1)], stiffness=k, damping=c, rest=1.0, masses=0.5).safe_step("rk4") for k, c in ((1.0, 0.5), (4.0, 0.0))
    ]
    np.testing.assert_allclose(damped.safe_step("rk4"), each, rtol=1e-12)
    assert sw.Springs([(0, 1)], stiffness=0.0, rest=1.0, drag=0.0).safe_step("rk4") == math.inf
    assert batch.safe_step("standard_heun").tolist() == [0.0, 0.0, math.inf]

"""Rods that cannot be are refused, what is doubtful is told, and deliberately wrong formulas are noticed."""

from __future__ import annotations

import inspect
import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError, UnsupportedError
from stepwell.reference.systems import pendulum_3d, rods
from support.cases import SYSTEMS, assert_same
from support.rods import CONTROL, RESETTING, TWO, apart_from_angles, cone, hanging, quiet

# ---- what is refused, and what is doubted


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: sw.Rods([1.0], [], 1.0), ArgumentError, "rods: expected 1 to 100, got 0"),
        (lambda: sw.Rods([1.0, 1.0], [(0, 2)], 1.0), ArgumentError, r"rods\[0\]\[1\]: expected a point, 0 to 1, .*, got 2"),
        (lambda: sw.Rods([1.0, 1.0], [(0, -1)], 1.0), ArgumentError, "expected a point, 0 to 1, .*, got -1"),
        (lambda: sw.Rods([1.0, 1.0], [(0, True)], 1.0), ArgumentError, "expected a point, 0 to 1, .*, got True"),
        (lambda: sw.Rods([1.0, 1.0], [(0, "b")], 1.0), DTypeError, "expected a point, 0 to 1, .*, got 'b'"),
        (lambda: sw.Rods([1.0, 1.0], [(0, 0)], 1.0), ArgumentError, "expected two different points, got 0 twice"),
        (lambda: sw.Rods([1.0, 1.0], [(0, 1), (1, 0)], 1.0), ArgumentError, r"rods\[1\]: expected each rod once"),
        (lambda: sw.Rods([1.0, 1.0], [(0, 1, 2)], 1.0), ShapeError, "expected two ends, got 3"),
        (lambda: sw.Rods([1.0, 1.0], [0, 1], 1.0), DTypeError, r"rods\[0\]: expected a list of two ends"),
        (lambda: sw.Rods([1.0, 1.0], 7, 1.0), DTypeError, "rods: expected a list of pairs of ends"),
        (lambda: sw.Rods([1.0], [((0, 0), (1, 1))], 1.0), ArgumentError, "expected a point at one end, got two anchors"),
        (lambda: sw.Rods([1.0], [((0, 0, 0, 0), 0)], 1.0), ShapeError, "expected an anchor of 2 or 3 coordinates"),
        (lambda: sw.Rods([1.0], [((0, math.nan), 0)], 1.0), NotFiniteError, r"rods\[0\]\[0\]: expected finite"),
        (
            lambda: sw.Rods([1.0], [((0, 0), 0)], 1.0, dim=3),
            ShapeError,
            "rods, dim: expected one number of dimensions, got 2 and 3",
        ),
        (lambda: sw.Rods([1.0, 1.0], [((0, 0), 0)], 1.0), ArgumentError, "every point at the end of one, got none for point 1"),
        (lambda: sw.Rods([1.0], [((0, 0), 0)], 0.0), ArgumentError, "lengths: expected numbers above zero"),
        (lambda: sw.Rods([1.0], [((0, 0), 0)], [1.0, 1.0]), ShapeError, "lengths: expected one for each of 1 rods"),
        (lambda: sw.Rods([0.0], [((0, 0), 0)], 1.0), ArgumentError, "masses: expected numbers above zero"),
        (lambda: sw.Rods(1.0, [((0, 0), 0)], 1.0), ShapeError, "masses: expected one for each point"),
        (
            lambda: sw.Rods([1.0], [((0, 0), 0), ((1, 0), 0), ((0, 1), 0)], 1.0),
            ArgumentError,
            "rods: expected at most as many as coordinates, 2, got 3",
        ),
        (lambda: sw.Rods(np.ones(102), [(i, i + 1) for i in range(101)], 1.0), ArgumentError, "rods: expected 1 to 100, got 101"),
        (lambda: sw.Pendulum3D(0.0), ArgumentError, "length: expected numbers above zero"),
        (lambda: sw.Pendulum3D(1.0, [math.inf]), NotFiniteError, "gravity"),
    ],
)
def test_wrong_rods_are_refused(make: Callable[[], Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


@pytest.mark.parametrize(
    ("system", "y", "message"),
    [
        (TWO, np.zeros((2, 2)), r"y: expected the ends of each rod apart, got those of the rod \(\(0.0, 0.0\), 0\)"),
        (TWO, np.ones((2, 2)), r"got those of the rod \(0, 1\) in one place"),
        (TWO, np.ones((2, 3)), r": expected shape \(2, 2, batch…\)"),
        (TWO, np.ones(2), r": expected shape \(2, 2, batch…\)"),
        (sw.Pendulum3D(), np.zeros(3), "y: expected the mass away from the origin"),
        (sw.Pendulum3D(), np.ones(2), r"y: expected shape \(3, batch…\)"),
        (
            sw.Rods(np.ones(4), [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)], 1.0),
            np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),
            r"rods: expected each to restrict the motion, but at the start the rod \(1, 3\) adds nothing",
        ),
        (sw.Rods([1.0], [((-1.0, 0.0), 0), ((1.0, 0.0), 0)], 1.0), np.zeros((1, 2)), "restrict the motion"),
    ],
)
def test_starts_without_a_solution_are_refused_before_any_work(system: sw.System, y: Any, message: str) -> None:
    for call in (
        lambda: sw.integrate(system, "rk4", v=0.0, y=y, dt=0.1, steps=1),
        lambda: sw.World(system, "rk4", v=np.zeros(y.shape), y=y.copy(), dt=0.1),
    ):
        with pytest.raises(ArgumentError, match=message):
            call()


def test_a_rod_of_a_wrong_length_is_doubted() -> None:
    """Without control it stays as it started; control returns it, and then nothing is to be said."""
    start: dict[str, Any] = {"v": 0.0, "y": [0.0, 0.5, -1.2], "dt": 0.01, "steps": 1000}
    with pytest.warns(sw.AccuracyWarning, match=r"a rod is 30 % off its length in a saved state"):
        run = sw.integrate(sw.Pendulum3D(), "rk4", **start)
    assert np.sqrt((run.y[-1] ** 2).sum()) == pytest.approx(1.3, rel=1e-8)
    for control in (CONTROL, RESETTING):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            sw.integrate(sw.Pendulum3D(), "rk4", **start, control=control)
    with pytest.warns(sw.AccuracyWarning, match=r"a rod is 50 % off"):
        sw.integrate(TWO, "rk4", v=0.0, y=[[0.0, -1.0], [0.0, -1.5]], dt=0.01, steps=2)


def test_controls_go_with_what_they_keep() -> None:
    with pytest.raises(UnsupportedError, match="has no such constraint"):
        sw.integrate(sw.Pendulum(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, control=CONTROL)
    with pytest.raises(UnsupportedError, match=r"NormControl.* keeps a norm"):
        sw.integrate(TWO, "rk4", v=0.0, y=hanging(1.0, 2.0), dt=0.1, steps=1, control=sw.NormControl(1.0))
    for control in (sw.EnergyControl(0.1), sw.Projection("nacozy")):
        with pytest.raises(UnsupportedError, match="has no energy control"):
            sw.integrate(TWO, "rk4", v=0.0, y=hanging(1.0, 2.0), dt=0.1, steps=1, control=control)


def test_they_say_what_they_are() -> None:
    assert repr(sw.Pendulum3D(2.0)) == "Pendulum3D(length=2.0, gravity=1.0)"
    assert repr(TWO) == "Rods([1.0, 1.0], [((0.0, 0.0), 0), (0, 1)], gravity=1.0)"
    assert repr(TWO.under(CONTROL, ())).endswith("LengthControl(0.5))")
    assert not TWO.has_loops
    assert sw.Rods([1.0], [(0, (1, 2))], 1.0).anchors == ((1.0, 2.0),)


# ---- mistakes that must be noticed


#: Module, what to replace, by what, and what kind of mistake it is.
MUTANTS = [
    (rods, "self.fall * d[k][-1]", "self.fall * d[k][0]", "gravity along the wrong axis"),
    (rods, "pull = pull - self.fall", "pull = pull + self.fall", "a wrong sign of the weight"),
    (rods, "push[-1:] - self.fall", "push[-1:]", "no weight"),
    (rods, "self.minus[b] if b == first", "self.inverse[b] if b == first", "a wrong sign where rods meet"),
    (rods, "return self.minus[a]", "return self.inverse[a]", "a wrong sign where rods follow each other"),
    (rods, "self.inverse[b] + self.inverse[a] if", "self.inverse[b] if", "the mass of one end only"),
    (rods, "pull = self.h * dot(u[k], u[k])", "pull = self.h * dot(v[0], v[0])", "the wrong velocity"),
    (rods, "sums[a] - along", "sums[a] + along", "a pull the wrong way"),
    (rods, "2.0 * strength, 0.5 *", "strength, 0.5 *", "half the damping"),
    (rods, "0.5 * ((strength", "1.0 * ((strength", "twice the stiffness"),
    (rods, "off = [0.5 * (", "off = [1.0 * (", "corrections twice as large"),
    (
        rods,
        "for k, (first, _) in enumerate(self.rods):",
        "for k, first in ((k, 0) for k in range(len(self.rods))):",
        "no anchors",
    ),
    (pendulum_3d, "- self.fall * y[2]", "+ self.fall * y[2]", "a wrong sign of the weight"),
    (pendulum_3d, "(pull / square) * y", "(pull / self.square) * y", "the length that it should have"),
    (pendulum_3d, "2.0 * strength, 0.5 *", "strength, 0.5 *", "half the damping"),
    (pendulum_3d, "0.5 * ((strength", "1.0 * ((strength", "twice the stiffness"),
    (pendulum_3d, "dot(y, v) / self.square", "dot(y, v)", "a length forgotten"),
]
IDS = [f"{module.__name__.rpartition('.')[2]}: {mistake}" for module, _, _, mistake in MUTANTS]


@pytest.fixture
def mutate(monkeypatch: pytest.MonkeyPatch) -> Callable[[Any, str, str], None]:
    def replace(module: Any, old: str, new: str) -> None:
        source = inspect.getsource(module)
        assert source.count(old) == 1, f"the mutant no longer fits {module.__name__}"
        mutant: dict[str, Any] = {"__package__": module.__package__, "__name__": "mutant"}
        exec(compile(source.replace(old, new), "mutant", "exec"), mutant)
        public = sw.Rods if module is rods else sw.Pendulum3D
        monkeypatch.setattr(public, "reference", mutant[public.__name__])

    return replace


def equal_to_the_core() -> bool:
    try:
        for name in SYSTEMS:
            system = SYSTEMS[name](np.random.default_rng(1), 3)
            if system.constraint != "length":
                continue
            rng = np.random.default_rng(2)
            v, y = (rng.normal(size=(*shape, 3)) for shape in (system.v_shape, system.y_shape))
            runs = [quiet(system, "rk4", v=v, y=y, dt=0.01, steps=3, backend=b) for b in ("rust", "numpy")]
            assert_same(*runs)
    except AssertionError:
        return False
    return True


def true_by_the_reference() -> bool:
    """The truths above, of the reference alone: angles, a free triangle, a control that decays, a cone, and lengths reset."""
    if not apart_from_angles("numpy") < 1e-9:
        return False
    options: dict[str, Any] = {"dt": 0.01, "backend": "numpy"}
    triangle = sw.Rods([1.0, 2.0, 0.5], [(0, 1), (1, 2), (2, 0)], 1.0, gravity=0.0)
    y = np.array([[0, 0], [1, 0], [0.5, 0.75**0.5]])
    run = quiet(triangle, "rk4", v=np.array([[0.3, 0.1], [0.3, 0.9], [-0.4, 0.766]]), y=y, steps=100, **options)
    s = triangle.for_state_shapes(0.0, y).reference_at_step(0.01, ())
    off = [abs(float(rods.dot(d, u))) for d, u in zip(s.spans(run.y[-1]), s.closing(run.v[-1]), strict=True)]
    begun = [
        abs(float(rods.dot(d, u)))
        for d, u in zip(s.spans(y), s.closing(np.array([[0.3, 0.1], [0.3, 0.9], [-0.4, 0.766]])), strict=True)
    ]
    if max(abs(a - b) for a, b in zip(off, begun, strict=True)) > 1e-6:  # C̈ = 0 keeps every Ċ
        return False
    start, turn = cone()
    run = quiet(sw.Pendulum3D(), "rk4", **start, dt=turn / 400, steps=400, backend="numpy")
    if not np.abs(run.y[-1] - start["y"]).max() < 1e-6:
        return False
    pendulums = [
        (sw.Pendulum3D(2.0), np.array([0.0, 0.0, -2.02])),
        (sw.Rods([2.0], [((0.0, 0.0), 0)], 2.0), np.array([[0.0, -2.02]])),
    ]
    for system, y in pendulums:
        sideways = np.zeros(y.shape)
        sideways[..., 0] = 0.7
        run = quiet(system, "rk4", v=sideways, y=y, steps=300, **options)
        if abs(np.sqrt((run.y[-1] ** 2).sum()) - 2.02) > 1e-6:  # C̈ = 0, so a rod that begins too long stays so
            return False
        run = quiet(system, "rk4", v=0.0, y=y, dt=1e-3, steps=10, backend="numpy", control=sw.LengthControl(0.1))
        known = 0.5 * (2.02**2 - 4.0) * 2.0 * math.exp(-1.0)
        if 0.5 * ((run.y[-1] ** 2).sum() - 4.0) != pytest.approx(known, rel=0.02):
            return False
        v = np.full(y.shape, 0.3)
        run = quiet(system, "rk4", v=v, y=y, dt=1e-9, steps=1, backend="numpy", control=RESETTING)
        if max(abs(np.sqrt((run.y[-1] ** 2).sum()) - 2.0), abs((run.y[-1] * run.v[-1]).sum())) > 1e-12:
            return False
    return True


@pytest.mark.mutant
@pytest.mark.parametrize(("module", "old", "new", "mistake"), MUTANTS, ids=IDS)
def test_mistakes_are_noticed(mutate: Any, module: Any, old: str, new: str, mistake: str) -> None:
    """By the comparison with the core, and by truths even if both languages had the same mistake."""
    mutate(module, old, new)
    assert not equal_to_the_core()
    assert not true_by_the_reference()


def test_without_a_mistake_nothing_is_noticed() -> None:
    assert equal_to_the_core()
    assert true_by_the_reference()

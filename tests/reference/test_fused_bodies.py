"""Bodies with fused multiply-adds: Newton's force without a root or a quotient, and the same bits however they are stepped."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.reference.systems import nbody
from stepwell.reference.systems.nbody import inverse_cube
from support import families
from support.ways import assert_equal_ways

#: The largest error of Newton's 1/√x³, in units of the last digit (``bodies.rs`` derives it).
BOUND = 2.2


def worst(x: Any) -> float:
    """The largest error of 1/√x³ of these numbers, in units of the last digit of the true value."""

    def error(x: float, f: float) -> float:
        # f²·x³ is (1 + δ)² where f is off by δ, which is exact but for δ².
        off = float(Fraction(f) ** 2 * Fraction(x) ** 3 - 1) / 2
        return abs(off) * f / float(np.spacing(f))

    return max(map(error, x.tolist(), inverse_cube(x).tolist()))


def numbers(count: int = 4000) -> Any:
    """Two binades densely, where the start is a straight line each, and all exponents that have a cube."""
    rng = np.random.default_rng(5)
    ends = [1.0, 2.0, 4.0, np.nextafter(1.0, 2), np.nextafter(2.0, 1), np.nextafter(2.0, 3), np.nextafter(4.0, 3)]
    wide = rng.uniform(1, 2, count) * 2.0 ** rng.integers(-650, 650, count)
    return np.concatenate([ends, rng.uniform(1, 4, count), np.linspace(1, 4, count, endpoint=False), wide])


def test_newtons_force_is_right_within_the_bound() -> None:
    assert worst(numbers()) < BOUND


def test_any_other_constant_is_worse(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, place in (("START", 0), ("FIRST", 0), ("FIRST", 1), ("SECOND", 0), ("SECOND", 1), ("SECOND", 2)):
        constant = getattr(nbody, name)
        if name == "START":
            other: Any = constant._replace(double=constant.double + (1 << 46))
        else:
            other = tuple(each * (1.05 if i == place else 1.0) for i, each in enumerate(constant))
        with monkeypatch.context() as patched:
            patched.setattr(nbody, name, other)
            assert worst(numbers(1000)) > BOUND, (name, place)


def test_beyond_the_range_it_is_no_number_as_the_quotient_is_infinite() -> None:
    with np.errstate(all="ignore"):
        tiny = np.array([0.0, 5e-324, 1e-310, 2.3e-308, 1e-250, 1e-207, 1e-206])
        assert not np.isfinite(inverse_cube(tiny)).any()
        assert not np.isfinite(1.0 / (tiny * np.sqrt(tiny))).any()
        assert np.isfinite(inverse_cube(np.array([4e-206, 1e-100, 1e100, 1.7e308]))).all()
        assert np.isnan(inverse_cube(np.array([np.inf, np.nan]))).all()


def crowd(n: int, dim: int, batch: tuple[int, ...] = (), massless: int = 0, **of: Any) -> dict[str, Any]:
    """Some bodies, the last of which have no mass."""
    rng = np.random.default_rng([n, dim, *batch])
    masses = rng.uniform(0.1, 1, n) / n
    if massless:
        masses[-massless:] = 0.0
    system = sw.NBody(masses, softening=0.05, dim=dim, **({"force": "newton"} | of))
    return {"system": system, "v": 0.1 * rng.normal(size=(n, dim, *batch)), "y": rng.normal(size=(n, dim, *batch))}


def same(one: Any, other: Any) -> None:
    for name in ("v", "y"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


@pytest.mark.parametrize(("n", "dim"), [(2, 2), (3, 3), (9, 3), (10, 2), (17, 3), (32, 2), (63, 2), (64, 3), (65, 2), (130, 3)])
def test_the_core_equals_the_reference(n: int, dim: int) -> None:
    """Few bodies are a tape, more a kernel written by hand; with forces and bodies without mass in turns."""
    forces = ("newton", "logarithmic", "printed")
    pairs = [(force, massless) for force in forces for massless in (0, 3)]
    for force, massless in pairs if families.LONG else (pairs[n % 6], pairs[(n + 2) % 6]):
        if massless >= n:
            continue  # nothing moves
        ask = crowd(n, dim, massless=massless, force=force) | {"method": "leapfrog", "dt": 0.1, "steps": 6, "fused": True}
        core, plain = sw.integrate(**ask), sw.integrate(**ask | {"fused": False})
        same(core, sw.integrate(**ask, backend="numpy"))
        assert core.fused
        assert plain.v.tobytes() != core.v.tobytes(), (force, massless)
        assert np.allclose(plain.v, core.v, rtol=1e-11, atol=1e-13), (force, massless)


@pytest.mark.parametrize("name", ["verlet", "rk4", "dop853"])
def test_methods_of_each_kind_equal_the_reference(name: str) -> None:
    for n in (4, 20):
        ask = crowd(n, 2) | {"method": name, "dt": 0.01, "steps": 2, "fused": True}
        same(sw.integrate(**ask), sw.integrate(**ask, backend="numpy"))


def test_members_and_worlds() -> None:
    """A tape, tapes of the rates side by side, and a kernel for one."""
    for n in (3, 12, 40, 70):
        ask = crowd(n, 3, (5,)) | {"method": "rk4", "dt": 0.01, "steps": 12, "fused": True}
        assert_equal_ways(**ask, ways=("alone", "in a world"))


def test_threads_change_no_bit() -> None:
    ask = crowd(1100, 3) | {"method": "leapfrog", "dt": 0.001, "steps": 2, "fused": True}
    same(sw.integrate(**ask, threads=1), sw.integrate(**ask, threads=2))


@pytest.mark.parametrize("n", [4, 30])
def test_with_all_that_goes_around_bodies(n: int) -> None:
    ask = crowd(n, 2) | {"method": "rk4", "dt": 0.01, "steps": 6, "every": 3, "fused": True}
    record = {"record": ["energy", "closest", "momentum"]}
    for more in (
        record,
        {"control": sw.EnergyControl(0.1)} | record,
        {"force": 0.01 * np.ones((n, 2))} | record,
        {"method": "merson", "dt": None, "steps": None, "every": None, "tolerance": 1e-6, "at": [0.02, 0.05]},
    ):
        core, reference = (sw.integrate(**ask | more | {"backend": backend}) for backend in ("rust", "numpy"))
        same(core, reference)
        if "record" in more:
            for name in more["record"]:
                assert core.recorded[name].tobytes() == reference.recorded[name].tobytes(), (more, name)


@pytest.mark.parametrize("n", [4, 30])
def test_recorded_energies_are_not_fused(n: int) -> None:
    ask = crowd(n, 3) | {"method": "leapfrog", "dt": 0.01, "steps": 4, "every": 1, "fused": True}
    with_energies = sw.integrate(**ask, record=["energy"])
    without = sw.integrate(**ask)
    same(with_energies, without)
    v, y = (np.moveaxis(each, 0, -1) for each in (without.v, without.y))
    assert np.allclose(with_energies.recorded["energy"], ask["system"].energy(v, y), rtol=1e-14)
    own = [ask["system"].recordable("energy", v[..., i], y[..., i], 0.01) for i in range(5)]
    assert with_energies.recorded["energy"].tolist() == [float(each) for each in own]


@pytest.mark.parametrize("n", [2, 20])
@pytest.mark.parametrize("where", ["one place", "far"])
def test_a_coincidence_is_noticed_in_the_same_step(n: int, where: str) -> None:
    ask = crowd(n, 2)
    system = sw.NBody(ask["system"].masses, force="newton")
    y = ask["y"].copy()
    y[1] = y[0] if where == "one place" else y[0] + 1e-110  # the cube of the distance is below all numbers
    ask |= {"system": system, "y": y, "method": "leapfrog", "dt": 0.01, "steps": 3}
    steps = []
    for fused in (False, True):
        with pytest.warns(sw.DivergenceWarning):
            steps.append(int(sw.integrate(**ask, fused=fused).first_bad_step))
    assert steps[0] == steps[1]


def test_in_float32() -> None:
    for n in (2, 5):
        ask = crowd(n, 3) | {"method": "leapfrog", "dt": 0.01, "steps": 20, "fused": True, "dtype": "float32"}
        core, exact = sw.integrate(**ask), sw.integrate(**ask | {"dtype": "float64"})
        same(core, sw.integrate(**ask, backend="numpy"))
        assert np.allclose(core.y, exact.y, atol=1e-5)

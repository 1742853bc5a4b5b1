"""Arrays of other libraries, in and out without copies."""

from functools import partial
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.base import buffer_pool
from stepwell.errors import ArgumentError, DTypeError
from support.for_each import for_each
from support.refusals import refused
from support.wrong_calls import WithGradient


class Tensor:
    """An array of another library: it speaks DLPack, and nothing else."""

    def __init__(self, array: Any) -> None:
        self.array = array

    def __dlpack__(self, **options: Any) -> Any:
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self) -> Any:
        return self.array.__dlpack_device__()


class OnDevice(Tensor):
    """One that is not in the memory of the CPU."""

    def __dlpack__(self, **options: Any) -> Any:
        raise BufferError("the array is on CUDA device 0")

    def __dlpack_device__(self) -> Any:
        return 2, 0


def test_they_are_taken_as_numpys() -> None:
    omega, y = np.linspace(0.5, 2.0, 50), np.ones(50)
    plain = sw.integrate(sw.Oscillator(omega), "rk4", v=0.0, y=y, dt=0.1, steps=10)
    run = sw.integrate(sw.Oscillator(Tensor(omega)), "rk4", v=0.0, y=Tensor(y), dt=0.1, steps=10)
    assert run.y.tobytes() == plain.y.tobytes()
    single = sw.integrate(sw.Oscillator(Tensor(omega.astype(np.float32))), "rk4", v=0.0, y=1.0, dt=0.1, steps=10)
    assert single.y.tobytes() != plain.y.tobytes()
    # y is about cos(ω·t) at t = 1, and ω below 2 is rounded by 2⁻²⁴ of it at most.
    assert single.y == pytest.approx(plain.y, abs=2.0**-23)


def test_parameters_are_copied() -> None:
    """Their owner may go on to write into them."""
    omega = np.linspace(0.5, 2.0, 50)
    system = sw.Oscillator(Tensor(omega))
    omega[:] = np.nan
    np.testing.assert_array_equal(system.omega, np.linspace(0.5, 2.0, 50))


def test_a_world_steps_them_in_place() -> None:
    v, y = np.zeros(50), np.ones(50)
    if not np.from_dlpack(Tensor(y)).flags.writeable:  # NumPy before 2.1 gives all such arrays read-only
        with pytest.raises(ArgumentError, match="v: expected a writeable array to step in place, got a read-only one"):
            sw.World(sw.Oscillator(), "rk4", v=Tensor(v), y=Tensor(y), dt=0.1)
        return
    world = sw.World(sw.Oscillator(), "rk4", v=Tensor(v), y=Tensor(y), dt=0.1)
    world.step(10)
    assert y.tobytes() == sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=np.ones(50), dt=0.1, steps=10).y.tobytes()
    assert np.shares_memory(world.y, y)


@for_each("numbers", [buffer_pool.LEAST_POOLED // 8, 100_000, 600_000])
def test_large_results_begin_at_a_cache_line(numbers: int) -> None:
    """As JAX asks for, which copies others; where NumPy's own memory begins is chance, so it is tried several times."""
    runs = []
    for extra in range(4):
        buffer_pool._free.clear()
        run = sw.integrate(sw.Oscillator(np.ones(numbers + extra)), "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
        runs.append(run)
        assert run.y.ctypes.data % 64 == run.v.ctypes.data % 64 == 0


def test_what_cannot_be_taken_or_stepped_in_place() -> None:
    away, one, two = OnDevice(np.ones(3)), np.ones(3), Tensor(np.ones(6)[::2])
    elsewhere = (
        r"expected an array in the memory of the CPU.*got test_dlpack\.OnDevice \(the array is on CUDA device 0\).*convert it"
    )
    world = partial(sw.World, sw.Oscillator(), "rk4", dt=0.1)
    for use, error, match in (
        (lambda: sw.Oscillator(away), DTypeError, elsewhere),
        (lambda: world(v=away, y=one), DTypeError, elsewhere),
        (lambda: world(v=Tensor(one.astype("f4")), y=one), DTypeError, "v: expected dtype float64 to step in place, got float32"),
        (lambda: world(v=one, y=two), ArgumentError, "y: expected a C-contiguous array to step in place"),
    ):
        refused(error, match, use)


def test_jax_in_and_out() -> None:
    jax = pytest.importorskip("jax", reason="jax is large, so the tests go without where it is not installed")
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    try:
        omega = jax.numpy.linspace(0.5, 2.0, 20_000)
        np.testing.assert_array_equal(sw.Oscillator(omega).omega, omega)  # a copy, as of every array
        run = sw.integrate(sw.Oscillator(omega), "rk4", v=0.0, y=jax.numpy.ones(20_000), dt=0.1, steps=8)
        for array in (run.y, run.v):
            out = jax.numpy.from_dlpack(array)
            assert out.unsafe_buffer_pointer() == array.ctypes.data
            np.testing.assert_array_equal(out, array)
        with pytest.raises(ArgumentError, match="y: expected a writeable array to step in place, got a read-only one"):
            sw.World(sw.Oscillator(), "rk4", v=np.zeros(20_000), y=jax.numpy.ones(20_000), dt=0.1)
        with pytest.raises(DTypeError, match=r"JAX's by jax\.device_get outside of jax\.jit"):
            jax.jit(lambda x: sw.integrate(sw.Oscillator(x), "rk4", v=0.0, y=1.0, dt=0.1, steps=1).y)(omega)
        with pytest.raises(DTypeError, match="omega: expected an array in the memory of the CPU, of a type that NumPy has"):
            sw.Oscillator(omega.astype(jax.numpy.bfloat16))
    finally:
        jax.config.update("jax_enable_x64", before)


def test_pytorch_in_and_out() -> None:
    torch = pytest.importorskip("torch", reason="torch is large, so the tests go without where it is not installed")
    omega = torch.linspace(0.5, 2.0, 20_000, dtype=torch.float64)
    assert sw.Oscillator(omega).omega.ctypes.data == omega.data_ptr()
    v, y = torch.zeros_like(omega), torch.ones_like(omega)
    run = sw.integrate(sw.Oscillator(omega), "rk4", v=v, y=y, dt=0.1, steps=8)
    assert torch.from_dlpack(run.y).data_ptr() == run.y.ctypes.data
    sw.World(sw.Oscillator(omega), "rk4", v=v.numpy(), y=y.numpy(), dt=0.1).step(8)
    assert torch.equal(y, torch.from_dlpack(run.y)[-1])
    refused(DTypeError, "without gradients", sw.Oscillator, omega.requires_grad_())


ONE = WithGradient(np.array(0.5))
SEVERAL = WithGradient(np.array([0.5, 1.0]))


@for_each("value", [ONE, SEVERAL, (ONE, ONE), [SEVERAL]])
@for_each("argument", ["v", "y", "dt", "t0", "force", "at", "omega", "tolerance"])
def test_those_with_a_gradient_are_refused(argument: str, value: Any) -> None:
    if argument == "tolerance" and isinstance(value, list):
        return  # refused before it is looked at, since it might mean a pair or members
    refused(DTypeError, rf"^{argument}.*: expected .*without gradients.*\.detach\(\)", _run, **{argument: value})


def _run(omega: Any = 1.0, **options: Any) -> None:
    """With fixed or adaptive steps, as the options need."""
    paced = "at" in options or "tolerance" in options
    method = "dop853" if paced else "rk4"
    defaults: dict[str, Any] = {"tolerance": 1e-6, "at": [1.0]} if paced else {"dt": 0.1, "steps": 3}
    sw.integrate(sw.Oscillator(omega), method, **{"v": 0.0, "y": 1.0} | defaults | options)


@for_each(
    ("argument", "use"),
    [
        ("axes: omega", lambda: sw.sweep(sw.Oscillator, {"omega": ("omega", [ONE])}, "rk4", v=0.0, y=1.0, dt=0.1, steps=2)),
        ("force", lambda: sw.World(sw.Oscillator(), "rk4", v=np.zeros(2), y=np.ones(2), dt=0.1, force=SEVERAL)),
        ("pairs", lambda: sw.Springs([ONE, ONE], rest=1.0)),
        ("fixed", lambda: sw.Springs([(0, 1)], rest=1.0, fixed=ONE)),
        ("y0", lambda: sw.solve_ivp(lambda t, y: -y, (0.0, 1.0), [ONE])),
        (
            "coords",
            lambda: sw.integrate(sw.Oscillator([1.0]), "rk4", v=0.0, y=1.0, dt=0.1, steps=1).to_xarray(coords={"x": [ONE]}),
        ),
    ],
)
def test_so_they_are_elsewhere(argument: str, use: Any) -> None:
    refused(ArgumentError, argument, use)

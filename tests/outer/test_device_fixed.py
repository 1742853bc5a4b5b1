"""Runs of fixed steps on a device of OpenCL have the bits of the core; in CI the device is the CPU, by PoCL."""

from __future__ import annotations

import itertools
import subprocess
import sys
import warnings
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from support.devices import SHORT, B, driven, lorenz, needs_device, of_recorded, same, start
from support.families import family

pytestmark = needs_device


@sw.system
def everything(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
    return -np.exp(-y * y) * np.tanh(v) - k * np.sqrt(np.abs(y)) * np.where(y > 0, 1.0, -1.0) / (1.0 + v * v) + np.floor(y)


#: All kinds of batches, worlds, records and starts are among them; methods and systems are in ``test_device_proof.py``.
SOME = (*SHORT[27::36], "pefrl, chain of five, direct, in pieces", "leapfrog, free, past some limits")


@pytest.mark.parametrize("name", family(SHORT, SOME.__contains__))
def test_recorded_runs(name: str, monkeypatch: Any) -> None:
    of_recorded(name, monkeypatch)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("fused", [False, True])
def test_precisions(dtype: str, fused: bool) -> None:
    rho = np.linspace(20.0, 30.0, B)
    same(lorenz(rho=rho), "rk4", y=start(3), dt=0.01, steps=205, every=10, dtype=dtype, fused=fused)


#: Functions with each type of numbers, and with each kind of rounding.
FUNCTIONS = family(itertools.product(("float64", "float32"), (False, True)), lambda dtype, fused: (dtype == "float32") == fused)


@pytest.mark.parametrize(("dtype", "fused"), FUNCTIONS)
def test_functions(dtype: str, fused: bool) -> None:
    system = everything(k=np.linspace(0.5, 2.0, B))
    same(system, "false_euler", v=start(), y=start(), dt=0.01, steps=100, dtype=dtype, fused=fused)


#: Each kind of samples in each way, by a method that looks at the ends of a step and by one that looks between them.
INPUTS = [
    (kind, interpolation, method, dtype)
    for kind in ("common", "own")
    for interpolation, methods in (("hold", ("leapfrog", "rk4")), ("linear", ("false_heun", "rk4")))
    for method in methods
    for dtype in ("float64", "float32")
]
FEW_INPUTS = [
    ("common", "hold", "leapfrog", "float64"),
    ("common", "linear", "false_heun", "float32"),
    ("own", "hold", "leapfrog", "float32"),
    ("own", "linear", "rk4", "float64"),
]


@pytest.mark.parametrize(("kind", "interpolation", "method", "dtype"), family(INPUTS, lambda *each: each in FEW_INPUTS))
def test_sampled_inputs(kind: str, interpolation: Any, method: str, dtype: str) -> None:
    """Samples that all have in common, and samples of each member."""
    values = np.random.default_rng(2).normal(size=(40, B))
    u = sw.Sampled(values if kind == "own" else values[:, 0], 0.05, interpolation=interpolation)
    same(driven(u=u), method, v=start(), y=start(), dt=0.02, steps=90, every=7, dtype=dtype, start_step=3)


@pytest.mark.parametrize("dtype", family(["float64", "float32"], lambda dtype: dtype == "float64"))
def test_sinusoids(dtype: str) -> None:
    """Of each member; float32 has the same statements, in other types."""
    same(driven(u=sw.Sinusoid(0.2, np.linspace(1, 2, B))), "rk4", v=start(), y=start(), dt=0.02, steps=90, dtype=dtype)


def test_times_of_each_member() -> None:
    u = sw.Sampled(np.random.default_rng(3).normal(size=40), 0.05)
    same(driven(u=u), "rk4", v=start(), y=start(), dt=0.02, steps=60, every=20, t0=np.linspace(-1.0, 1.0, B))


#: Velocities of a state, of one carry and of another; one of them in float32, where a larger number is doubted.
DIVERGING = family(
    itertools.product(("rk4", "leapfrog", "verlet"), ("float64", "float32")),
    lambda method, dtype: dtype == "float64" or method == "verlet",
)


@pytest.mark.parametrize(("method", "dtype"), DIVERGING)
def test_divergence_of_each_member(method: str, dtype: str) -> None:
    """The first step that was not finite, also of velocities that are computed from a carry, and across launches."""
    omega = np.geomspace(0.5, 3000.0, B)
    run = same(sw.Oscillator(omega=omega), method, v=start(), y=start(), dt=0.01, steps=700, every=100, dtype=dtype)
    assert 0 < (run.first_bad_step >= 0).sum() < B
    assert len(np.unique(run.first_bad_step)) > 20


def test_numbers_that_are_not_finite_or_subnormal() -> None:
    for dtype in ("float64", "float32"):
        kind = np.finfo(dtype)
        sizes = [0.0, -0.0, kind.smallest_subnormal, kind.tiny / 64, -kind.tiny / 1000, kind.max / 1e8, -kind.max / 2]
        y = np.resize(np.array(sizes, np.float64), (3, B))
        same(lorenz(), "rk4", y=y, dt=1e-3, steps=50, every=10, dtype=dtype)


def test_parts_of_a_system() -> None:
    """Control, projection, force, friction, contact, a sampled controller, recorded quantities."""
    omega = np.linspace(0.5, 2.0, B)
    oscillator = sw.Oscillator(omega=omega)
    for control in (sw.EnergyControl(0.3), sw.Projection()):
        bodies: Any = {"v": start(3, 2) / 4, "y": start(3, 2), "dt": 0.01, "steps": 60, "control": control}
        same(sw.NBody([1, 2, 1], softening=0.1), "standard_euler", record="energy", every=9, **bodies)
    same(oscillator, "leapfrog", v=start(), y=start(), dt=0.01, steps=100, force=start())
    particles = sw.Particles([1.0, 2.0], floor=sw.Floor(friction=0.3))
    same(particles, "false_euler", v=start(2, 2), y=np.abs(start(2, 2)), dt=0.01, steps=120, every=40)
    same(sw.RigidBody([1.0, 2.0, 3.0]), "rk4", v=start(3), y=start(4) / 2, dt=0.01, steps=60, record="energy", every=20)


def test_it_goes_on_where_it_stopped() -> None:
    for method in ("rk4", "verlet"):
        whole = same(driven(), method, v=start(), y=start(), dt=0.02, steps=80)
        half = sw.integrate(driven(), method, v=start(), y=start(), dt=0.02, steps=33, device="opencl")
        for device in ("opencl", "cpu"):
            rest = sw.integrate(driven(), method, resume=half, steps=47, device=device)
            assert np.array_equal(rest.y, whole.y)
            assert np.array_equal(rest.v, whole.v)


def test_one_member_and_no_batch() -> None:
    same(driven(), "rk4", v=0.1, y=1.0, dt=0.02, steps=80, every=1)
    same(driven(k=[2.0]), "rk4", v=0.1, y=1.0, dt=0.02, steps=80)


@pytest.mark.long
def test_a_step_of_five_thousand_operations() -> None:
    @sw.system
    def chain(t: Any, v: Any, y: Any, *, k: Any = 1.0) -> Any:
        d = np.diff(y, axis=0)
        f = k * d + d * d * d
        return np.concatenate([f[:1], f[1:] - f[:-1], -f[-1:]])

    same(chain(), "rk4", v=start(75), y=start(75), dt=0.01, steps=20)


def test_what_is_too_long_is_refused_before_any_work() -> None:
    n = 200
    with pytest.raises(sw.errors.UnsupportedError, match="too long for a kernel, which has at most 100000"):
        sw.integrate(sw.LinearSystem(np.eye(n)), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, device="opencl")


def test_names() -> None:
    options: Any = {"v": 0.0, "y": 1.0, "dt": 0.1, "steps": 1}
    for name in ("gpu", "opencl:", "opencl:x", 3, "cuda"):
        with pytest.raises(sw.errors.ArgumentError, match=r"device: expected 'cpu', 'opencl', or 'opencl:1'"):
            sw.integrate(sw.Oscillator(), "rk4", device=name, **options)
    with pytest.raises(sw.errors.UnsupportedError, match=r"device: there is no opencl:77; there are opencl:0 \("):
        sw.integrate(sw.Oscillator(), "rk4", device="opencl:77", **options)
    with pytest.raises(sw.errors.ArgumentError, match="device: works with backend='rust' only"):
        sw.integrate(sw.Oscillator(), "rk4", device="opencl", backend="numpy", **options)


def test_the_variable_names_the_device(monkeypatch: Any) -> None:
    monkeypatch.setenv("STEPWELL_DEVICE", "nothing")
    with pytest.raises(sw.errors.ArgumentError, match="STEPWELL_DEVICE: expected"):
        sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1)
    sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, device="cpu")


def test_devices_are_listed() -> None:
    cpu, *others = sw.devices()
    assert cpu.name == "cpu"
    assert not cpu.float64
    assert [each.name for each in others] == [f"opencl:{i}" for i in range(len(others))]
    assert all(each.memory > 0 and each.units > 0 and each.title for each in others)


def in_a_process(code: str, **environment: str) -> str:
    import os

    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=os.environ | environment, timeout=120
    )
    return run.stdout


RUN = """
import sys
{before}
import stepwell as sw
try:
    sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=1, device="opencl")
except sw.errors.UnsupportedError as error:
    print(error)
print([each.name for each in sw.devices()])
"""


def test_without_pyopencl() -> None:
    said = in_a_process(RUN.format(before="sys.modules['pyopencl'] = None"))
    assert "device: needs pyopencl, which is not installed; pip install 'stepwell[gpu]'" in said
    assert "['cpu']" in said


def test_without_a_device(tmp_path: Any) -> None:
    said = in_a_process(RUN.format(before=""), OCL_ICD_VENDORS=str(tmp_path))
    assert "device: pyopencl finds no device" in said
    assert "pocl-opencl-icd" in said
    assert "['cpu']" in said


MISTAKES = {
    "sums": ("a + b", "(real)((float)a + (float)b)", "sums are not rounded"),
    "subnormal numbers": (
        "a * (real)0.5",
        "fabs(a) < (real)2.2250738585072014e-308 ? 0 : a * (real)0.5",
        "subnormal numbers become",
    ),
    "contraction": ("a * b + c", "fma(a, b, c)", "products are contracted with sums"),
    "quotients": ("a / b", "a * ((real)1 / b)", "quotients are not correctly rounded"),
    "fused": ("fma(a, b, c)", "a * b + c", "fused multiply-adds are not rounded once"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_device_with_other_bits_is_refused(mistake: str, monkeypatch: Any) -> None:
    from stepwell.device import device_of, promise

    written, instead, reason = MISTAKES[mistake]
    machine = device_of("opencl")
    assert machine is not None
    monkeypatch.setattr(promise, "TRIED", [(instead if text == written else text, why) for text, why in promise.TRIED])
    assert reason in promise.broken.__wrapped__(machine, False)


def test_single_numbers_need_rounded_quotients(monkeypatch: Any) -> None:
    from stepwell.device import device_of, opencl, promise

    monkeypatch.setattr(opencl.Machine, "rounds_single", False)
    assert "float32" in promise.broken.__wrapped__(device_of("opencl"), True)
    monkeypatch.setattr(opencl.Machine, "has_doubles", False)
    assert promise.broken.__wrapped__(device_of("opencl"), False) == "it has no float64"


def test_every_operation_of_a_tape_is_printed() -> None:
    from stepwell.device import printer

    known = {*printer.ARITHMETIC, *printer.COMPARISONS, *printer.OF_BITS, "choose", "shift up", "shift down"}
    assert {name for name, operands, *_ in _core.tape_operations() if operands} - known == {"sample", "copy", "gather"}


@pytest.mark.parametrize("options", [{"dt": 0.02, "steps": 70}, {"tolerance": 1e-5, "at": [0.5]}], ids=["fixed", "adaptive"])
def test_groups_have_one_size(options: dict[str, Any], monkeypatch: Any) -> None:
    """Drivers of CPUs compile a kernel anew for each, which takes longer than many runs: not for other numbers of members."""
    from stepwell.device import device_of, opencl

    machine = device_of("opencl")
    assert machine is not None
    if not machine.is_cpu:
        pytest.skip("others choose a size for few members")
    sizes: set[Any] = set()
    begin = opencl.Machine.start

    def noted(self: Any, kernel: Any, size: int, group: int | None, *arguments: Any) -> None:
        if kernel.function_name != "prepare":
            sizes.add(group)
        begin(self, kernel, size, group, *arguments)

    monkeypatch.setattr(opencl.Machine, "start", noted)
    for members, expected in ((70, 64), (257, 64), (3, 1), (5, 1)):
        sizes.clear()
        sw.integrate(driven(u=0.1), "merson", v=start()[:members], y=start()[:members], device="opencl", **options)
        assert sizes == {expected}


def test_progress_and_pieces(monkeypatch: Any) -> None:
    """A run in many short launches has the same bits, and tells how far it is."""
    from stepwell.device import fixed

    monkeypatch.setattr(fixed, "MOST_STEPS", 3)
    monkeypatch.setattr(fixed, "FIRST_LAUNCH", 1)
    for every in (None, 1, 2, 7):
        same(driven(u=0.1), "leapfrog", v=start(), y=start(), dt=0.02, steps=23, every=every)


def test_what_does_not_fit_and_what_does_not_compile_is_said(monkeypatch: Any) -> None:
    from stepwell.device import device_of, opencl

    machine = device_of("opencl")
    assert machine is not None
    with pytest.raises(sw.errors.UnsupportedError, match=r"device: the compiler of opencl:0 .* fails at a step of 1 statements"):
        machine.program("this is no C;")
    monkeypatch.setattr(opencl.Machine, "largest", 1000)
    with pytest.raises(sw.errors.TooLargeError, match=r"device: an array of the run takes .* has at most .* for one"):
        sw.integrate(lorenz(), "rk4", y=start(3), dt=0.1, steps=1, device="opencl")


def test_notes_of_a_compiler_are_not_passed_on() -> None:
    """NVIDIA's has one on every kernel."""
    import pyopencl
    from stepwell.device import device_of

    machine, text = device_of("opencl"), "#warning a note\n__kernel void noted() {}"
    assert machine is not None
    with pytest.warns(pyopencl.CompilerWarning):
        pyopencl.Program(machine.context, text).build()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        machine.program(text)


def failed(cl: Any, routine: str, code: int) -> Any:
    """An error as pyopencl raises it."""
    return cl.MemoryError(cl._cl._ErrorRecord(msg="no room", code=code, routine=routine))


class Full:
    """A device's module that stands for one with no room: what it does after some calls raises pyopencl's own error."""

    def __init__(self, cl: Any, code: int, after: int) -> None:
        self._cl, self._code, self._left = cl, code, after

    def __getattr__(self, name: str) -> Any:
        if name not in ("Buffer", "enqueue_copy"):
            return getattr(self._cl, name)
        self._left -= 1
        if self._left >= 0:
            return getattr(self._cl, name)

        def fails(*_: Any, **__: Any) -> Any:
            raise failed(self._cl, name, self._code)

        return fails


@pytest.mark.parametrize("code", [-4, -5, -6, -61])
@pytest.mark.parametrize("after", [0, 3, 9])
def test_a_device_that_is_full_says_so(code: int, after: int, monkeypatch: Any) -> None:
    """Each array fits, all together do not: drivers say so when an array is made, or when it is used."""
    from stepwell.device import device_of

    machine = device_of("opencl")
    assert machine is not None
    sw.integrate(lorenz(), "rk4", y=start(3), dt=0.1, steps=4, every=1, device="opencl")
    monkeypatch.setattr(machine, "cl", Full(machine.cl, code, after))
    with pytest.raises(sw.errors.TooLargeError, match=r"device: opencl:0 .* has no room for all arrays of the run \(.*no room"):
        sw.integrate(lorenz(), "rk4", y=start(3), dt=0.1, steps=4, every=1, device="opencl")


def test_other_errors_of_a_device_stay(monkeypatch: Any) -> None:
    from stepwell.device import device_of

    machine = device_of("opencl")
    assert machine is not None
    monkeypatch.setattr(machine, "cl", Full(machine.cl, -38, 2))
    with pytest.raises(machine.cl.Error, match="INVALID_MEM_OBJECT"):
        sw.integrate(lorenz(), "rk4", y=start(3), dt=0.1, steps=4, device="opencl")


def test_a_kernel_for_which_there_is_no_room_says_so() -> None:
    from stepwell.device import device_of

    machine = device_of("opencl")
    assert machine is not None

    def kernel(*_: Any) -> None:
        raise failed(machine.cl, "clEnqueueNDRangeKernel", -4)

    with pytest.raises(sw.errors.TooLargeError, match="MEM_OBJECT_ALLOCATION_FAILURE"):
        machine.start(kernel, 1, None)

"""The devices of OpenCL, by pyopencl: what there is, and kernels by their text."""

from __future__ import annotations

import os
import re
import threading
import warnings
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache, cached_property
from typing import Any, NamedTuple

from ..base import checks
from ..base.available_memory import in_bytes
from ..base.optional import imported
from ..base.progress import waits_for
from ..errors import ArgumentError, TooLargeError, UnsupportedError

#: Where the name of the device is read that ``device=None`` means.
VARIABLE = "STEPWELL_DEVICE"
#: How many built programs a process keeps.
MOST_PROGRAMS = 64
#: The bit of OpenCL by which a device says that single quotients and roots are correctly rounded, where that is asked for.
ROUNDS_SINGLE = "-cl-fp32-correctly-rounded-divide-sqrt"
#: The errors of OpenCL that a full device raises: drivers allocate when an array is made, or when it is used first.
FULL = ("MEM_OBJECT_ALLOCATION_FAILURE", "OUT_OF_RESOURCES", "OUT_OF_HOST_MEMORY", "INVALID_BUFFER_SIZE")

#: The name of a kernel in a text.
KERNEL = re.compile(r"__kernel void (\w+)\(")

#: Filters of warnings are those of the process: one thread at a time changes them.
_SILENCE = threading.Lock()


class Device(NamedTuple):
    """A device on which runs are made, one of ``stepwell.devices()``.

    Attributes:
        name: what ``device=`` takes: "cpu", "opencl:0", "opencl:1", …
        title: its own name.
        platform: the name and version of its driver.
        memory: its memory, in bytes.
        units: how many units compute at the same time; of the CPU, cores.
        float64: "" if runs in float64 have the bits of the core, else the reason why they are refused.
        float32: the same of runs in float32.

    Example:
        >>> cpu = sw.devices()[0]
        >>> cpu.name, cpu.float64, cpu.float32
        ('cpu', '', '')
    """

    name: str
    title: str
    platform: str
    memory: int
    units: int
    float64: str = ""
    float32: str = ""


def device_of(name: Any) -> Machine | None:
    """The machine of a name, or of the variable ``STEPWELL_DEVICE`` if it is None; None for the CPU.

    Raises:
        ArgumentError: if there is no such name.
        UnsupportedError: if pyopencl or the device is missing; the message says what to install.
    """
    argument = "device"
    if name is None:
        name = os.environ.get(VARIABLE)
        if not name:
            return None
        argument = VARIABLE
    if name == "cpu":
        return None
    kind, _, number = str(name).partition(":")
    if not isinstance(name, str) or kind != "opencl" or (":" in name and not number.isdigit()):
        raise ArgumentError(
            f"{argument}: expected 'cpu', 'opencl', or 'opencl:1' for the second device, got {checks.short(name)}"
        )
    every = machines()
    index = int(number or 0)
    if index >= len(every):
        names = ", ".join(f"{each.described.name} ({each.described.title})" for each in every)
        raise UnsupportedError(f"{argument}: there is no {name}; there are {names}")
    return every[index]


class Machine:
    """A device with a context and a queue of its own; ``described`` is what ``devices`` tells of it."""

    def __init__(self, cl: Any, device: Any, name: str) -> None:
        self.cl, self.device = cl, device
        title, driver = device.name.strip(), f"{device.platform.name.strip()}, {device.version.strip()}"
        self.described = Device(name, title, driver, device.global_mem_size, device.max_compute_units)
        self._programs: OrderedDict[str, Any] = OrderedDict()
        self._lock = threading.Lock()

    def __repr__(self) -> str:
        return f"Machine({self.described.name!r}, {self.described.title!r})"

    def __reduce__(self) -> Any:
        return device_of, (self.described.name,)

    def __deepcopy__(self, _: Any) -> Machine:
        return self

    @cached_property
    def context(self) -> Any:
        """Its context."""
        return self.cl.Context([self.device])

    @cached_property
    def queue(self) -> Any:
        """Its queue, in order."""
        return self.cl.CommandQueue(self.context)

    @property
    def is_cpu(self) -> bool:
        """True if the device is a CPU."""
        return bool(self.device.type & self.cl.device_type.CPU)

    @property
    def has_doubles(self) -> bool:
        """True if the device computes in float64."""
        return bool(self.device.double_fp_config)

    @property
    def rounds_single(self) -> bool:
        """True if the device can round quotients and roots of float32 correctly."""
        return bool(self.device.single_fp_config & self.cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT)

    @property
    def largest(self) -> int:
        """The most bytes of one array."""
        return int(self.device.max_mem_alloc_size)

    def program(self, text: str) -> Any:
        """The program of this text, built once; pyopencl keeps what was built on disk."""
        with self._lock:
            if text in self._programs:
                self._programs.move_to_end(text)
                return self._programs[text]
        # Some compile it here, and some where it is first called: until what it computes is waited for.
        waits_for(f"compiling for {self.described.name}")
        options = ["-cl-std=CL1.2"] + [ROUNDS_SINGLE] * self.rounds_single
        try:
            built = Program(self._built(self.cl.Program(self.context, text), options))
        except self.cl.Error as error:
            raise UnsupportedError(
                f"device: the compiler of {self.described.name} ({self.described.title}) fails at a step of {text.count(';')} "
                f"statements, {str(error).splitlines()[0]}; use device='cpu'"
            ) from None
        with self._lock:
            self._programs[text] = built
            while len(self._programs) > MOST_PROGRAMS:
                self._programs.popitem(last=False)
        return built

    def _built(self, program: Any, options: list[str]) -> Any:
        """The program, built without a word: compilers have notes on texts of ours that do not concern who makes a run."""
        with _SILENCE, warnings.catch_warnings():
            warnings.simplefilter("ignore", self.cl.CompilerWarning)
            return program.build(options=options)

    def put(self, array: Any) -> Any:
        """A copy of an array on the device, to read and to write."""
        flags = self.cl.mem_flags
        self._fits(array.nbytes)
        if array.nbytes == 0:
            return self.room(1)
        with self._in_words():
            return self.cl.Buffer(self.context, flags.READ_WRITE | flags.COPY_HOST_PTR, hostbuf=array)

    def set(self, buffer: Any, array: Any) -> None:
        """Fill a buffer of the device from an array, once all before it is done."""
        if array.nbytes:
            with self._in_words():
                self.cl.enqueue_copy(self.queue, buffer, array)

    def room(self, size: int) -> Any:
        """Room for so many bytes on the device."""
        self._fits(size)
        with self._in_words():
            return self.cl.Buffer(self.context, self.cl.mem_flags.READ_WRITE, size=max(size, 1))

    def _fits(self, size: int) -> None:
        """Raise if an array of so many bytes is larger than any of the device."""
        if size > self.largest:
            raise TooLargeError(
                f"device: an array of the run takes {in_bytes(size)}, and {self.described.name} ({self.described.title}) has "
                f"at most {in_bytes(self.largest)} for one; split the batch, or use device='cpu'"
            )

    def get(self, array: Any, buffer: Any, offset: int = 0) -> None:
        """Fill an array from the device, once all before it is done."""
        if array.nbytes:
            with self._in_words():
                self.cl.enqueue_copy(self.queue, array, buffer, src_offset=offset)
        waits_for("")

    def copy(self, to: Any, buffer: Any) -> None:
        """Copy from one buffer of the device to another, once all before it is done."""
        with self._in_words():
            self.cl.enqueue_copy(self.queue, to, buffer)

    def start(self, kernel: Any, size: int, group: int | None, *arguments: Any) -> None:
        """Start a kernel of so many work items, in groups of that size, or of one that the driver chooses."""
        with self._in_words():
            kernel(self.queue, (size,), None if group is None else (group,), *arguments)

    def write(self, buffer: Any, array: Any) -> None:
        """Copy an array to the device, into a buffer that has room for it, once all before it is done."""
        self.cl.enqueue_copy(self.queue, buffer, array)

    def finish(self) -> None:
        """Wait until all is done."""
        with self._in_words():
            self.queue.finish()
        waits_for("")

    @contextmanager
    def _in_words(self) -> Iterator[None]:
        """Raise an error of our own where the device is full."""
        try:
            yield
        except self.cl.Error as error:
            if not any(each in str(error) for each in FULL):
                raise
            raise TooLargeError(
                f"device: {self.described.name} ({self.described.title}) has no room for all arrays of the run "
                f"({str(error).splitlines()[0]}); it has {in_bytes(self.described.memory)} in all; split the batch, or use "
                f"device='cpu'"
            ) from None


class Programs:
    """Kernels of several texts: each text is built once, whatever others stand beside it in a run, which holds ``lock``."""

    def __init__(self, machine: Machine, texts: list[str]) -> None:
        built = [(text, machine.program(text)) for text in texts]
        self._programs = {name: program for text, program in built for name in KERNEL.findall(text)}
        self._locks = [program.lock for _, program in built]

    def kernel(self, name: str) -> Any:
        """A kernel, by its name."""
        return self._programs[name].kernel(name)

    @property
    @contextmanager
    def lock(self) -> Iterator[None]:
        """The locks of all of them, in their order, which is that of every run."""
        with ExitStack() as held:
            for each in self._locks:
                held.enter_context(each)
            yield


class Program:
    """A built program; each kernel is made once, for that takes longer than a call of it."""

    def __init__(self, built: Any) -> None:
        self._built = built
        self._kernels: dict[str, Any] = {}
        self.lock = threading.Lock()

    def kernel(self, name: str) -> Any:
        """A kernel, by its name."""
        if name not in self._kernels:
            self._kernels[name] = getattr(self._built, name)
        return self._kernels[name]


@cache
def machines() -> list[Machine]:
    """All devices of OpenCL, GPUs first."""
    cl = imported("pyopencl", "device")
    every: list[Any] = []
    try:
        for platform in cl.get_platforms():
            every += platform.get_devices()
    except cl.Error as error:  # without any driver this is an error, too
        reason = str(error)
    else:
        reason = "no driver has one"
    if not every:
        raise UnsupportedError(
            f"device: pyopencl finds no device ({reason}); install the OpenCL driver of your GPU, or PoCL for the CPU, of Debian "
            f"the package pocl-opencl-icd"
        )
    every.sort(key=lambda device: not device.type & cl.device_type.GPU)  # stable
    return [Machine(cl, device, f"opencl:{i}") for i, device in enumerate(every)]


if hasattr(os, "register_at_fork"):
    # The threads of a driver do not go along into the child: there devices are found anew.
    os.register_at_fork(after_in_child=machines.cache_clear)

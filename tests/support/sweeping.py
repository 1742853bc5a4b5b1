"""What the tests of sweeps share: own equations and functions at the top of a module, so that other processes find them."""

from __future__ import annotations

import pickle
from concurrent.futures import Executor, Future
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import stepwell as sw


@sw.system
def driven(t: Any, v: Any, y: Any, *, mu: float = 1.0, push: float = 0.3) -> Any:
    """The oscillator of van der Pol, driven."""
    return mu * (1.0 - y**2) * v - y + push * np.sin(t)


@sw.system
def swinging(t: Any, v: Any, y: Any, *, mu: float = 1.0, push: float = 0.3) -> Any:
    """A pendulum, driven, for methods that carry something."""
    return -mu * np.sin(y) + push * np.sin(t)


@sw.system
def duffing(t: Any, v: Any, y: Any, *, alpha=-1.0, beta=1.0, delta=0.3, gamma=0.5, omega=1.2) -> Any:  # type: ignore[no-untyped-def]
    """A spring with two wells, damped and driven."""
    return gamma * np.cos(omega * t) - delta * v - alpha * y - beta * y**3


@duffing.invariant
def energy(v: Any, y: Any, *, alpha: Any, beta: Any) -> Any:
    """Without damping and drive."""
    return 0.5 * v**2 + 0.5 * alpha * y**2 + 0.25 * beta * y**4


def power(t: Any, v: Any, y: Any) -> Any:
    """A quantity that only a function tells."""
    return v * y


def ends(run: sw.Run) -> dict[str, Any]:
    """Of a chunk's run: an array, and one with an axis of its own."""
    return {"twice": 2.0 * run.y[-1], "both": ("block", np.stack([run.v[-1], run.y[-1]]))}


AXES = {"gamma": ("gamma", np.linspace(0.1, 0.6, 9)), "y": ("y0", np.linspace(-1.0, 1.0, 5))}
OUTCOMES = (
    *("last", "extremes", "mean", "crossing", "period", "lyapunov", sw.sweeps.Mean("energy"), sw.sweeps.Extremes(power)),
    *(sw.sweeps.Crossing("y", 0.3, "both", name="third"), ends),
)


def small(**options: Any) -> Any:
    """A sweep of 45 members with every kind of outcome."""
    arguments: dict[str, Any] = {"v": 0.0, "dt": 0.05, "steps": 80, "transient": 10, "outcomes": OUTCOMES} | options
    axes = arguments.pop("axes", AXES)
    return sw.sweep(partial(duffing, delta=0.2), axes, "rk4", **arguments)


def unlike(a: Any, b: Any) -> list[str]:
    """The names of arrays and coordinates that differ in a bit."""
    assert list(a.variables) == list(b.variables) or set(a.variables) == set(b.variables)
    return [name for name in a.variables if a[name].values.tobytes() != b[name].values.tobytes() or a[name].dims != b[name].dims]


class Pickling(Executor):
    """Computes here and at once, but nothing comes or goes that does not travel between processes."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        function, arguments, options = pickle.loads(pickle.dumps((fn, args, kwargs)))
        future: Future[Any] = Future()
        try:
            future.set_result(pickle.loads(pickle.dumps(function(*arguments, **options))))
        except Exception as error:
            future.set_exception(pickle.loads(pickle.dumps(error)))
        return future


def chunk_files(path: Path, name: str) -> list[Path]:
    """Those of an array in a store."""
    return sorted(each for each in (path / name / "c").rglob("*") if each.is_file())

"""The picture of one run: its trajectory, and its errors in energy and in state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...base import registry
from ...base.arrays import Array
from ...base.immutable import ValueEquality
from ...base.pictures import Drawn
from ...base.tables import Table
from ...errors import ArgumentError, DTypeError, ShapeError, UnsupportedError
from ...runs.encounters import MAX_RERUN
from ...runs.execution import quietly
from ...runs.findings.invariants import keeps_energy
from ...runs.result import Run
from ...scenes import Scene
from ...scenes import scene as find_scene
from .kinds import FixedPoint, kind_of

#: Times at which the exact solution is drawn.
EXACT = 6001

#: States of a broken run are drawn up to this size.
LARGEST = 1e9

#: A trail is as long as this share of the run, or of the period if there is one.
TRAIL, TRAIL_OF_PERIOD = 0.1, 0.3


@dataclass(frozen=True, eq=False)
class RunPicture(Drawn, Table, ValueEquality):
    """A run of a scene, with its errors at the saved states; arrays are of shape (saved,).

    A row for each saved state: time, each number of the blocks, energy and errors.

    Attributes:
        scene: the scene.
        run: the run.
        energy_error: of each saved state, relative to ``energy_scale``; infinite where it is not finite, NaN where the true one
            is not known; None for a system without an energy. Without an exact solution it is the change since the first state,
            and None where forces take or give energy in the true motion.
        energy_scale: what the energy error is relative to, in words.
        state_error: ``Scene.state_error``, or None if the scene has no exact solution.
    """

    scene: Scene
    run: Run
    energy_error: Array | None
    energy_scale: str
    state_error: Array | None
    _painter = "draw_run"

    @property
    def kind(self) -> str:
        """``"orbits"`` of bodies and points, an aircraft's ``"attitude"``, a rigid ``"body"``, a ``"swing"`` or ``"rows"``."""
        shape, picture = self.scene.system.y_shape, kind_of(self.run.system).picture
        if picture == "curves" or (picture == "orbits" and shape[-1] == 1):  # points on a line have no orbits
            return "rows" if shape else "swing"
        return picture

    @property
    def places(self) -> Array:
        """The places of points, shape (saved, points, dimensions)."""
        return _of_points(self.run.y)

    @property
    def exact_places(self) -> Array | None:
        """The places of the exact solution at the times of ``exact``, or None."""
        return None if self.exact is None else _of_points(self.exact[2])

    @property
    def fixed_points(self) -> list[FixedPoint]:
        """The bodies and the ends of rods that do not move."""
        return kind_of(self.run.system).fixed_points(self.run.system)

    @property
    def links(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        """The pairs of points that springs or rods join, shape (pairs, 2)."""
        return np.asarray(kind_of(self.run.system).links(self.run.system), dtype=np.int64).reshape(-1, 2)

    @property
    def trail(self) -> float:
        """How long the trail of a moving point is, in units of time: a share of the run, or of a short period."""
        length = TRAIL * float(self.elapsed[-1])
        return length if self.scene.period is None else min(length, TRAIL_OF_PERIOD * self.scene.period)

    @property
    def elapsed(self) -> Array:
        """The time since the first saved state; it ascends in runs back in time, too."""
        return np.asarray(np.abs(self.run.t - self.run.t[0]))

    @property
    def digits(self) -> int:
        """Digits after the point of a time in an animation: a hundredth of the run is seen."""
        return max(0, min(6, 2 - int(np.floor(np.log10(max(float(self.elapsed[-1]) / 100.0, 1e-300))))))

    @property
    def title(self) -> str:
        """The scene and the method."""
        return f"{self.scene.title} by {self.run.method.title}"

    @cached_property
    def before(self) -> RunPicture | None:
        """A run without the control, from the first saved state on; None without a control, or where it is long."""
        run = self.run
        if run.system.keeper is None or run.paces is not None or run.events or run.steps * run.v[0].size > MAX_RERUN:
            return None
        first, second = (round((float(t) - run.t0) / run.dt) for t in run.t[:2])
        free = quietly(
            run.system.uncontrolled,
            run.method,
            v=run.v[0],
            y=run.y[0],
            dt=run.dt,
            steps=run.steps,
            every=second - first,
            t0=run.t0,
            start_step=run.start_step,
            start=run.start,
            force=run.force,
            fused=run.fused,
        )
        state_error = None if self.state_error is None else self.scene.state_error(free)
        return replace(self, run=free, energy_error=_energy_error(self.scene, free)[0], state_error=state_error)

    @property
    def energy(self) -> Array | None:
        """The energy of each saved state, or None for a system without one."""
        try:
            return self.run.energy
        except UnsupportedError:
            return None

    @property
    def finite(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Which saved states are finite."""
        return np.asarray(
            np.isfinite(self.run.y).reshape(len(self.run.t), -1).all(axis=1)
            & np.isfinite(self.run.v).reshape(len(self.run.t), -1).all(axis=1)
        )

    @cached_property
    def exact(self) -> tuple[Array, Array, Array] | None:
        """Times, v and y of the exact solution over the run, for as long as it is known, or None."""
        first, last = float(self.run.t[0]), min(float(self.run.t[-1]), self.scene.until)
        if self.scene.exact is None or last <= first:
            return None
        if self.scene.period is not None and self.kind == "orbits":
            last = min(last, first + self.scene.period)  # the rest is the same curve
        t = np.linspace(first, last, EXACT)
        return t, *self.scene.exact(t)

    def exact_at(self, saved: Any) -> tuple[Array, Array] | None:
        """Blocks v and y of the exact solution at some saved states; None where it is not known at the last of them."""
        t = self.run.t[saved]
        return self.scene.exact(t) if self.scene.exact is not None and t[-1] <= self.scene.until else None

    def animate(
        self, path: str | Path, *, seconds: float = 10.0, fps: float = 20.0, progress: Callable[[float], object] | None = None
    ) -> None:
        """Write an animation of the run; its frames are the saved states.

        A page (.html) holds the states themselves, as numbers of 16 bits, and draws them: it is small, is written at once and
        needs no network. It shows more states than ``fps`` asks for if there is room, and where there is room for fewer, moves in
        straight lines between them.

        Args:
            path: the file, ending in .html, .gif or .mp4.
            seconds: how long it lasts, above zero.
            fps: frames a second, above zero; fewer if fewer states were saved.
            progress: a function that is called with the share of the frames that are drawn, from 0 to 1; a page has none.

        Raises:
            UnsupportedError: for .gif and .mp4, if matplotlib is missing; for .mp4, if ffmpeg is.
        """
        registry.task("animate_run")(self, path, seconds, fps, progress)

    def summary(self) -> dict[str, Any]:
        """The run in a few numbers; errors that are not known are left out of the largest."""
        return {
            "scene": self.scene.name,
            "method": self.run.method.name,
            "dt": self.run.dt,
            "steps": self.run.steps,
            "kept": len(self.run.t),
            "diverged_at_step": int(self.run.first_bad_step) if self.run.status else None,
            "largest_state_error": _largest(self.state_error),
            **({} if self.run.work is None else {"work_of_the_control": float(self.run.work)}),
            "largest_energy_error": _largest(self.energy_error),
        }

    def columns(self) -> dict[str, Array]:
        """The saved states as arrays with the time along the first axis: t, v, y, energy and errors, as far as there are any."""
        errors = {"energy": self.energy, "state_error": self.state_error, "energy_error": self.energy_error}
        known = {name: values for name, values in errors.items() if values is not None}
        return {"t": self.run.t, "v": self.run.v, "y": self.run.y} | known

    def _columns(self) -> dict[str, list[Any]]:
        return {
            name + (str(list(index)) if index else ""): values[(slice(None), *index)].tolist()
            for name, values in self.columns().items()
            for index in np.ndindex(values.shape[1:])
        }


def run_picture(scene: Scene | str, run: Run) -> RunPicture:
    """Make a picture of a run of a scene, with its errors.

    Args:
        scene: the ``Scene`` that was run, or its name.
        run: what ``scene.run(…, every=…)`` returned, with two states or more.

    Raises:
        ArgumentError: if the run is not of that scene, or keeps too little.

    Example:
        >>> clover = sw.scenes.clover()
        >>> picture = sw.charts.run_picture(clover, clover.run("leapfrog", every=1))
        >>> float(picture.state_error.max().round(3))
        0.243
    """
    scene = find_scene(scene)
    if not isinstance(run, Run):
        raise DTypeError(f"run: expected what scene.run returns, got {type(run).__name__}")
    if run.y.shape[1:] != scene.system.y_shape or run.v.shape[1:] != scene.system.v_shape:
        raise ShapeError(f"run: expected one member with states of shape {scene.system.y_shape}, got {run.y.shape[1:]}")
    if not scene.owns(run) or (run.t[0] == 0.0 and not _begins(scene, run)):
        raise ArgumentError(f"run: expected a run of the scene {scene.name}, got another start or system: {run!r}")
    if len(run.t) < 2:
        raise ArgumentError(f"run: expected two saved states or more, got {len(run.t)}; run with every=")
    energy_error, scale = _energy_error(scene, run)
    return RunPicture(scene, run, energy_error, scale, None if scene.exact is None else scene.state_error(run))


def own_picture(run: Run) -> RunPicture:
    """The picture of a run on its own, without an exact solution: a scene is made of its system and its first saved state."""
    if run.status.ndim:
        raise ArgumentError(f"run: expected a run of one member, got a batch of shape {run.status.shape}; integrate one of them")
    if len(run.t) < 2:
        raise ArgumentError(f"run: expected two saved states or more, got {len(run.t)}; run with every=")
    system = run.system.uncontrolled
    title = system.kind_name
    horizon = abs(float(run.t[-1] - run.t[0]))
    scene = Scene(system, v=run.v[0], y=run.y[0], dt=abs(run.dt), horizon=horizon, name=title, title=title)
    return run_picture(scene, run)


def _begins(scene: Scene, run: Run) -> bool:
    """True if the first state is the scene's start, up to the rounding of methods that compute v from what they carry.

    In float32 the start itself is rounded, by up to 2⁻²⁴ of a number.
    """
    pairs = ((run.v[0], scene.v), (run.y[0], scene.y))
    scale = max(float(np.abs(block).max(initial=0.0)) for _, block in pairs)  # a system of first order has no v
    near = (2.0**-21 if run.dtype == "float32" else 1e-9) * scale
    return all(np.allclose(saved, block, rtol=0.0, atol=near) for saved, block in pairs)


def _energy_error(scene: Scene, run: Run) -> tuple[Array | None, str]:
    if scene.exact is None and not keeps_energy(run.system, run.force):
        return None, ""  # it changes in the true motion, which is not known
    try:
        energy = run.energy
    except UnsupportedError:
        return None, ""
    if scene.exact is not None:
        return scene.energy_error(run), "the largest kinetic energy of the exact solution"
    # The kinetic energy is the scale because it has a zero of its own.
    at_rest = float(scene.system.energy(0.0 * scene.v, scene.y))
    scale, name = float(scene.system.energy(scene.v, scene.y)) - at_rest, "the kinetic energy at the start"
    if scale == 0.0:
        scale, name = abs(at_rest), "the energy at the start"
    if scale == 0.0:
        scale, name = _largest_kinetic(scene, run, energy) or 1.0, "the largest kinetic energy of the run"
    with np.errstate(all="ignore"):
        error = np.abs(energy - energy[0]) / scale
    return np.where(np.isfinite(error), error, np.inf), name


def _largest_kinetic(scene: Scene, run: Run, energy: Array) -> float:
    places = np.moveaxis(run.y, 0, -1)
    with np.errstate(all="ignore"):
        kinetic = energy - np.asarray(scene.system.energy(np.zeros((*scene.v.shape, 1)), places))
    return float(np.max(kinetic, where=np.isfinite(kinetic), initial=0.0))


def _of_points(y: Array) -> Array:
    """States with an axis for the points, which a block of a single point lacks."""
    return y if y.ndim == 3 else y[:, np.newaxis]


def _largest(error: Array | None) -> float | None:
    if error is None or np.isnan(error).all():
        return None
    return float(np.nanmax(error))

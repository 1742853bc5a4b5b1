"""§1 to §3: the criteria of a method, the symbols, and the forms of a system."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.stability import analyse, criteria
from ...base.arrays import Array
from ...model.methods import method
from ...model.surfaces import Floor
from ...model.systems import LinearSystem, Oscillator, Particles, Sampled
from ...runs.execution import quietly
from ..charts import style
from ..charts.labels import title
from . import Finding, Section

section_1, section_2, section_3 = Section("§1"), Section("§2"), Section("§3")


@section_1(
    "requirement",
    "A simple method is judged by four criteria: stability of an oscillator, deviation of its frequency, calculations per step, "
    "and the smallest step that is allowed.",
    "`sw.criteria`; `stepwell criteria`",
    "The last is a limit from above: the longest step that is stable.",
)
def four_criteria() -> Finding:
    """Every method has an answer to each of the four."""
    answers = criteria()
    whole = all(c.operations.additions + c.operations.multiplications > 0 and len(c.at) > 0 and c.limit >= 0 for c in answers)
    explicit = [c for c in answers if not c.method.is_implicit]
    best = max(explicit, key=lambda c: float(c.limit) / c.method.evaluations)
    return Finding(
        whole,
        f"{len(answers)} methods; of the explicit ones {best.method.title} has the longest step per function evaluation: "
        f"Φ < {best.limit:.4g}",
    )


#: Where in its step a particle meets the floor, as fractions of the step; and the methods by which it moves.
PHASES, MOVERS = np.linspace(0.0, 1.0, 100, endpoint=False), ("false_euler", "leapfrog", "rk4")


def _reflected(floor: Floor) -> dict[str, Array]:
    """The energy after an impact over that before, for each phase, by method. At Φ = 1.5 a step is long for the spring."""
    system = Particles(gravity=0.0, floor=floor)
    y = np.stack([np.zeros_like(PHASES), PHASES])[np.newaxis]
    v = np.array([0.0, -1.0])[np.newaxis, :, np.newaxis]
    runs = {name: quietly(system, name, v=v, y=y, dt=1.0, steps=12) for name in MOVERS}
    return {name: run.v[-1, 0, 1] ** 2 for name, run in runs.items()}


def _springy() -> Floor:
    return Floor(way="spring", omega=1.5)


def _draw_reflection(path: Path) -> object:
    spring, floor = _reflected(_springy()), _reflected(Floor())
    with style.page(9.2, 4.8) as figure:
        axes = figure.add_axes((0.085, 0.14, 0.66, 0.63))
        # False Euler and leapfrog differ by where in a step they have the velocity: the energies are equal.
        for names in (MOVERS[:2], MOVERS[2:]):
            colour = style.look(method(names[0]))["color"]
            axes.plot(PHASES, spring[names[0]], color=colour, linewidth=2.0)
            label = "\nand ".join(method(name).title for name in names) + ", spring"
            place: dict[str, Any] = {"xytext": (8, 0), "textcoords": "offset points", "va": "center", "annotation_clip": False}
            axes.annotate(label, (1.0, spring[names[0]][-1]), color=style.ink(colour), **place)
        (exact,) = {float(np.round(energy.max(), 12)) for energy in floor.values()}
        axes.axhline(exact, color="black", linewidth=2.2)
        axes.annotate("all three, Floor()", (1.0, exact), **place)
        axes.set(xlim=(0.0, 1.0), xlabel="where in its step the particle meets the floor", ylabel="energy after ÷ before")
        axes.grid(color="#dddddd", linewidth=0.8)
        most = max(float(energy.max()) for energy in spring.values())
        title(figure, 0.015, 0.92, f"A spring for a floor adds up to {100 * (most - 1):.0f} % of energy; Floor() adds none", 17)
        figure.text(0.015, 0.85, "One impact of a free particle, step 1.5 ÷ ω of the spring", size=12, color=style.GREY)
        figure.savefig(path)
    return figure


@section_1(
    "requirement",
    "An elastic reflection may have a wrong frequency, but must not add energy, even if the step is not small.",
    "`sw.Floor`, `sw.Sphere`: `Particles(floor=…)`; `sw.scenes.bouncing_ball()`",
    "A one-sided spring and a reversed velocity do not ensure that for every phase, step and method; the default of "
    "`Floor` does.",
    draw=_draw_reflection,
)
def elastic_reflection() -> Finding:
    """The largest ratio of the energies after and before an impact, of 100 phases: with a spring and with the default."""
    grown = [max(float(energy.max()) for energy in _reflected(floor).values()) for floor in (_springy(), Floor())]
    return Finding(
        grown[0] > 1.4 and abs(grown[1] - 1.0) < 1e-14,
        f"the worst of 100 phases and 3 methods, Φ = 1.5: energy × {grown[0]:.2f} by a spring, × {grown[1]:.6f} by `Floor()`",
    )


@section_2(
    "formula",
    "Φ = ω₀T is the true angle of a step, Ψ = Ω₀T that of the numerical solution.",
    "`analyse(…).true_angle`, `.angle`, `.omega`",
)
def angles() -> Finding:
    """Φ and Ψ of a step by False Euler at ω₀ = 2, T = 0.5."""
    step = analyse(Oscillator(omega=2.0), "false_euler", dt=0.5)
    holds = math.isclose(step.true_angle, 1.0) and math.isclose(step.angle, step.omega * 0.5)
    return Finding(holds, f"ω₀ = 2, T = 0.5: Φ = {step.true_angle:.4f}, Ψ = {step.angle:.4f}, Ω₀ = {step.omega:.4f}")


@section_3(
    "formula",
    "A linear system is ẏ = A·y + B·x with auxiliary outputs z = C·y + D·x.",
    "`sw.LinearSystem(A, B, C, D, x=…)`, `run.z`",
)
def state_space() -> Finding:
    """The step response of (1 + 2s)/(1 + s), where x acts on z at once (D is not zero)."""
    system = LinearSystem([[-1.0]], [[1.0]], [[-1.0]], [[2.0]], x=[1.0], velocities=0)
    run = quietly(system, "rk4", v=0.0, y=0.0, dt=0.01, steps=100, every=100)
    z = np.asarray(run.z).ravel()
    first, last = float(z[0]), float(z[-1])
    holds = first == 2.0 and abs(last - (1.0 + math.exp(-1.0))) < 1e-9
    return Finding(holds, f"unit step response of (1 + 2s)/(1 + s): z = {first:.4f} at once, {last:.6f} at t = 1")


@section_3(
    "formula",
    "The oscillator's physical form and its canonical form, whose velocity is v/ω₀, describe the same motion.",
    '`Oscillator(omega, damping, form="physical")`, `form="canonical"`',
)
def forms() -> Finding:
    """Both forms have the same y, from the same start."""
    canonical = quietly(Oscillator(2.0, 0.1), "rk4", v=0.5, y=1.0, dt=0.01, steps=500)
    physical = quietly(Oscillator(2.0, 0.1, form="physical"), "rk4", v=1.0, y=1.0, dt=0.01, steps=500)
    apart = abs(float(canonical.y[-1] - physical.y[-1]))
    return Finding(apart < 1e-14, "the same y after 500 steps, to rounding")


@section_3(
    "advice",
    "D = 0.707 is a good damping of a filter: its step response overshoots by 4 %.",
    "`Oscillator(damping=…, x=…)`",
)
def overshoot() -> Finding:
    """The overshoot of the step response is exp(−π·D/√(1 − D²)), here exp(−π)."""
    system = Oscillator(damping=math.sqrt(0.5), x=1.0)
    y = quietly(system, "rk4", v=0.0, y=0.0, dt=0.001, steps=8000, every=1).y
    over = float(y.max()) - 1.0
    return Finding(abs(over - math.exp(-math.pi)) < 1e-6, f"{100 * over:.2f} %")


@section_3(
    "advice",
    "The damping term serves two purposes: true drag, and an artificial damping that stabilises an unstable method.",
    "`Oscillator(damping=…)`; `damped_euler`",
)
def two_dampings() -> Finding:
    """By Standard Euler an undamped oscillator grows; with D = Φ/2 its amplitude is constant."""
    phi = 0.1
    plain = analyse(Oscillator(), "standard_euler", dt=phi).radius
    damped = analyse(Oscillator(damping=0.5 * phi), "standard_euler", dt=phi).radius
    return Finding(
        plain > 1.0 and abs(damped - 1.0) < 1e-12, f"Standard Euler at Φ = 0.1: r₁ = {plain:.6f}, with D = Φ/2 {damped:.6f}"
    )


@section_3(
    "formula",
    "Inputs are the point to which the spring pulls, x(t), and an acceleration a(t).",
    "`Oscillator(x=…, a=…)` with numbers, `sw.Sinusoid` or `sw.Sampled`",
)
def inputs() -> Finding:
    """A sampled input of equal samples moves the oscillator as a constant does."""
    sampled = Oscillator(x=Sampled([1.0, 1.0], 100.0))
    one, other = (float(quietly(each, "rk4", v=0.0, y=0.0, dt=0.01, steps=300).y[-1]) for each in (sampled, Oscillator(x=1.0)))
    exact = 1.0 - math.cos(3.0)
    return Finding(one == other and abs(one - exact) < 1e-9, f"y(3) = {one:.9f}, exactly 1 − cos 3 = {exact:.9f}")

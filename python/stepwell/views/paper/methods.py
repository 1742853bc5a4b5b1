"""§5 to §11: the methods on the undamped oscillator."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.stability import Analysis, analyse, criteria, stability_limit
from ...errors import UnsupportedError
from ...model.methods import method
from ...model.systems import Oscillator
from ...runs.execution import quietly
from ..charts import figures, verlet_friction
from . import Finding, Section

#: The angles per step at which closed forms are compared.
ANGLES = np.linspace(0.05, 1.95, 39)

#: The largest allowed difference between closed forms and analysis: some rounding errors of numbers as large as Φ⁴.
ROUNDING = 1e-13


def at(name: str, phi: Any = ANGLES) -> Analysis:
    """The analysis of a method on the undamped oscillator."""
    return analyse(Oscillator(), name, dt=phi)


def characteristic(name: str, p: Callable[[Any], Any], q: Callable[[Any], Any], formulas: str) -> Finding:
    """Check that z² − 2pz + q = 0 is the characteristic equation of a method, for Φ from 0.05 to 1.95."""
    analysis = at(name)
    off = max(float(np.abs(analysis.p - p(ANGLES)).max()), float(np.abs(analysis.q - q(ANGLES)).max()))
    return Finding(off < ROUNDING, f"{formulas}, to rounding")


def figure(section: Section, name: str, says: str, kind: str) -> None:
    """Add the entry of a method's figure; its check is that the samples are of that kind."""

    def check() -> Finding:
        samples = figures([name]).samples[0]
        holds = bool(np.isfinite(samples.y).all()) and kind in samples.kind
        return Finding(holds, f"Φ = 0.5, 4 periods: {samples.kind}, largest |y| = {np.abs(samples.y).max():.4g}")

    def draw(path: Path) -> object:
        return figures([name]).plot(path, method=name)

    check.__name__ = f"{name}_figure"
    section("figure", says, "`sw.charts.figures`; `stepwell figures`", draw=draw)(check)


section_5, section_6, section_7, section_8 = (Section(f"§{n}") for n in (5, 6, 7, 8))
section_9, section_10, section_11 = (Section(f"§{n}") for n in (9, 10, 11))

# ---- §5 Standard Euler


@section_5("algorithm", "Both new values are computed from the old ones: v − Φy, y + Φv.", "`standard_euler`")
def standard_euler() -> Finding:
    """One step by hand and by the method, bit for bit."""
    run = quietly(Oscillator(), "standard_euler", v=0.3, y=0.7, dt=0.1, steps=1)
    same = (float(run.v[-1]), float(run.y[-1])) == (0.3 + -0.1 * 0.7, 0.7 + 0.1 * 0.3)
    return Finding(same, "one step as printed, to the bit")


@section_5("formula", "z² − 2z + (1 + Φ²) = 0; r₁² = 1 + Φ²: always an unstable oscillation.", "`analyse(…).q`")
def standard_euler_equation() -> Finding:
    """The coefficients p and q, and a stability limit of 0."""
    result = characteristic("standard_euler", np.ones_like, lambda phi: 1 + phi**2, "p = 1, q = 1 + Φ²")
    return Finding(result.holds and stability_limit(Oscillator(), "standard_euler") == 0, result.numbers)


figure(section_5, "standard_euler", "The samples grow.", "unstable")


# ---- §6 Damped Euler


@section_6(
    "algorithm",
    "Standard Euler with an artificial damping D = Φ/2, which makes r₁ = 1.",
    "`damped_euler`",
    "It is False Euler with the blocks exchanged, so it needs no ω₀ and runs on every system.",
)
def damped_euler() -> Finding:
    """The samples of `damped_euler` and of Standard Euler with D = Φ/2."""
    phi = 0.3
    options: dict[str, Any] = {"v": 0.3, "y": 0.7, "dt": 0.3, "steps": 200}
    own = quietly(Oscillator(), "damped_euler", **options)
    damped = quietly(Oscillator(damping=0.5 * phi), "standard_euler", **options)
    apart = abs(float(own.y[-1] - damped.y[-1]))
    return Finding(apart < 1e-12, "the same samples over 200 steps, to rounding")


@section_6(
    "formula",
    "z² − 2(1 − DΦ)z + (1 − 2DΦ + Φ²) = 0; r₁² = 1 for D = Φ/2.",
    '`analyse(Oscillator(damping=D), "standard_euler", …)`',
)
def damped_euler_equation() -> Finding:
    """The coefficients for D = 0.1, and q = 1 for D = Φ/2."""
    step = analyse(Oscillator(damping=0.1), "standard_euler", dt=ANGLES)
    off = max(np.abs(step.p - (1 - 0.1 * ANGLES)).max(), np.abs(step.q - (1 - 0.2 * ANGLES + ANGLES**2)).max())
    harmonic = np.abs(at("damped_euler").q - 1).max()
    return Finding(max(off, harmonic) < ROUNDING, "p = 1 − DΦ, q = 1 − 2DΦ + Φ², to rounding")


@section_6(
    "formula",
    "Ψ is 1.047 at Φ = 1 and 1.570 at Φ = 1.414; the series Φ(1 + Φ²/24) gives 1.042 and 1.532.",
    "`analyse(…).angle`; `criteria(…)`",
    "At Φ = 1.414 the angle is 1.5706 (not quite the printed 1.570); at √2 it is π/2.",
)
def damped_euler_frequency() -> Finding:
    """The four numbers of Hoffmann's table."""
    psi = [float(at("damped_euler", phi).angle) for phi in (1.0, 1.414)]
    series = [phi * (1 + phi**2 / 24) for phi in (1.0, 1.414)]
    close = [abs(computed - printed) < 1e-3 for computed, printed in zip(psi + series, (1.047, 1.570, 1.042, 1.532), strict=True)]
    return Finding(all(close), f"Ψ = {psi[0]:.4f}, {psi[1]:.4f}; series {series[0]:.4f}, {series[1]:.4f}")


figure(section_6, "damped_euler", "Harmonic samples.", "harmonic")


# ---- §7 False Euler


@section_7("algorithm", "The second equation uses the new v: v − Φy, then y + Φv.", "`false_euler` (semi-implicit Euler)")
def false_euler() -> Finding:
    """One step by hand and by the method, bit for bit."""
    run = quietly(Oscillator(), "false_euler", v=0.3, y=0.7, dt=0.1, steps=1)
    v = 0.3 + -0.1 * 0.7
    return Finding((float(run.v[-1]), float(run.y[-1])) == (v, 0.7 + 0.1 * v), "one step as printed, to the bit")


@section_7(
    "formula", "z² − 2(1 − Φ²/2)z + 1 = 0: always a harmonic oscillation.", "`analyse(…).p`, `.q`", "Below the limit Φ = 2."
)
def false_euler_equation() -> Finding:
    """The coefficients p and q against the closed forms."""
    return characteristic("false_euler", lambda phi: 1 - phi**2 / 2, np.ones_like, "p = 1 − Φ²/2, q = 1")


@section_7("formula", "Its frequency is always too high, by Φ²/24.", "`analyse(…).frequency_ratio`")
def false_euler_frequency() -> Finding:
    """Ψ/Φ − 1 at small and at large Φ."""
    ratio = at("false_euler").frequency_ratio
    small = float(at("false_euler", 0.1).frequency_ratio) - 1
    # The next term of the series is 3Φ⁴/640.
    return Finding(bool((ratio > 1).all()) and abs(small - 0.01 / 24) < 2 * 3e-4 / 640, f"Ψ/Φ − 1 = {small:.3e} at Φ = 0.1")


@section_7(
    "formula",
    "Stable for Φ < 2: more than π steps per period, T/T₀ < 1/π, near the theoretical limit of 1/2.",
    "`sw.stability_limit`",
)
def false_euler_limit() -> Finding:
    """The limit as an angle and as steps per period."""
    limit = stability_limit(Oscillator(), "false_euler")
    steps = 2 * math.pi / float(limit)
    return Finding(
        abs(float(limit) - 2) < 1e-12 and abs(steps - math.pi) < 1e-12, f"Φ < {float(limit):.6g}, {steps:.6f} steps per period"
    )


figure(section_7, "false_euler", "Harmonic samples, a little too fast.", "harmonic")


# ---- §8 Verlet


@section_8(
    "algorithm",
    "yᵢ = 2yᵢ₋₁ − yᵢ₋₂ + T²·aᵢ₋₁ is False Euler with v replaced by the secant; its characteristic equation is the same.",
    '`verlet`, with `start="first_order"`',
)
def verlet() -> Finding:
    """The samples and p of Verlet and of False Euler."""
    options: dict[str, Any] = {"v": 0.4, "y": 1.0, "dt": 0.3, "steps": 200, "every": 1}
    one = quietly(Oscillator(), "verlet", start="first_order", **options).y
    other = quietly(Oscillator(), "false_euler", **options).y
    apart = float(np.abs(one - other).max())
    same = float(np.abs(at("verlet").p - at("false_euler").p).max())
    return Finding(apart < 1e-12 and same < ROUNDING, "the same samples over 200 steps and the same p, to rounding")


@section_8(
    "warning",
    "Verlet has no v. That is a problem for the initial velocity and for forces that depend on v.",
    "`verlet`: `start=`; systems with a velocity term are refused",
    '`start="second_order"` adds ½T²·a₀. It uses the initial v and is of second order.',
)
def verlet_start() -> Finding:
    """The observed order of both starts, from runs with a step and with half of it."""

    def error(start: str, steps: int) -> float:
        run = quietly(Oscillator(), "verlet", v=0.4, y=1.0, dt=5.0 / steps, steps=steps, start=start)
        return abs(float(run.y[-1]) - (math.cos(5.0) + 0.4 * math.sin(5.0)))

    orders = [math.log2(error(start, 1000) / error(start, 2000)) for start in ("first_order", "second_order")]
    return Finding(abs(orders[0] - 1) < 0.1 and abs(orders[1] - 2) < 0.1, f"observed orders {orders[0]:.2f} and {orders[1]:.2f}")


@section_8(
    "formula",
    "A step has two multiplications and two additions, as with False Euler.",
    "`sw.criteria()`; `sw.explain`",
    "Verlet has a third product, 2·y.",
)
def verlet_cost() -> Finding:
    """The products and sums of a step on the undamped oscillator."""
    counts = {c.method.name: c.operations for c in criteria(["verlet", "false_euler"])}
    text = "; ".join(f"{method(name).title}: {o.multiplications} products, {o.additions} sums" for name, o in counts.items())
    fits = [o.multiplications for o in counts.values()] == [3, 2] and all(o.additions == 2 for o in counts.values())
    return Finding(fits, text)


@section_8(
    "warning",
    "Forces that depend on the velocity, such as viscous drag and Coulomb friction, are a big problem for Verlet.",
    "`Oscillator(drag=…, friction=…)`; `sw.charts.verlet_friction()`, `sw.scenes.sliding_block()`",
    "Verlet refuses such systems. With the secant as the velocity, which only this figure uses, a block never comes to rest.",
    draw=lambda path: verlet_friction().plot(path),
)
def verlet_and_friction() -> Finding:
    """The position of a sliding block after 5 s: by Verlet with the secant, by False Euler, and exactly."""
    chart = verlet_friction()
    slides = chart.blocks[0]
    secant, right = float(slides.verlet[-1]), float(slides.false_euler[-1])
    try:
        quietly(Oscillator(0.0, friction=4.9, form="physical"), "verlet", v=3.0, y=0.0, dt=1 / 60, steps=1)
        refused = False
    except UnsupportedError:
        refused = True
    exact = 9.0 / (2.0 * 0.5 * 9.81)
    holds = refused and abs(secant - 0.808) < 1e-3 and abs(right - exact) < 0.03
    return Finding(
        holds,
        f"a sliding block after 5 s: secant {secant:.3f} and still moving, False Euler {right:.3f} at rest, exactly {exact:.3f}",
    )


figure(section_8, "verlet", "Harmonic samples.", "harmonic")


# ---- §9 Standard Heun


@section_9(
    "algorithm",
    "A step by Standard Euler, then the mean of the increments at both ends (predictor, corrector).",
    "`standard_heun`",
    "The rates are printed v̇ = −ω₀v, ẏ = ω₀y; they are v̇ = −ω₀y, ẏ = ω₀v.",
)
def standard_heun() -> Finding:
    """P at Φ = 0.4 as printed."""
    P = at("standard_heun", 0.4).P
    wanted = np.array([[1 - 0.08, -0.4], [0.4, 1 - 0.08]])
    return Finding(bool(np.allclose(P, wanted, rtol=0, atol=1e-15)), "P = [1 − Φ²/2, −Φ; Φ, 1 − Φ²/2]")


@section_9(
    "formula", "z² − 2(1 − Φ²/2)z + (1 + Φ⁴/4) = 0; r₁² = 1 + Φ⁴/4: always unstable, weakly for small steps.", "`analyse(…).q`"
)
def standard_heun_equation() -> Finding:
    """The coefficients p and q against the closed forms."""
    return characteristic("standard_heun", lambda phi: 1 - phi**2 / 2, lambda phi: 1 + phi**4 / 4, "p = 1 − Φ²/2, q = 1 + Φ⁴/4")


@section_9(
    "formula",
    "Ψ ≅ Φ(1 + Φ²/6); the frequency is always too high.",
    "`analyse(…).frequency_ratio`",
    "Only up to Φ = 2.0816; beyond, it is too low.",
)
def standard_heun_frequency() -> Finding:
    """Ψ/Φ − 1 on both sides of 2.0816."""
    low, high = (float(at("standard_heun", phi).frequency_ratio) - 1 for phi in (2.08, 2.083))
    small = float(at("standard_heun", 0.1).frequency_ratio) - 1
    # The next term of the series is −Φ⁴/20.
    holds = low > 0 > high and abs(small - 0.01 / 6) < 2e-4 / 20
    return Finding(holds, f"Ψ/Φ − 1 = {small:.3e} at Φ = 0.1, {low:+.1e} at 2.08, {high:+.1e} at 2.083")


figure(section_9, "standard_heun", "The samples grow slowly.", "unstable")


# ---- §10 False Heun


@section_10(
    "algorithm",
    "Heun with the new v in both rates of y.",
    "`false_heun`",
    "The lower right element of P is printed 1 − Φ²/2; it is 1 − Φ² + Φ⁴/2, as in Appendix B.",
)
def false_heun() -> Finding:
    """P at Φ = 0.4 with the corrected element."""
    phi = 0.4
    P = at("false_heun", phi).P
    off = phi * (1 - phi**2 / 2)
    wanted = np.array([[1 - phi**2 / 2, -off], [off, 1 - phi**2 + phi**4 / 2]])
    return Finding(bool(np.allclose(P, wanted, rtol=0, atol=1e-15)), f"lower right element at Φ = 0.4: {P[1, 1]:.4f}")


@section_10("formula", "z² − 2(1 − ¾Φ² + Φ⁴/4)z + (1 − Φ²/2) = 0; r₁² = 1 − Φ²/2.", "`analyse(…).p`, `.q`")
def false_heun_equation() -> Finding:
    """The coefficients p and q against the closed forms."""
    return characteristic(
        "false_heun", lambda phi: 1 - 0.75 * phi**2 + phi**4 / 4, lambda phi: 1 - phi**2 / 2, "p = 1 − ¾Φ² + Φ⁴/4, q = 1 − Φ²/2"
    )


@section_10(
    "formula",
    "The samples are monotonic unstable or a damped oscillation.",
    "`analyse(…).kind`, `stability_limit`",
    "From Φ = 1.2695 to √2 they are monotonic and stable.",
)
def false_heun_kinds() -> Finding:
    """The kinds of samples in the three ranges of Φ, and the limit."""
    kinds = [str(at("false_heun", phi).kind) for phi in (1.2, 1.35, 1.45)]
    limit = float(stability_limit(Oscillator(), "false_heun"))
    holds = kinds == ["damped oscillation", "monotonic stable", "monotonic unstable"] and abs(limit - math.sqrt(2)) < 1e-9
    return Finding(holds, f"Φ = 1.2, 1.35, 1.45: {', '.join(kinds)}; stable for Φ < {limit:.6g}")


figure(section_10, "false_heun", "The samples are damped.", "damped")


# ---- §11 Semi-False Heun


@section_11("algorithm", "Heun with the new v in the second rate of y only.", "`semi_false_heun`")
def semi_false_heun() -> Finding:
    """P at Φ = 0.4 as printed."""
    phi = 0.4
    P = at("semi_false_heun", phi).P
    wanted = np.array([[1 - phi**2 / 2, -phi], [phi * (1 - phi**2 / 2), 1 - phi**2 / 2]])
    return Finding(bool(np.allclose(P, wanted, rtol=0, atol=1e-15)), "P = [1 − Φ²/2, −Φ; Φ(1 − Φ²/2), 1 − Φ²/2]")


@section_11(
    "formula",
    "z² − 2(1 − Φ²/2)z + (1 − Φ⁴/4) = 0; r₁² = 1 − Φ⁴/4: always stable.",
    "`analyse(…).q`, `stability_limit`",
    "Stable for Φ < √(2√5 − 2) = 1.5723, where an eigenvalue passes −1.",
)
def semi_false_heun_equation() -> Finding:
    """The coefficients p and q against the closed forms, and the limit."""
    result = characteristic(
        "semi_false_heun", lambda phi: 1 - phi**2 / 2, lambda phi: 1 - phi**4 / 4, "p = 1 − Φ²/2, q = 1 − Φ⁴/4"
    )
    limit = float(stability_limit(Oscillator(), "semi_false_heun"))
    return Finding(
        result.holds and abs(limit - math.sqrt(2 * math.sqrt(5) - 2)) < 1e-9, f"{result.numbers}; stable for Φ < {limit:.6g}"
    )


figure(section_11, "semi_false_heun", "The samples are damped a little.", "damped")

"""§4: the transition matrix, its eigenvalues, and the behaviour of the samples that follows from them."""

from __future__ import annotations

import math

import numpy as np

from ...analysis.stability import analyse
from ...analysis.stability.analysis import KINDS
from ...model.systems import LinearSystem, Oscillator
from ...runs.execution import quietly
from ..charts import figures
from . import Finding, Section

section = Section("§4")

#: The angles of Hoffmann's harmonic cases, in degrees.
HARMONIC = (30.0, 90.0, 150.0)


def phi_of(psi: float) -> float:
    """The Φ at which False Euler turns by the angle Ψ a step: cos Ψ = 1 − Φ²/2."""
    return 2.0 * math.sin(0.5 * psi)


@section(
    "formula",
    "A step is y ← P·y + Q·x; the roots of det(Iz − P) = 0 decide how the samples behave.",
    "`analyse(…).P`, `.Q`, `.polynomial`, `.eigenvalues`; `stepwell stability`",
)
def transition_matrix() -> Finding:
    """P of Standard Euler for ẏ = A·y is I + T·A."""
    A = np.array([[-0.3, -2.0], [1.0, 0.0]])
    P = analyse(LinearSystem(A), "standard_euler", dt=0.1).P
    return Finding(bool(np.allclose(P, np.eye(2) + 0.1 * A, rtol=0, atol=1e-15)), "Standard Euler: P = I + T·A to rounding")


@section(
    "formula",
    "The characteristic equation is z² − 2pz + q = 0. A conjugate pair has r₁² = q, so q = 1 is the harmonic case.",
    "`analyse(…).p`, `.q`, `.radius`",
)
def p_and_q() -> Finding:
    """r₁² = q for six methods at Φ = 0.5, where each has a conjugate pair."""
    names = ("standard_euler", "damped_euler", "false_euler", "standard_heun", "false_heun", "semi_false_heun")
    steps = [analyse(Oscillator(), name, dt=0.5) for name in names]
    worst = max(abs(a.q - a.radius**2) for a in steps)
    return Finding(worst < 1e-14, "r₁² = q for six methods at Φ = 0.5, to rounding")


@section(
    "formula",
    "The eigenvalues decide whether samples are monotonic or oscillate, and whether they are stable, constant or unstable.",
    "`analyse(…).kind`; `stepwell.stability.KINDS`",
    "stepwell has two further kinds: a single negative eigenvalue, and a double pair.",
)
def kinds() -> Finding:
    """A decaying, a constant and a growing mode by Standard Euler."""
    kinds = [analyse(LinearSystem([[rate]]), "standard_euler", dt=0.1).kind for rate in (-1.0, 0.0, 1.0)]
    wanted = ["monotonic stable", "constant", "monotonic unstable"]
    return Finding(kinds == wanted and set(wanted) <= set(KINDS), ", ".join(kinds))


@section(
    "formula",
    "Ψ₁ = arctan(b₁/a₁) is the angle of a step, from 0 to π.",
    "`analyse(…).angle`",
    "The arctan of the quotient is wrong past π/2; atan2(b₁, a₁) is right.",
)
def angle() -> Finding:
    """The angle of False Euler where Ψ is 150°, by atan2 and by arctan."""
    step = analyse(Oscillator(), "false_euler", dt=phi_of(math.radians(150.0)))
    z = step.eigenvalues[0]
    wrong = math.degrees(math.atan(abs(z.imag) / z.real))
    return Finding(abs(math.degrees(step.angle) - 150.0) < 1e-9, f"atan2 {math.degrees(step.angle):.1f}°, arctan {wrong:.1f}°")


@section(
    "figure",
    "Harmonic samples with 30°, 90° and 150° a step have 12, 4 and 2.4 samples per period.",
    "`analyse(…).samples_per_period`; `sw.charts.figures().plot_harmonic()`",
    draw=lambda path: figures().plot_harmonic(path),
)
def harmonic_cases() -> Finding:
    """The samples per period of False Euler, which is harmonic for every Φ below 2."""
    steps = [analyse(Oscillator(), "false_euler", dt=phi_of(math.radians(psi))) for psi in HARMONIC]
    samples = [f.samples_per_period for f in steps]
    holds = all(abs(s - 360.0 / psi) < 1e-9 for s, psi in zip(samples, HARMONIC, strict=True))
    return Finding(holds and all(f.kind == "harmonic" for f in steps), ", ".join(f"{s:.1f}" for s in samples))


@section(
    "warning",
    "A double eigenvalue +1 or −1 is unstable: a pair that meets at −1 on the unit circle does not end as a harmonic one.",
    "`analyse(…).kind`",
    "Only if the two have a single eigenvector. RK-Merson at Φ = 2√3 has two, and stays bounded.",
)
def double_eigenvalue() -> Finding:
    """False Euler at Φ = 2 grows linearly; Merson at 2√3 does not grow."""
    phi = (2.0, 2.0 * math.sqrt(3.0))
    runs = [
        quietly(Oscillator(), name, v=0.3, y=1.0, dt=dt, steps=1000)
        for name, dt in zip(("false_euler", "merson"), phi, strict=True)
    ]
    grown = [float(np.hypot(run.v[-1], run.y[-1]) / math.hypot(0.3, 1.0)) for run in runs]
    return Finding(
        grown[0] > 100.0 and abs(grown[1] - 1.0) < 1e-9, f"1000 steps: False Euler × {grown[0]:.0f}, Merson × {grown[1]:.4f}"
    )


@section(
    "formula",
    "The eigenvalues of the transition matrix predict the stability of a sample sequence.",
    "`sw.stability_limit`, against runs in `sw.charts.stability_map`",
)
def eigenvalues_predict() -> Finding:
    """The largest sample just inside and just outside the limit of False Euler."""
    largest = [float(np.abs(figures(["false_euler"], phi=phi, periods=300).samples[0].y).max()) for phi in (1.999, 2.001)]
    return Finding(
        largest[0] < 100.0 < 1e6 < largest[1], f"largest |y|: {largest[0]:.3g} at Φ = 1.999, {largest[1]:.3g} at 2.001"
    )

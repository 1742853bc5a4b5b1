"""What is known of the methods from elsewhere, written without this library."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import stepwell as sw
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


def _false_euler(f: float) -> Matrix:
    return np.array([[1, -f], [f, 1 - f**2]])


def _rk4(f: float) -> Matrix:
    c, s = 1 - f**2 / 2 + f**4 / 24, f - f**3 / 6
    return np.array([[c, -s], [s, c]])


def _taylor(f: float, *beyond: Fraction) -> Matrix:
    """1 + z + z²/2 + z³/6 + z⁴/24 + c₅·z⁵ + …, z = iΦ: its real part twice on the diagonal, its imaginary part beside it."""
    terms = [c * f**k for k, c in enumerate((Fraction(1), Fraction(1), Fraction(1, 2), Fraction(1, 6), Fraction(1, 24), *beyond))]
    real, imaginary = (sum(term * (-1) ** m for m, term in enumerate(terms[first::2])) for first in (0, 1))
    return np.array([[real, -imaginary], [imaginary, real]], dtype=object if isinstance(f, Fraction) else None)


def _pefrl(f: float) -> Matrix:
    """Drifts and kicks as matrices, one after the other."""
    exact: Any = Fraction if isinstance(f, Fraction) else float
    xi, lam, chi = 0.1786178958448091, -0.2123418310626054, -0.06626458266981849
    whole: Any = np.array([[exact(1), exact(0)], [exact(0), exact(1)]])
    for drift, kick in ((xi, 0.5 - lam), (chi, lam), (1.0 - 2.0 * (chi + xi), lam), (chi, 0.5 - lam), (xi, 0.0)):
        d, k = exact(drift) * f, exact(kick) * f
        whole = np.array([[1, -k], [0, 1]]) @ np.array([[1, 0], [d, 1]]) @ whole
    return np.asarray(whole)


#: What the tableau of DOP853, printed to 30 digits, leaves of z⁹ to z¹² (bᵀAᵏ⁻¹1 in 40 digits, rounded).
DOP853_TAIL = [
    Fraction(c)
    for c in ("2.6916922001690856201e-6", "2.341345108209779967e-7", "1.4947364854591545873e-8", "3.6133245781282442801e-10")
]

#: Transition matrices of (v, y) on v̇ = −ω₀y, ẏ = ω₀v, as functions of Φ. Verlet's is that of its synchronised velocity.
CLOSED_FORMS: dict[str, Callable[[float], Matrix]] = {
    "standard_euler": lambda f: np.array([[1, -f], [f, 1]]),
    "damped_euler": lambda f: np.array([[1 - f**2, -f], [f, 1]]),
    "false_euler": _false_euler,
    "verlet": lambda f: np.array([[1 - f**2 / 2, -f * (1 - f**2 / 4)], [f, 1 - f**2 / 2]]),
    "leapfrog": lambda f: np.array([[1 - f**2 / 2, -f * (1 - f**2 / 4)], [f, 1 - f**2 / 2]]),
    "standard_heun": lambda f: np.array([[1 - f**2 / 2, -f], [f, 1 - f**2 / 2]]),
    "false_heun": lambda f: np.array([[1 - f**2 / 2, -f * (1 - f**2 / 2)], [f * (1 - f**2 / 2), 1 - f**2 + f**4 / 2]]),
    "semi_false_heun": lambda f: np.array([[1 - f**2 / 2, -f], [f * (1 - f**2 / 2), 1 - f**2 / 2]]),
    "rk4": _rk4,
    "taylor": lambda f: _taylor(f, *(Fraction(1, math.factorial(k)) for k in range(5, 9))),
    # Polynomials of z = iΦ: the exponential's to the order, then what the tableau leaves.
    "merson": lambda f: _taylor(f, Fraction(1, 144)),
    "fehlberg": lambda f: _taylor(f, Fraction(1, 104)),
    "fehlberg_5": lambda f: _taylor(f, Fraction(1, 120), Fraction(1, 2080)),
    "bs32": lambda f: np.array([[1 - f**2 / 2, -f + f**3 / 6], [f - f**3 / 6, 1 - f**2 / 2]]),
    "dopri5": lambda f: _taylor(f, Fraction(1, 120), Fraction(1, 600)),
    "dop853": lambda f: _taylor(f, *(Fraction(1, math.factorial(k)) for k in range(5, 9)), *DOP853_TAIL),
    "pefrl": _pefrl,
}


def matrix_of(method: str, phi: float, form: str, backend: str = "rust") -> Matrix:
    """The transition matrix found by stepping (1, 0) and (0, 1), in canonical variables."""
    omega = 1.0 if form == "canonical" else 1.7
    scale = 1.0 if form == "canonical" else omega  # physical v = ω₀·canonical v
    system = sw.Oscillator(omega, form=form)
    v, y = np.array([scale, 0.0]), np.array([0.0, 1.0])
    run = sw.integrate(system, method, v=v, y=y, dt=phi / omega, steps=1, backend=backend)
    return np.array([run.v[-1] / scale, run.y[-1]])


_HEUN = {0.0: 1 / 2, 1.0: 1 / 2}
#: Weights b of v₁ = v₀ + h·Σ b(c)·a(t + c·h) where only a(t) acts: each method is then a rule of quadrature.
WEIGHTS: dict[str, dict[float, float]] = {
    "standard_euler": {0.0: 1.0},
    "damped_euler": {0.0: 1.0},
    "false_euler": {0.0: 1.0},
    "verlet": _HEUN,  # of its synchronised velocity
    "leapfrog": _HEUN,
    "standard_heun": _HEUN,
    "false_heun": _HEUN,
    "semi_false_heun": _HEUN,
    "rk4": {0.0: 1 / 6, 0.5: 2 / 3, 1.0: 1 / 6},
    "merson": {0.0: 1 / 6, 0.5: 2 / 3, 1.0: 1 / 6},
    "fehlberg": {0.0: 25 / 216, 3 / 8: 1408 / 2565, 12 / 13: 2197 / 4104, 1.0: -1 / 5},
    "fehlberg_5": {0.0: 16 / 135, 3 / 8: 6656 / 12825, 12 / 13: 28561 / 56430, 1.0: -9 / 50, 0.5: 2 / 55},
    "bs32": {0.0: 2 / 9, 0.5: 1 / 3, 0.75: 4 / 9},
    "dopri5": {0.0: 35 / 384, 0.3: 500 / 1113, 0.8: 125 / 192, 8 / 9: -2187 / 6784, 1.0: 11 / 84},
    "dop853": {
        0.0: 5.42937341165687622380535766363e-2,
        1 / 3: 4.45031289275240888144113950566,
        0.25: 1.89151789931450038304281599044,
        4 / 13: -5.8012039600105847814672114227,
        127 / 195: 3.1116436695781989440891606237e-1,
        0.6: -1.52160949662516078556178806805e-1,
        6 / 7: 2.01365400804030348374776537501e-1,
        1.0: 4.47106157277725905176885569043e-2,
    },
    "pefrl": {
        0.1786178958448091: 0.7123418310626054,
        0.11235331317499061: -0.2123418310626054,
        0.8876466868250094: -0.2123418310626054,
        0.8213821041551909: 0.7123418310626054,
    },
}


def quadrature_error(method: str, backend: str = "rust") -> float:
    """How far one step under a(t) alone is from the rule; ω₀ = 1e-6 adds less than ω₀²."""
    t0, h = 0.7, 0.3
    system = sw.Oscillator(1e-6, a=sw.Sinusoid(1.0, 2.1, 0.4), form="physical")
    run = sw.integrate(system, method, v=0.0, y=0.0, dt=h, steps=1, t0=t0, backend=backend)
    rule = h * sum(b * np.sin(2.1 * (t0 + c * h) + 0.4) for c, b in WEIGHTS[method].items())
    return abs(float(run.v[-1]) - rule)


# ---- Appendix B, line by line, v0 = 0 and y0 = 1


def _euler(phi: float, n: int) -> Matrix:
    v0, y0, out = 0.0, 1.0, [1.0]
    for _ in range(n):
        v1 = v0 - phi * y0
        y1 = y0 + phi * v0
        v0, y0 = v1, y1
        out.append(y0)
    return np.array(out)


def _damped(phi: float, n: int) -> Matrix:
    v0, y0, out, d = 0.0, 1.0, [1.0], 0.5 * phi
    for _ in range(n):
        v1 = v0 - phi * (y0 + 2 * d * v0)
        y1 = y0 + phi * v0
        v0, y0 = v1, y1
        out.append(y0)
    return np.array(out)


def _false(phi: float, n: int) -> Matrix:
    v0, y0, out = 0.0, 1.0, [1.0]
    for _ in range(n):
        v1 = v0 - phi * y0
        y1 = y0 + phi * v1
        v0, y0 = v1, y1
        out.append(y0)
    return np.array(out)


def _verlet(phi: float, n: int) -> Matrix:
    y0, y2, out = 1.0, 1.0, [1.0]
    for _ in range(n):
        y1 = 2 * y0 - y2 + phi * phi * -y0
        y2, y0 = y0, y1
        out.append(y0)
    return np.array(out)


def _heun(kind: str) -> Callable[[float, int], Matrix]:
    def program(phi: float, n: int) -> Matrix:
        v0, y0, out = 0.0, 1.0, [1.0]
        for _ in range(n):
            dv1 = -phi * y0
            v11 = v0 + dv1
            dy1 = phi * (v11 if kind == "false" else v0)
            y11 = y0 + dy1
            dv2 = -phi * y11
            v12 = v0 + dv2
            dy2 = phi * (v11 if kind == "standard" else v12)
            v0, y0 = v0 + 0.5 * (dv1 + dv2), y0 + 0.5 * (dy1 + dy2)
            out.append(y0)
        return np.array(out)

    return program


PROGRAMS: dict[str, Callable[[float, int], Matrix]] = {
    "standard_euler": _euler,
    "damped_euler": _damped,
    "false_euler": _false,
    "verlet": _verlet,
    "standard_heun": _heun("standard"),
    "false_heun": _heun("false"),
    "semi_false_heun": _heun("semi"),
}


# ---- a forced oscillator and its exact solution

OMEGA, DRIVE, FORCE, END = 1.3, 2.1, 0.8, 2.0


def forced_exact(t: float, damping: float, v0: float, y0: float) -> tuple[float, float]:
    """(v, y) of ÿ + 2Dω₀ẏ + ω₀²y = F sin(Ωt), v the physical velocity: particular plus damped homogeneous solution."""
    k, c = OMEGA**2 - DRIVE**2, 2 * damping * OMEGA * DRIVE
    a, b = FORCE * k / (k * k + c * c), -FORCE * c / (k * k + c * c)  # a sin + b cos
    decay, ring = damping * OMEGA, OMEGA * np.sqrt(1 - damping**2)
    p = y0 - b
    q = (v0 - a * DRIVE + decay * p) / ring
    e, cos, sin = np.exp(-decay * t), np.cos(ring * t), np.sin(ring * t)
    y = e * (p * cos + q * sin) + a * np.sin(DRIVE * t) + b * np.cos(DRIVE * t)
    v = e * ((q * ring - decay * p) * cos - (p * ring + decay * q) * sin) + DRIVE * (
        a * np.cos(DRIVE * t) - b * np.sin(DRIVE * t)
    )
    return float(v), float(y)


def forced_error(method: str, dt: float, block: str, backend: str = "rust", start: str | None = None) -> float:
    """Error of one block at t = 2 on the forced system."""
    damping = None if sw.method(method).needs_acceleration else 0.2
    system = sw.Oscillator(OMEGA, damping, a=sw.Sinusoid(FORCE, DRIVE), form="physical")
    arguments: dict[str, Any] = {"v": 0.3, "y": 1.0, "dt": dt, "steps": round(END / dt), "backend": backend, "start": start}
    run = sw.integrate(system, method, **arguments)
    v, y = forced_exact(END, damping or 0.0, 0.3, 1.0)
    return abs(float(run.v[-1]) - v) if block == "v" else abs(float(run.y[-1]) - y)


def slope(error: Callable[[float], float]) -> float:
    """The order that two halvings show, extrapolated: each halving leaves about half of what is wrong with the slope."""
    for coarse in (1 / 50, 1 / 25, 1 / 10, 1 / 5, 1 / 2, 1):
        e = [error(dt) for dt in (coarse, coarse / 2, coarse / 4)]
        if e[2] > 1e-13:  # well above rounding
            break
    first, second = np.log2(e[0] / e[1]), np.log2(e[1] / e[2])
    return float(2 * second - first)

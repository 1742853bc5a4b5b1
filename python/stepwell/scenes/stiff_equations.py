"""The equations of the stiff scenes, as systems of their own: reactions from the Test Set for IVP Solvers, and Van der Pol's."""

from __future__ import annotations

from typing import Any

from ..model.equations import system


@system(order=1)
def rober(t: Any, y: Any, *, slow: Any = 0.04, fast: Any = 3e7, back: Any = 1e4) -> Any:
    """Robertson's reaction: A → B slowly, 2B → B + C fast, and B + C → A + C."""
    gained, made = back * y[1] * y[2] - slow * y[0], fast * y[1] ** 2
    return [gained, -gained - made, made]


@system(order=1)
def oregonator(t: Any, y: Any) -> Any:
    """Field and Noyes's Oregonator, a model of Belousov and Zhabotinsky's reaction, which swings."""
    a, b, c = y
    return [77.27 * (b + a * (1.0 - 8.375e-6 * a - b)), (c - (1.0 + a) * b) / 77.27, 0.161 * (a - c)]


@system(order=1)
def hires(t: Any, y: Any) -> Any:
    """Schäfer's High Irradiance Response of morphogenesis: eight reactants."""
    a, b, c, d, e, f, g, h = y
    seventh = 280.0 * f * h - 1.81 * g
    return [
        -1.71 * a + 0.43 * b + 8.32 * c + 0.0007,
        1.71 * a - 8.75 * b,
        -10.03 * c + 0.43 * d + 0.035 * e,
        8.32 * b + 1.71 * c - 1.12 * d,
        -1.745 * e + 0.43 * (f + g),
        -280.0 * f * h + 0.69 * d + 1.71 * e - 0.43 * f + 0.69 * g,
        seventh,
        -seventh,
    ]


@system
def van_der_pol(t: Any, v: Any, y: Any, *, mu: Any = 1000.0) -> Any:
    """Van der Pol's oscillator: damped beyond y = ±1, driven between them."""
    return mu * (1.0 - y * y) * v - y

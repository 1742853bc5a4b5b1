"""The equations: once as users of stepwell write them, and once as assignments for everybody else.

NumPy, numba, heyoka, JAX and SciPy all read the same assignments, each with its own exp, sin and cos. A test holds the two
against each other.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import stepwell as sw

from ..workloads import Array

#: What assignments may call.
FUNCTIONS = ("exp", "sin", "cos")


@dataclass(frozen=True)
class Equation:
    """A system of equations.

    Attributes:
        about: what it is, for the title.
        system: as stepwell takes it.
        text: a line for each rate, ``d_x = …``, and for what they share, over the states, parameters and t.
        start: for each number of a state, v before y, the least and the greatest at the start.
        own: for each parameter that every member has its own of, the least and the greatest.
        shared: parameters that all have in common.
        drive: a line that depends on the time alone, if there is one: who steps members side by side makes it once for all.
        dt: the step.
        steps: how many.
        heavy: whether sines and exponentials are most of the work.
    """

    about: str
    system: Any
    text: str
    start: Mapping[str, tuple[float, float]]
    own: Mapping[str, tuple[float, float]]
    dt: float
    steps: int
    shared: Mapping[str, float]
    drive: str = ""
    heavy: bool = False

    @property
    def name(self) -> str:
        """That of the function."""
        return self.system.name

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the numbers of a state."""
        return tuple(self.start)

    @property
    def lines(self) -> list[str]:
        """Of the rates."""
        return textwrap.dedent(self.text).strip().splitlines()

    @property
    def rates(self) -> tuple[str, ...]:
        """Names of the rates."""
        return tuple(f"d_{name}" for name in self.states)

    def function(self, module: Any) -> Callable[..., Any]:
        """``f(t, states, parameters)`` that gives the rates, by the functions of this module."""
        given = {name: getattr(module, name) for name in FUNCTIONS} | dict(self.shared)
        head = [f"{', '.join(self.states)}{',' * (len(self.states) == 1)} = s"]
        head += [f"{', '.join(self.own)}{',' * (len(self.own) == 1)} = p"]
        body = [*head, *filter(None, [self.drive]), *self.lines, f"return [{', '.join(self.rates)}]"]
        exec("def rates(t, s, p):\n" + textwrap.indent("\n".join(body), "    "), given)
        made: Callable[..., Any] = given["rates"]
        return made


@sw.system
def pendulum(t, v, y, *, omega=1.0):
    return -(omega * omega) * np.sin(y)


@sw.system
def duffing(t, v, y, *, alpha=-1.0, beta=1.0, delta=0.3, gamma=0.5, omega=1.2):
    return gamma * np.cos(omega * t) - delta * v - alpha * y - beta * y**3


@sw.system
def van_der_pol(t, v, y, *, mu=1.0):
    return mu * (1.0 - y * y) * v - y


@sw.system(order=1)
def lorenz(t, y, *, sigma=10.0, rho=28.0, beta=8 / 3):
    return np.array([sigma * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - beta * y[2]])


@sw.system(order=1)
def lotka_volterra(t, y, *, birth=1.5, hunt=1.0, feed=1.0, death=3.0):
    prey, hunters = y
    return [prey * (birth - hunt * hunters), hunters * (feed * prey - death)]


@sw.system(order=1)
def hodgkin_huxley(t, y, *, current=10.0):
    """Membrane of the squid's axon, mV and ms; rest at −65 mV."""
    u, m, h, n = y
    opens_m = 0.1 * (u + 40.0) / (1.0 - np.exp(-(u + 40.0) / 10.0))
    opens_h = 0.07 * np.exp(-(u + 65.0) / 20.0)
    opens_n = 0.01 * (u + 55.0) / (1.0 - np.exp(-(u + 55.0) / 10.0))
    shuts_m = 4.0 * np.exp(-(u + 65.0) / 18.0)
    shuts_h = 1.0 / (1.0 + np.exp(-(u + 35.0) / 10.0))
    shuts_n = 0.125 * np.exp(-(u + 65.0) / 80.0)
    through = 120.0 * m**3 * h * (u - 50.0) + 36.0 * n**4 * (u + 77.0) + 0.3 * (u + 54.387)
    return np.array(
        [
            current - through,
            opens_m * (1.0 - m) - shuts_m * m,
            opens_h * (1.0 - h) - shuts_h * h,
            opens_n * (1.0 - n) - shuts_n * n,
        ]
    )


@sw.system(order=1)
def phosphorylation(t, y, *, bind=2.0, turn=0.8, release=0.5):
    """A protein that a kinase E loads twice and a phosphatase F unloads twice, by mass action: ten species.

    Sites are s0, s1, s2; complexes e0, e1 of the kinase, f2, f1 of the phosphatase, and f0, in which its product still sits.
    """
    s0, s1, s2, e, f, e0, e1, f2, f1, f0 = y
    to_e0 = bind * s0 * e - release * e0
    to_e1 = bind * s1 * e - release * e1
    to_f2 = bind * s2 * f - release * f2
    to_f1 = bind * s1 * f - release * f1
    from_f0 = release * f0 - bind * s0 * f
    made_s1, made_s2, back_s1, back_s0 = turn * e0, turn * e1, turn * f2, turn * f1
    return np.array(
        [
            from_f0 - to_e0,
            made_s1 + back_s1 - to_e1 - to_f1,
            made_s2 - to_f2,
            made_s1 + made_s2 - to_e0 - to_e1,
            back_s1 + from_f0 - to_f2 - to_f1,
            to_e0 - made_s1,
            to_e1 - made_s2,
            to_f2 - back_s1,
            to_f1 - back_s0,
            back_s0 - from_f0,
        ]
    )


EQUATIONS = [
    Equation(
        "pendulums",
        pendulum,
        """
        d_v = -(omega * omega) * sin(y)
        d_y = v
        """,
        {"v": (-0.5, 0.5), "y": (-2.5, 2.5)},
        {"omega": (0.5, 2.0)},
        dt=0.01,
        steps=1000,
        shared={},
        heavy=True,
    ),
    Equation(
        "Duffing's oscillators under one drive",
        duffing,
        """
        d_v = drive - delta * v - alpha * y - beta * (y * y * y)
        d_y = v
        """,
        {"v": (-0.5, 0.5), "y": (-1.5, 1.5)},
        {"beta": (0.5, 2.0)},
        dt=0.01,
        steps=1000,
        shared={"alpha": -1.0, "delta": 0.3, "gamma": 0.5, "omega": 1.2},
        drive="drive = gamma * cos(omega * t)",
    ),
    Equation(
        "Van der Pol's oscillators",
        van_der_pol,
        """
        d_v = mu * (1.0 - y * y) * v - y
        d_y = v
        """,
        {"v": (-1.0, 1.0), "y": (-2.0, 2.0)},
        {"mu": (0.5, 2.0)},
        dt=0.01,
        steps=1000,
        shared={},
    ),
    Equation(
        "Lorenz's systems",
        lorenz,
        """
        d_x = sigma * (y - x)
        d_y = x * (rho - z) - y
        d_z = x * y - beta * z
        """,
        {"x": (4.0, 10.0), "y": (4.0, 10.0), "z": (20.0, 30.0)},
        {"rho": (20.0, 30.0)},
        dt=0.001,
        steps=1000,
        shared={"sigma": 10.0, "beta": 8 / 3},
    ),
    Equation(
        "Lotka and Volterra's hunters and prey",
        lotka_volterra,
        """
        d_prey = prey * (birth - hunt * hunters)
        d_hunters = hunters * (feed * prey - death)
        """,
        {"prey": (2.0, 4.0), "hunters": (1.0, 2.0)},
        {"birth": (1.0, 2.0), "hunt": (0.8, 1.2), "feed": (0.8, 1.2), "death": (2.5, 3.5)},
        dt=0.01,
        steps=1000,
        shared={},
    ),
    Equation(
        "Hodgkin and Huxley's neurons",
        hodgkin_huxley,
        """
        opens_m = 0.1 * (u + 40.0) / (1.0 - exp(-(u + 40.0) / 10.0))
        opens_h = 0.07 * exp(-(u + 65.0) / 20.0)
        opens_n = 0.01 * (u + 55.0) / (1.0 - exp(-(u + 55.0) / 10.0))
        shuts_m = 4.0 * exp(-(u + 65.0) / 18.0)
        shuts_h = 1.0 / (1.0 + exp(-(u + 35.0) / 10.0))
        shuts_n = 0.125 * exp(-(u + 65.0) / 80.0)
        through = 120.0 * (m * m * m) * h * (u - 50.0) + 36.0 * (n * n) * (n * n) * (u + 77.0) + 0.3 * (u + 54.387)
        d_u = current - through
        d_m = opens_m * (1.0 - m) - shuts_m * m
        d_h = opens_h * (1.0 - h) - shuts_h * h
        d_n = opens_n * (1.0 - n) - shuts_n * n
        """,
        {"u": (-64.9, -60.1), "m": (0.04, 0.06), "h": (0.55, 0.65), "n": (0.3, 0.35)},
        {"current": (5.0, 15.0)},
        dt=0.02,
        steps=200,
        shared={},
        heavy=True,
    ),
    Equation(
        "two-site phosphorylation, ten species",
        phosphorylation,
        """
        to_e0 = bind * s0 * e - release * e0
        to_e1 = bind * s1 * e - release * e1
        to_f2 = bind * s2 * f - release * f2
        to_f1 = bind * s1 * f - release * f1
        from_f0 = release * f0 - bind * s0 * f
        made_s1 = turn * e0
        made_s2 = turn * e1
        back_s1 = turn * f2
        back_s0 = turn * f1
        d_s0 = from_f0 - to_e0
        d_s1 = made_s1 + back_s1 - to_e1 - to_f1
        d_s2 = made_s2 - to_f2
        d_e = made_s1 + made_s2 - to_e0 - to_e1
        d_f = back_s1 + from_f0 - to_f2 - to_f1
        d_e0 = to_e0 - made_s1
        d_e1 = to_e1 - made_s2
        d_f2 = to_f2 - back_s1
        d_f1 = to_f1 - back_s0
        d_f0 = back_s0 - from_f0
        """,
        {
            "s0": (0.5, 1.5),
            "s1": (0.0, 0.5),
            "s2": (0.0, 0.5),
            "e": (0.5, 1.0),
            "f": (0.5, 1.0),
            **dict.fromkeys(("e0", "e1", "f2", "f1", "f0"), (0.0, 0.2)),
        },
        {"bind": (1.0, 3.0), "turn": (0.5, 1.0), "release": (0.3, 0.7)},
        dt=0.02,
        steps=500,
        shared={},
    ),
]
NAMED = {each.name: each for each in EQUATIONS}


def stacked(data: Mapping[str, Array], equation: Equation) -> tuple[Array, Array]:
    """Numbers of a state and own parameters, each of shape (numbers, members)."""
    members = data["v"].shape[-1]
    state = np.concatenate([data[name].reshape(-1, members) for name in ("v", "y")])
    return state, np.stack([data[name] for name in equation.own])

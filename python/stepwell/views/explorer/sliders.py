"""Offers of the page for each built-in scene: two methods that tell something, sliders, speed, the formula of the motion.

A slider sets numbers by their *paths*: ``m.omega`` a parameter of the exported step, ``m.Gm[1]`` an element of one, ``m.mass[*]``
all of one; ``e.`` likewise of the energy, ``v`` and ``y`` of the start. Each is set to the slider's value times a factor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...model.systems import Springs
from ...scenes import Scene


@dataclass(frozen=True)
class Slider:
    """A number that the page lets users slide.

    Attributes:
        name: its name in a link and in formulas of the page.
        label: the text beside it.
        low: its least value.
        high: its largest value.
        targets: the paths of the numbers that it sets, each with a factor.
        relative: whether it multiplies the numbers of the scene; it then begins at 1.
        about: a sentence, shown as a hint.
    """

    name: str
    label: str
    low: float
    high: float
    targets: Mapping[str, float]
    relative: bool = False
    about: str = ""


@dataclass(frozen=True)
class Offer:
    """The offer of the page for a scene.

    Attributes:
        sliders: the sliders.
        pair: the methods with which the page begins; None for those of any scene.
        dt: the step with which it begins; None for the scene's own.
        finding: what these methods and this step show, in a sentence or two.
        rate: units of time that pass in a second; None for a twentieth of the horizon.
        truth: the exact solution among those that the page has formulas for, or None: a run with small steps.
        limit: how the page finds the stability limit: "oscillator" and "chain" by the method's own, "scan" by the roots; or None.
        phase: the phase plane with which the page begins.
    """

    sliders: tuple[Slider, ...] = ()
    pair: tuple[str, str] | None = None
    dt: float | None = None
    finding: str = ""
    rate: float | None = None
    truth: str | None = None
    limit: str | None = None
    phase: int = 0


def masses(n: int) -> tuple[Slider, ...]:
    """A slider for the mass of each body."""
    return tuple(
        Slider(f"m{i + 1}", f"mass {i + 1}", 0.05, 6.0, {f"{path}[{i}]": 1.0 for path in ("m.Gm", "e.Gm", "e.masses")})
        for i in range(n)
    )


SOFTENING = Slider("soft", "softening", 0.0, 0.5, {"m.softening": 1.0, "e.softening": 1.0}, about="ε in r² + ε²")
SPEED = Slider("start", "speed at the start, ×", 0.5, 1.5, {"v[*]": 1.0}, relative=True)
ROD_GRAVITY = Slider("gravity", "gravity", 0.0, 5.0, {"m.gravity": 1.0, "e.gravity[1]": -1.0})


def rod_masses(n: int) -> tuple[Slider, ...]:
    """A slider for each mass that hangs on a rod."""
    return tuple(
        Slider(f"m{i + 1}", f"mass {i + 1}", 0.05, 6.0, {f"m.masses[{i}]": 1.0, f"e.masses[{i}]": 1.0}) for i in range(n)
    )


OFFERS: dict[str, Offer] = {
    "clover": Offer(
        (*masses(3), SOFTENING),
        pair=("false_euler", "rk4"),
        finding="False Euler makes a clover leaf of the circle. Runge-Kutta 4 stays on it.",
        rate=3.0,
    ),
    "oscillator": Offer(
        (Slider("omega", "ω₀", 0.2, 6.0, {"m.omega": 1.0}), Slider("start", "y at the start", -2.0, 2.0, {"y[0]": 1.0})),
        pair=("standard_euler", "false_euler"),
        finding=(
            "Standard Euler gains 9 % of its energy in every step. False Euler uses the new velocity, "
            "one line of code, and stays on an ellipse for ever."
        ),
        rate=3.0,
        truth="oscillator",
        limit="oscillator",
    ),
    "forced_oscillator": Offer(
        (
            Slider("omega", "ω₀", 0.2, 6.0, {"m.omega": 1.0, "e.omega": 1.0}),
            Slider("damping", "damping D", 0.0, 0.99, {"m.damping": 1.0}),
            Slider("amplitude", "amplitude of the drive", 0.0, 3.0, {"m.a_amplitude": 1.0}),
            Slider("drive", "frequency of the drive", 0.05, 3.0, {"m.a_omega": 1.0}),
        ),
        pair=("standard_euler", "false_euler"),
        finding=(
            "The oscillator is damped, and yet it swings up by Standard Euler, "
            "which feeds in more than the damping takes. By False Euler it does not."
        ),
        rate=3.0,
        truth="forced_oscillator",
        limit="scan",
    ),
    "pendulum": Offer(
        (
            Slider("omega", "ω₀ of small swings", 0.2, 6.0, {"m.omega": 1.0, "e.omega": 1.0}),
            Slider("start", "angle at the start", -3.14, 3.14, {"y[0]": 1.0}),
            Slider("push", "angular velocity at the start", -3.0, 3.0, {"v[0]": 1.0}),
        ),
        pair=("standard_euler", "leapfrog"),
        dt=0.1,
        finding="By Standard Euler the pendulum swings ever higher and goes over the top. Leapfrog swings back and forth.",
        rate=2.0,
        limit="oscillator",
    ),
    "chain": Offer(
        (
            Slider("stiffness", "stiffness", 0.1, 6.0, {"m.stiffness[*]": 1.0, "e.stiffness[*]": 1.0}),
            Slider("mass", "masses", 0.1, 6.0, {"m.mass[*]": 1.0, "e.mass[*]": 1.0}),
        ),
        pair=("standard_heun", "leapfrog"),
        finding=(
            "A trace of the fastest mode grows by Standard Heun until it hides the slow one. Leapfrog takes half the "
            "work and stays."
        ),
        rate=5.0,
        limit="chain",
    ),
    "energy_control": Offer(
        (Slider("gain", "gain C of the control", 0.0, 1.0, {"m.control_gain": 1.0}),),
        pair=("standard_euler", "rk4"),
        finding=(
            "Under the control Standard Euler's bodies stay together, as Runge-Kutta 4's do. "
            "Slide the gain to 0: Standard Euler's fly out nearly twice as far."
        ),
        rate=3.0,
    ),
    "kepler": Offer(
        (*masses(2), SPEED),
        pair=("rk4", "leapfrog"),
        dt=0.0125,
        finding="Runge-Kutta 4 loses energy for good at every close pass. Leapfrog gets it back, but its ellipse turns.",
        rate=1.5,
    ),
    "figure_eight": Offer(
        (*masses(3), SPEED),
        pair=("standard_euler", "leapfrog"),
        finding=("By Standard Euler the three bodies leave the eight within one turn. Leapfrog, at the same cost, stays on it."),
        rate=1.5,
    ),
    "pythagorean": Offer(
        (*masses(3), SOFTENING),
        pair=("leapfrog", "dop853"),
        finding=(
            "Leapfrog's step is too long for the near collision at t = 1.9 and throws the bodies apart. DOP853 passes "
            "it with the same step."
        ),
        rate=1.0,
    ),
    "arenstorf": Offer(
        (SPEED,),
        pair=("rk4", "dop853"),
        dt=0.005,
        finding="Runge-Kutta 4 leaves the orbit at the first passes of the moon. DOP853 comes back to where it began.",
        rate=1.0,
    ),
    "double_pendulum": Offer(
        (*rod_masses(2), ROD_GRAVITY),
        pair=("false_euler", "rk4"),
        finding=(
            "False Euler, so good on springs, loses energy on rods from the first swing on. Runge-Kutta 4 stays right "
            "until chaos sets in."
        ),
        rate=2.0,
    ),
    "conical_pendulum": Offer(
        (Slider("gravity", "gravity", 0.0, 5.0, {"m.gravity": 1.0, "e.gravity[2]": -1.0}), SPEED),
        pair=("false_euler", "rk4"),
        finding=("By False Euler the rod shrinks to two thirds of its length. Runge-Kutta 4 keeps it within a thousandth."),
        rate=1.0,
    ),
    "rope": Offer(
        (
            Slider("stiffness", "stiffness", 20.0, 2000.0, {"m.stiffness[*]": 1.0, "e.stiffness[*]": 1.0}),
            Slider("load", "mass at the end", 0.1, 10.0, {"m.masses[5]": 1.0, "e.masses[5]": 1.0}),
            Slider("gravity", "gravity", 0.0, 20.0, {"m.gravity[1]": -1.0, "e.gravity[1]": -1.0}),
        ),
        pair=("leapfrog", "rk4"),
        dt=0.035,
        finding=(
            "At this step the stiff springs shake themselves apart by Leapfrog. Runge-Kutta 4 damps them, which is wrong, too."
        ),
        rate=1.0,
        phase=10,
    ),
    "bouncing_ball": Offer(
        (
            Slider("restitution", "restitution e", 0.0, 1.0, {"m.contact_0_restitution": 1.0}),
            Slider("gravity", "gravity", 1.0, 20.0, {"m.gravity[1]": -1.0, "e.gravity[1]": -1.0}),
        ),
        pair=("false_euler", "rk4"),
        finding=(
            "Impacts fall between two steps. By False Euler the ball bounces early or late; by Runge-Kutta 4 within a "
            "hundredth of a second."
        ),
        rate=0.5,
        truth="bouncing_ball",
        phase=1,
    ),
    "sliding_block": Offer(
        (
            Slider("friction", "friction μg", 0.5, 15.0, {"m.friction_limit": 1.0}),
            Slider("start", "speed at the start", 0.0, 6.0, {"v[0]": 1.0}),
        ),
        pair=("standard_euler", "rk4"),
        dt=0.05,
        finding="By Standard Euler the block stops some 8 % too far; by Runge-Kutta 4 within half a per cent.",
        rate=0.2,
        truth="sliding_block",
    ),
    "sticking_block": Offer(
        (Slider("friction", "friction μN", 0.02, 0.6, {"m.friction_limit": 1.0}),),
        pair=("standard_euler", "false_euler"),
        dt=0.15,
        finding=(
            "The block should stick after some swings. By Standard Euler it swings on; by False Euler it sticks in the "
            "right place."
        ),
        rate=2.0,
        truth="sticking_block",
    ),
    "dzhanibekov": Offer(
        tuple(
            Slider(f"J{i + 1}", f"inertia {i + 1}", 0.3, 4.0, {f"m.inertia[{i}]": 1.0, f"e.inertia[{i}]": 1.0}) for i in range(3)
        ),
        pair=("standard_euler", "rk4"),
        dt=0.1,
        finding="By Standard Euler the body gains energy and tumbles too soon. Runge-Kutta 4 turns over in time.",
        rate=3.0,
    ),
    "van_der_pol": Offer(
        (Slider("mu", "damping μ", 0.5, 100.0, {"m.mu": 1.0}),),
        pair=("rk4", "rosenbrock23"),
        dt=0.01,
        finding=(
            "Stiff: by Runge-Kutta 4 it blows up at once, though nothing fast happens yet. Rosenbrock 2(3), an "
            "implicit method, creeps and jumps as it should."
        ),
        rate=10.0,
    ),
    "rober": Offer(
        (Slider("k2", "rate of the fast reaction, ×", 0.0, 2.0, {"m.fast": 1.0}, relative=True),),
        pair=("rk4", "rosenbrock23"),
        dt=0.002,
        finding=(
            "Stiff: Runge-Kutta 4 blows up at once at this step. Rosenbrock 2(3), an implicit method, is right to six digits."
        ),
        rate=2.0,
    ),
    "heavy_top": Offer(
        (Slider("weight", "weight", 0.0, 12.0, {"m.weight": 1.0, "e.weight": 1.0}),),
        pair=("standard_euler", "rk4"),
        finding="By Standard Euler the axis leaves its cusps. Runge-Kutta 4 meets every one.",
        rate=1.0,
    ),
}


def rope() -> Scene:
    """Six particles and five stiff springs, level at first, held at one end, with a load at the other."""
    n = 6
    y = np.stack([np.linspace(0.0, 1.0, n), np.zeros(n)], axis=1)
    pairs = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    loads = np.append(np.ones(n - 1), 2.0)
    system = Springs(pairs, stiffness=np.full(n - 1, 600.0), layout=y, masses=loads, fixed=[0], gravity=(0.0, -9.81))
    return Scene(
        name="rope",
        title="Rope of springs",
        section="not in Hoffmann (2002)",
        description="A rope of five stiff springs falls from level, with a load at its end: the springs limit the step.",
        system=system,
        v=np.zeros_like(y),
        y=y,
        dt=0.005,
        horizon=8.0,
    )


#: Which numbers of the energy belong to a parameter of a step, by the system's kernel: path and factor; {} stands for an index.
LINKS: dict[str, dict[str, tuple[tuple[str, float], ...]]] = {
    "chain": {"stiffness": (("e.stiffness{}", 1.0),), "mass": (("e.mass{}", 1.0),)},
    "nbody": {"Gm": (("e.Gm{}", 1.0), ("e.masses{}", 1.0)), "softening": (("e.softening", 1.0),)},
    "oscillator": {"omega": (("e.omega", 1.0),)},
    "particles": {"masses": (("e.masses{}", 1.0),), "gravity": (("e.gravity{}", 1.0),)},
    "pendulum": {"omega": (("e.omega", 1.0),)},
    "pendulum_3d": {"gravity": (("e.gravity[2]", -1.0),)},
    "restricted_three_body": {"mu": (("e.mu", 1.0),)},
    "rigid_body": {"inertia": (("e.inertia{}", 1.0),), "weight": (("e.weight", 1.0),), "centre": (("e.centre{}", 1.0),)},
    "rods": {"masses": (("e.masses{}", 1.0),)},
    "springs": {name: ((f"e.{name}{{}}", 1.0),) for name in ("stiffness", "rest", "masses", "gravity")},
}

#: The longest list whose elements have a slider each, and the most sliders by default.
MAX_ELEMENTS, MAX_SLIDERS = 4, 12


def generic(system: Any, parameters: Mapping[str, Any], controlled: bool) -> tuple[Slider, ...]:
    """Sliders for the parameters of any step: numbers, elements of short lists, and long lists as a whole.

    Under a control only its gain has a slider, since its target energy is that of the start with the other parameters as they
    are.
    """
    links = _links(system)
    sliders: list[Slider] = []
    for name, value in parameters.items():
        if name in ("dt", "t0", "control_target") or (controlled and name != "control_gain"):
            continue
        label = name.replace("_", " ")

        def targets(index: str, scalar: bool = False, name: str = name) -> dict[str, float]:
            others = {path.format("[*]" if scalar else index): factor for path, factor in links.get(name, ())}
            return {f"m.{name}{index}": 1.0} | others

        if not isinstance(value, list):
            sliders.append(_around(name, label, value, targets("", scalar=True)))
        elif any(isinstance(each, list) for each in value):
            continue
        elif len(value) <= MAX_ELEMENTS:
            sliders += [_around(f"{name}_{i}", f"{label} {i + 1}", x, targets(f"[{i}]")) for i, x in enumerate(value)]
        else:
            sliders.append(Slider(name, f"{label}, ×", 0.0, 2.0, targets("[*]"), relative=True))
    return tuple(sliders[:MAX_SLIDERS])


def _links(system: Any) -> dict[str, tuple[tuple[str, float], ...]]:
    """The numbers of the energy that belong to a system's parameters. Not G·m where G is not 1; not ω₀ in canonical form."""
    own = LINKS.get(system.kernel, {})
    if system.kernel == "nbody":
        return own | {"Gm": (("e.Gm{}", 1.0), ("e.masses{}", 1.0 / float(system.G) if system.G else 0.0))}
    if system.kernel == "oscillator" and system.form == "canonical":
        return {}
    if system.kernel == "rods":
        return own | {"gravity": ((f"e.gravity[{system.y_shape[1] - 1}]", -1.0),)}
    return own


def _around(name: str, label: str, value: float, targets: dict[str, float]) -> Slider:
    low, high = (min(0.0, 2.0 * value), max(0.0, 2.0 * value)) if value else (-1.0, 1.0)
    return Slider(name, label, low, high, targets)

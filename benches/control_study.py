"""``python -m benches.control_study``: what energy control and projection do to energy and to state, into CONTROL.md.

Everything is counted and nothing timed, so the report is the same to the digit on every machine.
"""

from __future__ import annotations

import argparse
import itertools
import math
import warnings
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import stepwell as sw
from stepwell.views.charts import ControlSweep, Held

HERE = Path(__file__).parent

METHODS = ("standard_euler", "false_euler", "leapfrog", "standard_heun", "rk4")

#: What is tabled of a sweep: the kind, and the gain h·C·K at the start.
TABLED: tuple[tuple[str, float | None], ...] = (
    ("none", None),
    ("limited", 1e-3),
    ("limited", 1e-2),
    ("limited", 1e-1),
    ("limited", 1.0),
    ("limited", 100.0),
    ("printed", 1e-1),
    ("printed", 1.0),
    ("scaling", None),
    ("nacozy", None),
)

#: The 36 runs: gains, forces and methods.
GAINS = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
FORCES = {"printed": "printed", "logarithmic": "matching", "newton": "Newton's"}
EULERS = ("standard_euler", "false_euler")

#: Starts of a chaotic run are told apart by this much, so that a count does not hang on one start's luck.
APART, STARTS = 1e-9, 32

Line = Sequence[object]

HEAD = """# Energy control and projection: what they do to energy and to state

Does a control of the energy, or a projection after each step, make a run better? For seven motions and five methods:

## Conclusions

1. **With RK4: project.** `Projection("scaling")` made the state better on all six orbits, from 1.8 times (circle) to
   7.7 times (e = 0.9) in some 10 periods, 68 times on the figure-eight in 100. Without it energy drifts and the period
   with it, so the phase error grows as t²; with it as t. Nacozy's projection is as good, and costs more.
2. **With RK4 a strong control costs orders.** The push acts in the stages, whose energies are off by h². At a fixed C
   that is still a smooth system, and RK4 has order 4; at h·C·K = 10 it falls to 2, and at 100 the state on the circle
   is 80 times worse than without. Project instead, or stay at h·C·K = 0.01, where the energy error is least.
3. **With Standard Heun: control, limited, h·C·K from 0.01 to 1.** State 3 to 190 times better than alone and 2 to 76
   times better than projected, although its energy is off by 1e-3 and that of the projection by 1e-15. The push in the
   second stage removes part of Heun's phase error, which a projection leaves. The smaller the energy error, the worse
   the state: energy is not accuracy.
4. **False Euler and leapfrog: leave them alone.** Their energy error does not grow. Scaling or control took False
   Euler's angular momentum, kept to 3e-15, 4 % off and made the state 5 times worse on Kepler's ellipse; on the figure-
   eight Nacozy's projection ruined it (1.31 for 0.022), and scaling gained a factor of 2 there. At the same cost leapfrog is 2
   times better than False Euler on the figure-eight, without any control.
5. **Standard Euler: control hides the error.** With the energy right to 1e-15 the figure-eight is lost within 10
   periods (1.8; at 1 the error is as large as the solution). On Kepler's ellipse, with a step so small that it
   survives, the period becomes right and the angular momentum is 12 % off.
6. **Gain.** The printed form needs h·C·K < 1 at every moment, and K has no bound at encounters; the limited form stays
   finite at any gain. There is no best gain for the state: where the error is least, two errors cancel at the end
   of the run. h·C·K = 0.01 at the start (0.1 for False Euler and Standard Euler in chaos) is where drift is gone and the
   push does little else.
7. **Remove the momentum first.** Controls and projections multiply the total momentum, too. Where a method loses energy at
   encounters, as False Euler does here, the factors are above 1, and a momentum of 0.01 grows until the centre of mass
   has the energy that the control puts in: it moved 420 away, while the bodies stayed within 5 of it. With v −= Σmv/Σm
   at the start it stays where it is.
8. **In chaos no orbit is right.** A bounded one need not be true either: by small steps of RK4 bodies reach 5.5 from
   the centre of mass (median), by Standard Euler under strong control only 2 or 3.

## How to read the tables

*limited* and *printed* are the forms of `EnergyControl`, with h·C·K at the start; *scaling* and *nacozy* the kinds of
`Projection`. All methods make the same number of rate evaluations. State errors are relative to the largest true state; energy
errors are the largest of the run. Nothing is timed, so the numbers are the same on every machine. They are written by
`python -m benches.control_study`, with the data in `benches/control`; `sw.charts.control` makes and draws them."""

RUNS = f"""h = 0.01, 100 000 steps, C = {", ".join(f"{gain:g}" for gain in GAINS)}. ● stays finite, · overflows. The motion is
chaotic, so the last bit of the start decides which run overflows; beside Hoffmann's start stand {STARTS} that are
{APART:g} apart."""

MANY = f"""{STARTS} starts that are {APART:g} apart, over 1000 units of time; medians of the largest |E − E₀| and of the largest
coordinates of the runs that stay finite. The energy is 3.15 at the start. The last line resolves encounters better than
the others, not all of them."""

ORDERS = """Kepler's circle, e = 0, over three periods; state errors."""

BEST = """Figure-eight, limited form. For each method: the gain with the least state error, and by how much the state error is
smaller there, at h·C·K = 100, and by scaling, than without control. FE False Euler, SH Standard Heun. Number of periods and
step move the best gain by orders of magnitude: it is where an error passes through zero at the end of the run, and no
property of the method."""


def quiet(system: sw.NBody, method: str, **options: Any) -> sw.Run:
    """A run that may diverge."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.DivergenceWarning)
        warnings.simplefilter("ignore", sw.ControlWarning)
        return sw.integrate(system, method, **options)


def table(head: Iterable[str], lines: Iterable[Line]) -> str:
    """A table in Markdown."""
    head = list(head)
    rows = [head, ["---"] * len(head), *([shown(cell) for cell in line] for line in lines)]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def shown(cell: object) -> str:
    """A cell: numbers with three digits."""
    if not isinstance(cell, float):
        return str(cell)
    if math.isnan(cell):
        return "—"
    return "diverged" if math.isinf(cell) else f"{cell:.2e}" if abs(cell) < 0.01 or abs(cell) >= 1000 else f"{cell:.3g}"


def named(kind: str, gain: float | None) -> str:
    """What a line of a table is called."""
    return kind if gain is None else f"{kind}, {gain:g}"


def at(line: Held, gain: float | None, what: str) -> float:
    """A value of a line at a gain."""
    i = 0 if gain is None else int(np.argmin(np.abs(np.log(line.relative / gain))))
    return float(getattr(line, what)[i])


def tabled(chart: ControlSweep, what: str) -> str:
    """A table of one quantity: kinds and gains by methods."""
    kinds = {(line.method.name, line.kind): line for line in chart.lines}
    titles = list(dict.fromkeys(line.method.title for line in chart.lines))
    lines = []
    for kind, gain in TABLED:
        found = [kinds.get((name, kind)) for name in METHODS]
        lines.append([named(kind, gain), *("—" if line is None else at(line, gain, what) for line in found)])
    return table(["control, h·C·K", *titles], lines)


def control_of(kind: str, gain: float | None) -> Any:
    """The control of a tabled line."""
    if kind == "none":
        return None
    return sw.Projection(kind) if gain is None else sw.EnergyControl(form=kind, relative=gain)


def ends(scene: sw.scenes.Scene, horizon: float, evaluations: int) -> Iterator[tuple[str, str, sw.Run]]:
    """The last states of every method under the controls of which it is told what is wrong."""
    for method, (kind, gain) in itertools.product(METHODS, TABLED):
        if kind == "printed" or gain not in (None, 1e-2, 100.0):
            continue
        steps = round(evaluations / sw.method(method).evaluations)
        start = {"v": scene.v, "y": scene.y, "dt": horizon / steps, "steps": steps}
        try:
            run = quiet(scene.system, method, **start, control=control_of(kind, gain))
        except sw.StepwellError:  # leapfrog has no v in its stages
            continue
        yield sw.method(method).title, named(kind, gain), run


# ---- the 36 runs


def thirty_six() -> str:
    """How many of Appendix D's runs stay finite: Hoffmann's start, and many next to it."""
    scene = sw.scenes.energy_control()
    members = len(GAINS) * STARTS
    shape = (*scene.v.shape, members)
    v = np.broadcast_to(scene.v[..., np.newaxis], shape).copy()
    v[2, 0] += APART * np.repeat(np.arange(STARTS), len(GAINS))
    y = np.broadcast_to(scene.y[..., np.newaxis], shape)
    gain = np.tile(GAINS, STARTS)
    lines, whole = [], {form: [0, 0] for form in ("printed", "limited")}
    for (force, name), method in itertools.product(FORCES.items(), EULERS):
        cells: list[object] = [name, sw.method(method).title]
        for form in whole:
            control = sw.EnergyControl(gain, form)
            run = quiet(sw.NBody(force=force), method, v=v, y=y, dt=0.01, steps=100_000, control=control)
            fine = (run.first_bad_step < 0).reshape(STARTS, len(GAINS))
            whole[form][0] += int(fine[0].sum())
            whole[form][1] += int(fine.sum())
            cells += ["".join("●" if good else "·" for good in fine[0]), f"{fine.sum()} of {members}"]
        lines.append(cells)
    runs = len(GAINS) * len(FORCES) * len(EULERS)
    lines.append(
        ["all", "", *(cell for one, all_ in whole.values() for cell in (f"{one} of {runs}", f"{all_} of {runs * STARTS}"))]
    )
    starts = f"{STARTS} starts"
    return table(["potential", "method", "printed", f"printed, {starts}", "limited", f"limited, {starts}"], lines)


# ---- sweeps


def sweeps() -> dict[str, ControlSweep]:
    """The charts, by the names of their files."""
    eight, kepler, document = sw.scenes.figure_eight(), sw.scenes.kepler(), sw.scenes.energy_control()
    period, year = eight.period, 2.0 * math.pi
    assert period is not None
    # Half a period more than ten: where the bodies are farthest and slowest, or the error would be that of one sharp turn.
    return {
        "figure-eight-10": sw.charts.control(
            eight, METHODS, horizon=10 * period, evaluations=10_000, title="Figure-eight, 10 periods"
        ),
        "figure-eight-100": sw.charts.control(
            eight, METHODS, horizon=100 * period, evaluations=100_000, title="Figure-eight, 100 periods"
        ),
        "kepler": sw.charts.control(
            kepler, METHODS, horizon=10.5 * year, evaluations=210_000, title="Kepler, e = 0.9, 10½ periods"
        ),
        "appendix-d": sw.charts.control(document, METHODS, horizon=1000.0, evaluations=100_000, title="Appendix D"),
    }


def ensemble() -> str:
    """Appendix D from many starts: how wrong the energy becomes, and how far bodies come, from the origin and from each other."""
    scene = sw.scenes.energy_control()
    kinds = [(kind, gain) for kind, gain in TABLED if kind != "printed" and gain != 100.0]
    controls = [(named(kind, gain), control_of(kind, gain)) for kind, gain in kinds]
    controls.insert(1, ("printed, C = 0.3", sw.EnergyControl(0.3, "printed")))
    lines = []
    for method, (name, control) in itertools.product(("standard_euler", "false_euler", "rk4"), controls):
        lines.append(many(scene, method, 0.01 * sw.method(method).evaluations, name, control))
    lines.append(many(scene, "rk4", 0.0005, "none, small steps", None))
    head = ["method", "h", "control", "finite", "max ΔE", "coordinate", "from the centre of mass", "centre of mass"]
    return table(head, lines)


def many(scene: sw.scenes.Scene, method: str, dt: float, name: str, control: Any) -> Line:
    """Medians of the runs from many starts."""
    shape = (*scene.v.shape, STARTS)
    v = np.broadcast_to(scene.v[..., np.newaxis], shape).copy()
    v[2, 0] += APART * np.arange(STARTS)
    y = np.broadcast_to(scene.y[..., np.newaxis], shape)
    steps = round(scene.horizon / dt)
    run = quiet(scene.system, method, v=v, y=y, dt=dt, steps=steps, every=steps // 1000, control=control)
    fine = run.first_bad_step < 0
    kept = run.y[..., fine]
    centre = kept.mean(axis=1, keepdims=True)
    off = np.abs(run.energy - run.energy[0]).max(axis=0)[fine]
    sizes = [off, *(np.abs(block).max(axis=(0, 1, 2)) for block in (kept, kept - centre, centre))]
    return [sw.method(method).title, dt, name, f"{fine.sum()} of {STARTS}", *(float(np.median(size)) for size in sizes)]


def orbits() -> str:
    """Whether what is seen on two orbits holds on others: state errors of the two methods of higher order."""
    turn = 2.0 * math.pi
    setups = [
        (f"Kepler, e = {e:g}", sw.scenes.kepler(e), 10.5 * turn, 210_000 if e > 0.8 else 21_000) for e in (0, 0.3, 0.6, 0.9)
    ]
    setups.append(("clover's circle, 1/r", sw.scenes.clover(), 15.0 * turn, 10_000))
    eight = sw.scenes.figure_eight()
    assert eight.period is not None
    setups.append(("figure-eight", eight, 10.0 * eight.period, 10_000))
    lines = []
    for name, scene, horizon, evaluations in setups:
        for method in ("standard_heun", "rk4"):
            chart = sw.charts.control(
                scene, [method], horizon=horizon, evaluations=evaluations, relative=[0.01, 1.0, 100.0], forms=["limited"]
            )
            errors = [chart.line(method, kind).state_error for kind in ("none", "limited", *sw.control.WAYS)]
            lines.append([sw.method(method).title, name, *np.concatenate(errors).tolist()])
    head = ["method", "orbit", "none", "limited, 0.01", "limited, 1", "limited, 100", "scaling", "nacozy"]
    return table(head, sorted(lines, key=lambda line: str(line[0]), reverse=True))


def orders() -> str:
    """What a fixed h·C·K costs: C then grows as the step falls. On Kepler's circle, from one number of steps to twice as many."""
    scene = sw.scenes.kepler(0.0)
    kinds: list[tuple[str, Any]] = [
        ("none", lambda: None),
        ("limited, C = 10", lambda: sw.EnergyControl(10.0)),
        ("limited, h·C·K = 0.1", lambda: sw.EnergyControl(relative=0.1)),
        ("limited, h·C·K = 10", lambda: sw.EnergyControl(relative=10.0)),
        ("scaling", lambda: sw.Projection("scaling")),
        ("nacozy", lambda: sw.Projection("nacozy")),
    ]
    lines = []
    for method, (name, make) in itertools.product(("standard_heun", "rk4"), kinds):
        errors = []
        for steps in (250, 500, 1000):
            dt = scene.horizon / steps
            run = sw.integrate(scene.system, method, v=scene.v, y=scene.y, dt=dt, steps=steps, control=make())
            errors.append(float(scene.state_error(run)[-1]))
        slopes = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
        lines.append([sw.method(method).title, name, *errors, *slopes])
    return table(["method", "control", "250 steps", "500", "1000", "order", "order"], lines)


# ---- what is wrong about a wrong state


def elements() -> str:
    """Kepler's ellipse after 10½ periods: size, shape, place and phase."""
    scene = sw.scenes.kepler()
    horizon = 21.0 * math.pi
    lines = []
    for method, control, run in ends(scene, horizon, 210_000):
        (r, u), (r0, u0) = ((y[1] - y[0], v[1] - v[0]) for y, v in ((run.y[-1], run.v[-1]), (scene.y, scene.v)))
        a, momentum, far, mean = ellipse(r, u)
        a0, momentum0, far0, _ = ellipse(r0, u0)
        phase = math.remainder(mean - horizon, 2 * math.pi)
        lines.append([method, control, a / a0 - 1, momentum / momentum0 - 1, far - far0, phase])
    return table(["method", "control, h·C·K", "semi-major axis", "angular momentum", "axis turned by, rad", "phase, rad"], lines)


def ellipse(r: np.ndarray, u: np.ndarray) -> tuple[float, float, float, float]:
    """Semi-major axis, angular momentum, direction of the perihelion, and mean anomaly, for μ = 1."""
    distance, square, out = math.hypot(*r), float(u @ u), float(r @ u)
    a = 1.0 / (2.0 / distance - square)
    e = (square - 1.0 / distance) * r - out * u
    angle = math.atan2(out / math.sqrt(a), 1.0 - distance / a) if a > 0 else math.nan
    return a, float(r[0] * u[1] - r[1] * u[0]), math.atan2(e[1], e[0]), angle - math.hypot(*e) * math.sin(angle)


def off_the_curve() -> str:
    """Figure-eight: how far from the curve the bodies are, wherever they are on it, and how far ahead."""
    scene = sw.scenes.figure_eight()
    period = scene.period
    assert period is not None
    assert scene.exact is not None
    t = np.linspace(0.0, period, 20_001)[:-1]
    v, y = scene.exact(t)
    lines = []
    for method, control, run in ends(scene, 100 * period, 100_000):
        scales = [np.sqrt((block * block).sum(axis=(1, 2))).max() for block in (v, y)]
        pairs = zip((run.v[-1], run.y[-1]), (v, y), scales, strict=True)
        away = np.maximum(*(np.sqrt(((end - true) ** 2).sum(axis=(1, 2))) / scale for end, true, scale in pairs))
        best = int(np.argmin(away))
        ahead = math.remainder(float(t[best]), period)
        momentum = float(np.sum(run.y[-1, :, 0] * run.v[-1, :, 1] - run.y[-1, :, 1] * run.v[-1, :, 0]))
        lines.append([method, control, float(away[0]), float(away[best]), ahead, momentum])
    return table(["method", "control, h·C·K", "state error", "off the curve", "ahead, units of time", "angular momentum"], lines)


def dips() -> str:
    """Whether the gain with the least state error is a property of the method or of the moment at which one looks."""
    scene = sw.scenes.figure_eight()
    period = scene.period
    assert period is not None
    gains = 10.0 ** np.linspace(-4, 2, 61)
    lines = []
    for periods, a_period in itertools.product((5, 10, 30, 100), (500, 1000, 2000)):
        chart = sw.charts.control(
            scene,
            ("false_euler", "standard_heun", "rk4"),
            horizon=periods * period,
            evaluations=periods * a_period,
            relative=gains,
            forms=["limited"],
            ways=["scaling"],
        )
        line: list[object] = [periods, a_period]
        for method in ("false_euler", "standard_heun", "rk4"):
            held = chart.line(method, "limited")
            i = int(np.nanargmin(held.state_error))
            ratios = [float(chart.line(method, "none").state_error[0] / x) for x in (held.state_error[i], held.state_error[-1])]
            scaled = float(chart.line(method, "none").state_error[0] / chart.line(method, "scaling").state_error[0])
            line += [f"{gains[i]:.1e}", *(f"{ratio:.3g}" for ratio in (*ratios, scaled))]
        lines.append(line)
    heads = [f"{short}: {what}" for short in ("FE", "SH", "RK4") for what in ("best gain", "÷ there", "÷ at 100", "÷ scaled")]
    return table(["periods", "evaluations a period", *heads], lines)


def main() -> None:
    """Run everything, write the report and the charts' data."""
    parser = argparse.ArgumentParser(prog="python -m benches.control_study", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=HERE / "CONTROL.md", help="the report")
    given = parser.parse_args()
    folder = given.output.parent / "control"
    folder.mkdir(exist_ok=True)
    charts = sweeps()
    for name, chart in charts.items():
        chart.to_csv(folder / f"{name}.csv")
    parts = [HEAD, "## The 36 runs of Appendix D's start", RUNS, thirty_six()]
    for chart in charts.values():
        dt = ", ".join(f"{m} {next(x.dt for x in chart.lines if x.method.name == m):.5g}" for m in METHODS)
        parts += [f"## {chart.title}", f"{chart.evaluations} rate evaluations each; h: {dt}."]
        parts += ["Energy error, the largest |E − E₀| / K₀:", tabled(chart, "energy_error")]
        parts += ["State error at the end:", tabled(chart, "state_error")] if chart.exact else []
        parts += ["Largest coordinate:", tabled(chart, "largest")] if not chart.exact else []
    parts += ["## Appendix D from many starts", MANY, ensemble()]
    parts += ["## Kepler's ellipse: what is wrong", elements()]
    parts += ["## Figure-eight after 100 periods: what is wrong", off_the_curve()]
    parts += ["## Other orbits", "State error at the end.", orbits()]
    parts += ["## A fixed h·C·K costs orders", ORDERS, orders()]
    parts += ["## Is there a best gain?", BEST, dips()]
    given.output.write_text("\n\n".join(part.strip() for part in parts if part) + "\n", encoding="utf-8")
    print(f"Written to {given.output}.")


if __name__ == "__main__":
    main()

"""The explorer's own arithmetic in Node: roots, limits, energies, exact solutions; each with mistakes that must be noticed."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.views.explorer import sliders
from stepwell.views.explorer.data import of_scene
from stepwell.views.explorer.page import IF_NAMED
from support.explored import data_of, in_node, needs_node, scene_of

pytestmark = needs_node


def test_eigenvalues_are_those_of_numpy(tmp_path: Path) -> None:
    """QR steps are backward stable: eigenvalues of a matrix that differs by some n·eps of its norm, times their condition."""
    rng = np.random.default_rng(5)
    matrices = [rng.normal(size=(n, n)) for n in (1, 2, 3, 5, 8, 12, 16) for _ in range(4)]
    matrices += [np.triu(matrices[-1]), np.roll(np.eye(6), 1, axis=0), np.diag([1.0, 2.0, 3.0]), np.zeros((4, 4))]
    results = in_node("told = given.map((each) => roots.eigenvalues(each));", tmp_path, [each.tolist() for each in matrices])
    for matrix, got in zip(matrices, results, strict=True):
        values, vectors = np.linalg.eig(matrix)
        computed = np.array([z["re"] + 1j * z["im"] for z in got])
        assert len(computed) == len(matrix)
        error = 64 * len(matrix) * np.finfo(float).eps * np.linalg.norm(matrix) * np.linalg.cond(vectors)
        for z in computed:  # each is nearest to another
            nearest = np.abs(values - z).argmin()
            assert np.abs(values[nearest] - z) <= error
            values = np.delete(values, nearest)


ROOTS = """
told = given.map(([name, key, dt, values, steps]) => new Trajectory(scene(name), key, dt, values).steps(steps).roots());
"""


def nearest(roots: list[dict[str, float]], wanted: Any) -> float:
    """The largest distance of two sets of roots, each taken with its nearest."""
    left, most = list(wanted), 0.0
    assert len(roots) == len(left)
    for z in roots:
        i = int(np.abs(np.array(left) - (z["re"] + 1j * z["im"])).argmin())
        most = max(most, abs(left.pop(i) - (z["re"] + 1j * z["im"])))
    return most


def test_roots_of_linear_scenes_are_those_of_analyse(tmp_path: Path) -> None:
    """Columns of P are steps of unit vectors, right to some roundings; a double root moves by the square root of these."""
    oscillators = [("oscillator", m.name, dt, {}, 3) for m in sw.methods() if m.name not in IF_NAMED for dt in (0.3, 1.9, 3.0)]
    damped = [
        ("forced_oscillator", key, 0.5, {"damping": 0.4}, 3) for key in data_of("forced_oscillator")["steps"] if key != "truth"
    ]
    chains = [("chain", key, 0.3, {}, 2) for key in ("false_euler", "rk4", "verlet", "standard_heun", "pefrl")]
    every = oscillators + damped + chains
    results = in_node(ROOTS, tmp_path, every)
    systems = {"oscillator": sw.Oscillator(), "forced_oscillator": sw.Oscillator(1.0, 0.4, form="physical"), "chain": sw.Chain(8)}
    for (name, key, dt, _, _), got in zip(every, results, strict=True):
        wanted = sw.analyse(systems[name], key, dt=dt).eigenvalues
        size = max(1.0, float(np.abs(wanted).max()))
        assert nearest(got, wanted) < 2e-7 * size, (name, key, dt)
        if name != "chain" and min(abs(np.subtract.outer(wanted, wanted))[0, 1:]) > 0.1:
            assert nearest(got, wanted) < 1e-13 * size, (name, key, dt)


def test_roots_at_a_state_are_those_of_analyse(tmp_path: Path) -> None:
    """Central differences by 6e-6 of the size: the third derivative's part and rounding are some 1e-10 of a derivative."""
    # The roots of the clover come in multiples, which an error e moves by its square root, here 1e-5.
    every = [("pendulum", key, 0.3, {"start": 1.0}, 0) for key in ("false_euler", "rk4", "standard_heun")]
    every += [("clover", key, 0.1, {}, 0) for key in ("false_euler", "rk4")]
    results = in_node(ROOTS, tmp_path, every)
    for (name, key, dt, _, _), got in zip(every, results, strict=True):
        scene = scene_of(name)
        wanted = sw.analyse(scene.system, key, dt=dt, at=(scene.v, 1.0 if name == "pendulum" else scene.y)).eigenvalues
        assert nearest(got, wanted) < (1e-9 if name == "pendulum" else 1e-4), (name, key)


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("module", "right", "mistake"), [("roots", "larger === 0 ? 0 : q / larger", "p + larger"), ("roots", "(a + d) / 2", "a + d")]
)
def test_wrong_roots_are_noticed(module: str, right: str, mistake: str, tmp_path: Path) -> None:
    every = [("oscillator", "false_euler", 3.0, {}, 3)]
    (got,) = in_node(ROOTS, tmp_path, every, (module, right, mistake))
    assert nearest(got, sw.analyse(sw.Oscillator(), "false_euler", dt=3.0).eigenvalues) > 1e-3


def test_limits_are_those_of_stability_limit(tmp_path: Path) -> None:
    """By a method's own limit and the fastest mode; with damping by bisection, to some roundings of p and q over their slope."""
    cases = {
        "oscillator": ({"omega": 2.5}, sw.Oscillator(2.5)),
        "chain": ({"stiffness": 3.0, "mass": 0.5}, sw.Chain(8, stiffness=3.0, mass=0.5)),
        "forced_oscillator": ({"omega": 2.0, "damping": 0.3}, sw.Oscillator(2.0, 0.3, form="physical")),
    }
    keys = ["standard_euler", "false_euler", "rk4", "merson"]
    every = [(name, key, values, system) for name, (values, system) in cases.items() for key in keys]
    results = in_node(
        """
told = given.map(([name, key, values, limit]) => {
  const run = new Trajectory(scene(name), key, scene(name).dt, values);
  return limitOf(scene(name), { name: key, limit }, values, run.m);
});
""",
        tmp_path,
        [[name, key, values, sw.method(key).limit] for name, key, values, _ in every],
    )
    for (name, key, _, system), got in zip(every, results, strict=True):
        assert got == pytest.approx(float(sw.stability_limit(system, key)), rel=1e-9), (name, key)


ENERGY = "told = given.map(([name, v, y]) => ENERGIES[scene(name).energy.kind](scene(name).energy, v, y));"


def energies(folder: Path, change: Any = None) -> list[tuple[str, float, float]]:
    """For each scene at random states the energy in the page and in Python."""
    rng = np.random.default_rng(9)
    every = []
    for name in sliders.OFFERS:
        scene = scene_of(name)
        if data_of(name)["energy"] is None:
            assert name in ("van_der_pol", "rober")  # equations without a formula for it
            continue
        for _ in range(3):
            every.append((name, rng.normal(size=scene.system.v_shape), rng.normal(size=scene.system.y_shape)))
    got = in_node(ENERGY, folder, [[name, np.ravel(v).tolist(), np.ravel(y).tolist()] for name, v, y in every], change)
    return [(name, x, float(scene_of(name).system.energy(v, y))) for (name, v, y), x in zip(every, got, strict=True)]


def test_energies_are_those_of_the_systems(tmp_path: Path) -> None:
    """Sums of fewer than a hundred products that differ in their order only: a hundred roundings of terms of some size 100."""
    for name, got, wanted in energies(tmp_path):
        assert got == pytest.approx(wanted, rel=1e-13, abs=100 * 100 * 2.0**-53), name


#: Scenes that are no built-in ones, sliders of their steps' parameters, and the same system with these.
SLID: list[tuple[sw.Scene, dict[str, float], sw.System]] = [
    (sw.scenes.kepler(e=0.5), {"Gm_0": 0.75, "softening": 0.5}, sw.NBody([0.75, 0.5], force="newton", softening=0.5)),
    (sw.Scene(sw.NBody([1.0, 2.0], force="newton", G=4.0), v=0.0, y=[[0.0, 1.0], [1.0, 0.0]], horizon=1.0), {"Gm_1": 12.0},
     sw.NBody([1.0, 3.0], force="newton", G=4.0)),
    (
        sw.scenes.triple_pendulum(),
        {"masses_2": 2.0, "gravity": 0.5},
        sw.Rods([1.0, 1.0, 2.0], sw.scenes.triple_pendulum().system.rods, 1.0, gravity=0.5),  # type: ignore[attr-defined]
    ),
    (sw.Scene(sw.Oscillator(2.0), v=0.0, y=1.0, horizon=9.0), {"omega": 3.0}, sw.Oscillator(3.0)),
    (sw.Scene(sw.Oscillator(2.0, 0.1, form="physical"), v=0.0, y=1.0, horizon=9.0), {"omega": 3.0, "damping": 0.2},
     sw.Oscillator(3.0, 0.2, form="physical")),
    (
        sw.Scene(
            sw.Springs([(0, 1), (1, 2)], stiffness=9.0, rest=1.0, masses=2.0, fixed=[0], gravity=(0.0, -9.81)),
            v=0.0,
            y=[[0.0, 1.0], [1.0, 0.0], [2.0, 0.5]],
            horizon=1.0,
        ),
        {"stiffness": 4.0, "masses": 3.0, "gravity_1": -2.0},
        sw.Springs([(0, 1), (1, 2)], stiffness=4.0, rest=1.0, masses=3.0, fixed=[0], gravity=(0.0, -2.0)),
    ),
    (sw.Scene(sw.Chain(8), v=0.0, y=np.arange(8.0), horizon=9.0), {"stiffness": 2.0, "mass": 0.5},
     sw.Chain(8, stiffness=2.0, mass=0.5)),
    (sw.scenes.symmetric_top(), {"inertia_0": 1.5}, None),
]  # fmt: skip


@pytest.mark.parametrize("forgotten", [pytest.param(False, id="as they are"), pytest.param(True, id="a mistake")])
def test_sliders_of_any_step_move_its_energy_too(forgotten: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sums of a few products. With links forgotten, the mistake, no energy is right but that of a canonical form."""
    if forgotten:
        monkeypatch.setattr(sliders, "_links", lambda system: {})
    rng = np.random.default_rng(4)
    cases, wanted = [], []
    for scene, values, system in SLID:
        data = of_scene(scene, [sw.method("rk4"), sw.method("standard_euler")])
        assert set(values) <= {slider["name"] for slider in data["sliders"]}
        if system is None:
            inertia = np.array(data["energy"]["inertia"])
            inertia[0] = values["inertia_0"]
            system = sw.RigidBody(inertia)
        v, y = rng.normal(size=scene.v.shape), rng.normal(size=scene.y.shape)
        cases.append([data, values, np.ravel(v).tolist(), np.ravel(y).tolist()])
        wanted.append(float(system.for_state_shapes(v, y).energy(v, y)))
    results = in_node(
        """
told = given.map(([scene, values, v, y]) => ENERGIES[scene.energy.kind](settings(scene, values, {}).e, v, y));
""",
        tmp_path,
        cases,
    )
    right = [got == pytest.approx(want, rel=1e-12) for got, want in zip(results, wanted, strict=True)]
    canonical = [isinstance(system, sw.Oscillator) and system.form == "canonical" for _, _, system in SLID]
    assert right == (canonical if forgotten else [True] * len(SLID))


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("right", "mistake", "scenes"),
    [
        ("0.5 * Math.log(square)", "Math.log(square)", {"clover", "energy_control"}),
        ("const stretch = Math.sqrt(square) - p.rest[k];", "const stretch = Math.sqrt(square);", {"rope"}),
        ("p.gravity[i % dim] * y[i]", "p.gravity[0] * y[i]", {"bouncing_ball", "rope", "double_pendulum", "conical_pendulum"}),
        ("a * a + d * d - b * b - c * c", "a * a + d * d - b * b", {"heavy_top"}),
    ],
)
def test_wrong_energies_are_noticed(right: str, mistake: str, scenes: set[str], tmp_path: Path) -> None:
    results = energies(tmp_path, ("energies", right, mistake))
    assert {name for name, got, wanted in results if got != pytest.approx(wanted, rel=1e-9)} == scenes


TRUTH = """
told = given.map(([name, values, times]) => {
  const set = settings(scene(name), values, new Trajectory(scene(name), "truth", 0.1, values).m);
  return times.map((t) => { const { v, y } = TRUTHS[scene(name).truth](t, set); return [...v, ...y]; });
});
"""

FORMULAS: list[tuple[str, dict[str, float], Any]] = [
    ("oscillator", {"omega": 2.0}, lambda: sw.scenes.scene("oscillator:omega=2.0")),
    ("forced_oscillator", {}, lambda: scene_of("forced_oscillator")),
    ("forced_oscillator", {"omega": 2.0, "damping": 0.4, "amplitude": 0.5, "drive": 1.1},
     lambda: sw.scenes.scene("forced_oscillator:omega=2.0,damping=0.4,amplitude=0.5,drive=1.1")),
    ("bouncing_ball", {}, lambda: scene_of("bouncing_ball")),
    ("sliding_block", {"friction": 2.0, "start": 4.0}, lambda: sw.scenes.scene("sliding_block:friction=2.0,speed=4.0")),
    ("sticking_block", {}, lambda: scene_of("sticking_block")),
    ("sticking_block", {"friction": 0.31}, lambda: sw.scenes.scene("sticking_block:friction=0.31")),
]  # fmt: skip


def truths(folder: Path, change: Any = None) -> dict[str, float]:
    """The largest difference between the page's exact solution and the scene's, by scene."""
    times = [np.linspace(0.0, make().horizon, 200) for _, _, make in FORMULAS]
    results = in_node(
        TRUTH, folder, [[name, values, t.tolist()] for (name, values, _), t in zip(FORMULAS, times, strict=True)], change
    )
    most: dict[str, float] = {}
    for (name, _, make), t, got in zip(FORMULAS, times, results, strict=True):
        v, y = make().exact(t)
        wanted = np.concatenate([v.reshape(len(t), -1), y.reshape(len(t), -1)], axis=1)
        most[name] = max(most.get(name, 0.0), float(np.abs(np.array(got) - wanted).max()))
    return most


def test_formulas_of_the_motion_are_those_of_the_scenes(tmp_path: Path) -> None:
    """Values of some 5 at times of some 60: a rounding of the time alone is worth 60·5·2⁻⁵³, and there are some dozens."""
    most = truths(tmp_path)
    assert set(most) == {name for name, offer in sliders.OFFERS.items() if offer.truth}
    assert max(most.values()) < 50 * 60 * 5 * 2.0**-53


@pytest.mark.mutant
@pytest.mark.parametrize(
    ("right", "mistake", "scene"),
    [
        ("(v0 + d * w * y0) / free", "v0 / free", "forced_oscillator"),
        ("const rest = swing < last ? friction", "const rest = swing < last ? 0", "sticking_block"),
        ("let up = e * g * fall;", "let up = g * fall;", "bouncing_ball"),
        ("0.5 * friction * moving", "friction * moving", "sliding_block"),
    ],
)
def test_wrong_formulas_are_noticed(right: str, mistake: str, scene: str, tmp_path: Path) -> None:
    most = truths(tmp_path, ("truths", right, mistake))
    assert {name for name, error in most.items() if error > 1e-3} == {scene}


def test_a_run_with_small_steps_is_the_truth(tmp_path: Path) -> None:
    """Where there is an exact solution the page's own is as near as it claims; in chaos it says until when it is known."""
    # The two runs agree to 1e-6 in the scene's scales, so the finer one, of order 8, is nearer than that.
    names = ["clover", "kepler", "chain", "pendulum", "conical_pendulum", "dzhanibekov", "figure_eight", "arenstorf"]
    results = in_node(
        """
told = given.map((name) => {
  const it = scene(name);
  const truth = new Truth(it, it.dt, {}, new Trajectory(it, "rk4", it.dt, {}).set);
  const steps = Math.min(Math.floor(it.horizon / it.dt), 2000);
  const { v, y } = truth.go(steps);
  return [steps, [...v], [...y], truth.until];
});
""",
        tmp_path,
        names,
    )
    for name, (steps, v, y, until) in zip(names, results, strict=True):
        scene = scene_of(name)
        assert until is None, name  # JSON has no infinity
        assert scene.exact is not None
        true = [np.ravel(block) for block in scene.exact(np.array([steps * scene.dt]))]
        apart = max(np.linalg.norm(a - b) / s for a, b, s in zip((v, y), true, data_of(name)["scales"], strict=True))
        assert apart < 1e-6, (name, apart)


def test_the_true_motion_is_known_for_a_time_only_in_chaos(tmp_path: Path) -> None:
    """Two runs of the double pendulum with other steps part; the errors that are shown end there."""
    untils = in_node(
        """
const it = scene("double_pendulum");
const race = new Race(it, ["false_euler", "rk4"], it.dt, {}, 5);
race.advance(20000, Infinity);
told = [race.truth.until, race.errors[1].filter((x) => x === null || Number.isNaN(x)).length, race.errors[1].length];
""",
        tmp_path,
    )
    until, unknown, samples = untils
    assert 20.0 < until < 200.0
    assert unknown > 0.3 * samples

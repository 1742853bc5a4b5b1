"""Scenes: their exact solutions are exact, and their errors are what they say."""

import copy
import dataclasses
from pathlib import Path

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, NotFiniteError, UnknownNameError
from stepwell.scenes import builtin

SCENES = sw.scenes.scenes()

#: Other members of the same families: all that can be varied is varied.
VARIED = (
    sw.scenes.oscillator(omega=7.0),
    sw.scenes.forced_oscillator(omega=3.0, damping=0.4, amplitude=-2.0, drive=3.0, phase=-1.0),
    sw.scenes.forced_oscillator(damping=0.999, drive=0.01),
    sw.scenes.chain(1),
    sw.scenes.chain(5, {1: 0.3, 3: -1.0, 4: 0.2}),
)

every_scene = pytest.mark.parametrize("scene", SCENES, ids=lambda s: s.name)
every_member = pytest.mark.parametrize("scene", [*SCENES, *VARIED], ids=repr)


def test_the_scenes_are_the_files_in_the_folder():
    files = {path.stem for path in Path(builtin.__file__).parent.glob("*.py")} - {"__init__"}
    assert {scene.name for scene in SCENES} == files
    assert files <= set(dir(sw.scenes))


@every_scene
def test_a_scene_is_found_by_its_name(scene):
    found = sw.scenes.scene(scene.name)
    assert (found.name, repr(found)) == (scene.name, repr(scene))
    assert repr(getattr(sw.scenes, scene.name)()) == repr(scene)
    assert sw.scenes.scene(scene) is scene


def test_an_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(UnknownNameError, match=r"scene: there is no 'clovr'; did you mean 'clover'\?"):
        sw.scenes.scene("clovr")
    with pytest.raises(AttributeError, match="clovr"):
        sw.scenes.clovr  # noqa: B018


@every_scene
def test_a_scene_says_what_it_is(scene):
    for text in (scene.title, scene.section, scene.description, scene.error):
        assert text == text.strip() != ""
    assert scene.description.endswith(".")


@every_member
def test_the_exact_solution_begins_at_the_start(scene):
    v, y = scene.exact(np.zeros(1))
    assert v.shape == (1, *scene.system.v_shape)
    assert y.shape == (1, *scene.system.y_shape)
    np.testing.assert_allclose(v[0], scene.v, rtol=0, atol=1e-14 * scene.scales[0])
    np.testing.assert_allclose(y[0], scene.y, rtol=0, atol=1e-14 * scene.scales[1])


@every_member
def test_the_exact_solution_satisfies_the_equations_of_motion(scene):
    """Central differences: wrong by e²/6 of the third derivative, 1e-8 of the rates for e = 2e-4 periods, and rounding."""
    rates = scene.system.scaled(1.0, ())
    e = 2e-4 * scene.dt
    for t in scene.horizon * np.linspace(0.0, 1.0, 23):
        (v0, v, v1), (y0, y, y1) = scene.exact(np.array([t - e, t, t + e]))
        for wanted, found, scale in (
            (rates.dv(t, v, y), (v1 - v0) / (2 * e), scene.scales[0]),
            (rates.dy(t, v, y), (y1 - y0) / (2 * e), scene.scales[1]),
        ):
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8 * scale / scene.dt)


@every_member
def test_rk4_converges_to_the_exact_solution(scene):
    """Half the step, a sixteenth of the error, give or take the next order; a wrong exact solution would let it stay."""
    coarse, fine = (scene.state_error(scene.run("rk4", scene.dt / n, every=1)).max() for n in (30, 60))
    assert coarse / fine == pytest.approx(16, rel=0.1)
    assert fine < 1e-6


def test_the_error_of_rk4_on_the_oscillator_is_the_known_one():
    """Its angle lags by Φ⁵/120 a step (FACTS §1), which is Φ⁴/120 per unit of angle; Φ⁶/144 of amplitude is far less."""
    scene, phi = sw.scenes.oscillator(), 0.02
    run = scene.run("rk4", phi, every=1)
    assert scene.state_error(run).max() == pytest.approx(phi**4 / 120 * run.t[-1], rel=1e-2)


def test_the_errors_of_one_step_are_those_by_hand():
    """Standard Euler from (0, 1): v = −Φ, y = 1, where −sin Φ and cos Φ are right; the energy has grown by Φ² of itself."""
    scene, phi = sw.scenes.oscillator(), 0.5
    run = scene.run("standard_euler", phi, steps=1, every=1)
    assert scene.state_error(run).tolist() == [0.0, pytest.approx(1 - np.cos(phi))]
    assert scene.energy_error(run).tolist() == [0.0, pytest.approx(phi**2)]
    assert scene.amplitude(run).tolist() == [1.0, 1.0]


def test_a_body_on_the_wrong_place_of_the_circle_is_wrong_by_the_chord():
    """Started 0.1 later, everything is an angle of 0.1 behind: a chord of 2·sin(0.05), and the energy is right."""
    scene = sw.scenes.clover()
    run = scene.run("rk4", 0.001, steps=1, every=1, t0=0.1)
    assert scene.state_error(run) == pytest.approx(2 * np.sin(0.05), rel=1e-9)
    assert scene.energy_error(run).max() < 1e-12


def test_a_block_counts_by_its_own_size():
    """In physical form v is ω₀ times y; an error of one per cent of either is one per cent."""
    scene = sw.scenes.forced_oscillator(omega=50.0, drive=20.0)
    big, small = scene.scales
    assert big > 10 * small
    run = scene.run("rk4", 1e-5, steps=1)
    wrong_v = copy.copy(run)
    wrong_v.v = run.v + 0.01 * big
    wrong_y = copy.copy(run)
    wrong_y.y = run.y + 0.01 * small
    for wrong in (wrong_v, wrong_y):
        assert scene.state_error(wrong) == pytest.approx(0.01, rel=1e-3)


def test_what_is_not_finite_is_infinitely_wrong():
    scene = sw.scenes.oscillator()
    with pytest.warns(sw.DivergenceWarning):
        run = scene.run("standard_euler", 100.0, steps=400, every=1)
    assert np.isinf(scene.state_error(run)[-1])
    assert np.isinf(scene.energy_error(run)[-1])


@every_scene
def test_a_run_reaches_the_horizon_and_not_a_step_more(scene):
    for dt in (scene.dt, scene.horizon / 7, 0.37 * scene.dt):
        t = scene.run("false_euler", dt).t[-1]
        assert -1e-9 * dt <= t - scene.horizon < dt
    assert [scene.steps_for(scene.horizon / n) for n in range(1, 2000)] == list(range(1, 2000))
    assert scene.steps_for(10 * scene.horizon) == 1


def test_the_clover_leaf_of_the_document_stays_a_clover_leaf():
    """FACTS §3: 100 steps of 0.3 are drawn, and within [0.914, 1.127] the radius stays for 100 000 of them."""
    scene = sw.scenes.clover()
    assert len(scene.run("false_euler", every=1).t) == 101
    radius = np.hypot(*np.moveaxis(scene.run("false_euler", steps=100_000, every=1).y, -1, 0))
    assert 0.914 <= radius.min() < 0.915
    assert 1.126 < radius.max() <= 1.127


def test_the_fast_mode_of_the_chain_limits_the_step():
    """False Euler's limit, ω·dt < 2, holds for the fastest mode, whose ω is 2·sin(½π·8/9)."""
    scene = sw.scenes.chain()
    limit = 1 / np.sin(0.5 * np.pi * 8 / 9)
    assert scene.amplitude(scene.run("false_euler", 0.98 * limit, every=1)).max() < 2
    assert scene.amplitude(scene.run("false_euler", 1.02 * limit, every=1)).max() > 100


def test_a_scene_without_an_exact_solution_runs_but_has_no_errors():
    scene = dataclasses.replace(sw.scenes.clover(), exact=None)
    run = scene.run("rk4")
    for error in (scene.state_error, scene.energy_error):
        with pytest.raises(ArgumentError, match="clover has no exact solution"):
            error(run)


def test_options_go_to_integrate():
    scene = sw.scenes.oscillator()
    assert scene.run("verlet", start="first_order").start == "first_order"
    assert np.array_equal(scene.run("rk4", backend="numpy").y, scene.run("rk4").y)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sw.scenes.oscillator(omega=0.0), "omega: expected numbers above zero"),
        (lambda: sw.scenes.forced_oscillator(damping=1.0), "damping: expected a ratio below 1"),
        (lambda: sw.scenes.forced_oscillator(damping=0.0), "damping: expected numbers above zero"),
        (lambda: sw.scenes.forced_oscillator(drive=-1.0), "drive: expected numbers above zero"),
        (lambda: sw.scenes.chain(0), "n: expected 1 or more"),
        (lambda: sw.scenes.chain(3, {4: 1.0}), "modes: expected 1 or more, up to 3, got 4"),
        (lambda: sw.scenes.chain(3, {}), "modes: expected the amplitude of at least one mode"),
        (lambda: sw.scenes.clover().run("rk4", 5e-324), "dt: 4.94066e-324 needs more than"),
        (lambda: sw.scenes.clover().run("rk4", -0.3), "dt: expected numbers above zero"),
    ],
)
def test_what_cannot_be_is_refused(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
    with pytest.raises(NotFiniteError, match="dt"):
        sw.scenes.clover().run("rk4", float("nan"))

"""What the explorer's page shows at first sight: findings that are true, red where it is meant, texts that can be read."""

import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.scenes.truth import with_truth
from stepwell.views.explorer import sliders
from stepwell.views.explorer.data import of_scene
from support.browser import needs_browser
from support.explored import data_of, in_node, needs_node, page, scene_of, the_file  # noqa: F401
from support.families import family

#: Scenes of whose motion or steps there is most to do: by far the longest texts, several bodies, a rope of many points.
HEAVIEST = ("rope", "energy_control", "figure_eight", "pythagorean", "clover")


@cache
def runs(name: str, seconds: float = 15.0) -> tuple[sw.Run, sw.Run, Any, Any]:
    """The two runs with which the page of a scene begins, over the first seconds that people see, and their errors."""
    data = data_of(name)
    scene = with_truth(scene_of(name)) if scene_of(name).exact is None and name != "rope" else scene_of(name)
    steps = int(min(seconds * data["rate"], scene.until) / data["step"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        recorded = {"record": "energy"} if data["energy"] else {}
        a, b = (scene.run(key, dt=data["step"], steps=steps, every=1, **recorded) for key in data["pair"])
        errors = [scene.state_error(each) if scene.exact is not None else np.full(len(each.t), np.nan) for each in (a, b)]
    return a, b, errors[0], errors[1]


def gained(run: Any) -> float:
    """The largest energy, relative to the first."""
    return float(np.nanmax(run.energy) / run.energy[0])


def lost_for_good(run: Any, period: float) -> float:
    """What the energy far from close passes changes by from one turn to the next."""
    far = [int(np.searchsorted(run.t, (n + 0.5) * period)) for n in range(int(run.t[-1] / period))]
    return float(run.energy[far[-1]] / run.energy[far[0]] - 1.0)


def radius(run: Any) -> Any:
    """The distances from the origin, a row for each saved state."""
    return np.linalg.norm(run.y, axis=-1).reshape(len(run.t), -1)


def _clover(a: Any, b: Any, off: Any, near: Any) -> bool:
    return bool(np.ptp(radius(a)[:30]) > 0.2 and np.ptp(radius(b)[:30]) < 0.02)


def _kepler(a: Any, b: Any, off: Any, near: Any) -> bool:
    period = scene_of("kepler").period
    return abs(lost_for_good(a, period)) > 5 * abs(lost_for_good(b, period)) and near.max() > 0.5


def _energy_control(a: Any, b: Any, off: Any, near: Any) -> bool:
    scene = scene_of("energy_control")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a near encounter
        free = sw.integrate(scene.system, "standard_euler", v=scene.v, y=scene.y, dt=scene.dt, steps=len(a.t) - 1, every=1)
    return bool(radius(a).max() < 2.5 and radius(b).max() < 3.5 and radius(free).max() > 4.0)


def _rope(a: Any, b: Any, off: Any, near: Any) -> bool:
    return bool(np.abs(a.energy).max() > 5 * np.abs(b.energy).max() and b.energy[-1] < b.energy[0] - 1.0)


#: What a finding says, as a condition on the two runs and their errors.
FINDINGS: dict[str, Callable[[Any, Any, Any, Any], bool]] = {
    "clover": _clover,
    "oscillator": lambda a, b, off, near: a.energy[1] / a.energy[0] == pytest.approx(1.09) and near.max() < 1 < off.max(),
    "forced_oscillator": lambda a, b, off, near: gained(a) > 5 * gained(b),
    "pendulum": lambda a, b, off, near: np.abs(a.y).max() > np.pi > 2 > np.abs(b.y).max(),
    "chain": lambda a, b, off, near: gained(a) > 10 and gained(b) < 1.1,
    "energy_control": _energy_control,
    "kepler": _kepler,
    "figure_eight": lambda a, b, off, near: off[200] > 0.5 and near.max() < 0.05,
    "pythagorean": lambda a, b, off, near: off[2500] > 30 * near[2500] and off[1700] < 0.01,
    "arenstorf": lambda a, b, off, near: off.max() > 0.5 and near.max() < 0.01,
    "double_pendulum": lambda a, b, off, near: a.energy[400] < 0.9 * a.energy[0] and near[1000] < 0.01,
    "conical_pendulum": lambda a, b, off, near: 0.64 < radius(a)[-1] < 0.67 and np.ptp(radius(b)) < 1e-3,
    "rope": _rope,
    "bouncing_ball": lambda a, b, off, near: np.median(off) > 10 * np.median(near),
    "sliding_block": lambda a, b, off, near: 0.07 < off[-1] < 0.09 and near[-1] < 0.005,
    "sticking_block": lambda a, b, off, near: np.ptp(a.y[-40:]) > 0.05 and np.ptp(b.y[-40:]) == 0 and near[-1] < 0.01,
    "dzhanibekov": lambda a, b, off, near: gained(a) > 1.05 and off.max() > 0.5 and near.max() < 1e-4,
    "van_der_pol": lambda a, b, off, near: a.first_bad_step == 29 and np.median(near) < 1e-2,
    "rober": lambda a, b, off, near: a.first_bad_step == 10 and near[-1] < 1e-6,
    "heavy_top": lambda a, b, off, near: off.max() > 1.0 and near.max() < 1e-4,
}


def test_what_a_scene_says_at_first_is_true() -> None:
    wrong = [name for name, holds in FINDINGS.items() if not (data_of(name)["finding"] and holds(*runs(name)))]
    assert not wrong
    assert set(FINDINGS) == set(sliders.OFFERS)
    for data in page().data["scenes"]:
        assert set(data["pair"]) <= set(data["steps"]), data["name"]
        assert len({sw.method(key).title for key in data["pair"]}) == 2
        for key in data["pair"]:
            names = {sw.method(key).title.split()[0], key.upper()}
            assert any(name in data["finding"] for name in names), (data["name"], key)
    assert [data_of(name)["truth_by"] for name in ("van_der_pol", "rober", "clover")] == ["rodas5p", "rodas4", "dop853"]
    own = of_scene(sw.scenes.oregonator(), sw.methods())
    assert own["truth_by"] in ("rodas4", "rodas5p")
    assert own["pair"] == ("rk4", "rosenbrock23")
    assert own["ranges"]["y"][1][1] < 1e4  # of a run that follows it, not of one that blows up


@needs_node
def test_the_truth_of_stiff_scenes_is_that_of_charts(tmp_path: Path) -> None:
    """The page's claim is a millionth; the reference of charts is right to 1e-8."""
    results = in_node(
        """
told = given.map(([name, steps]) => {
  const it = scene(name);
  const truth = new Truth(it, it.step, {}, new Trajectory(it, it.pair[1], it.step, {}).set);
  const { v, y } = truth.go(steps);
  return [[...v, ...y], truth.gap];
});
""",
        tmp_path,
        [["rober", 5000], ["van_der_pol", 7000]],
    )
    for name, (got, gap), steps in zip(("rober", "van_der_pol"), results, (5000, 7000), strict=True):
        scene = with_truth(scene_of(name))
        assert scene.exact is not None
        true = np.concatenate([np.ravel(block) for block in scene.exact(np.array([steps * data_of(name)["step"]]))])
        scale = max(data_of(name)["scales"])
        assert np.abs(np.array(got) - true).max() < 1e-6 * scale
        assert gap < 1e-6


@needs_node
def test_the_ellipse_on_which_a_method_stays(tmp_path: Path) -> None:
    """Of v² + b·v·y + c·y²: b = −Φ and c = 1 by False Euler, c = 1 − Φ²/4 by Leapfrog; a circle by implicit midpoint."""
    keys = ["false_euler", "damped_euler", "leapfrog", "implicit_midpoint", "rk4", "standard_euler", "dop853"]
    cases = [["oscillator", key, dt] for key in keys for dt in (0.003, 0.3, 1.0)] + [["forced_oscillator", "false_euler", 0.3]]
    results = in_node(
        """
told = given.map(([name, key, dt]) => {
  const found = conserved(scene(name), key, dt, {});
  const at = ([v, y]) => found[0] * v * v + found[1] * v * y + found[2] * y * y;
  return found && [found, equationOf(found), around(found).map(at)];
});
""",
        tmp_path,
        cases,
    )
    wanted = {
        "false_euler": lambda x: (-x, 1.0),
        "damped_euler": lambda x: (x, 1.0),
        "leapfrog": lambda x: (0.0, 1.0 - x * x / 4),
        "implicit_midpoint": lambda x: (0.0, 1.0),
    }
    for (name, key, dt), got in zip(cases, results, strict=True):
        if name != "oscillator" or key not in wanted:
            assert got is None, (name, key, dt)
            continue
        (a, b, c), _, on = got
        assert (b / a, c / a) == pytest.approx(wanted[key](dt), abs=1e-9 / dt)
        assert on == pytest.approx(np.ones(len(on)), abs=1e-12)
    assert results[1][1] == "v² − 0.3·v·y + y² = 1"


@needs_node
def test_a_root_is_red_only_where_the_method_is_unstable(tmp_path: Path) -> None:
    """Not where the true motion grows itself, and not at a state of a motion that is not linear."""
    z, big = {"re": 1.0, "im": 0.0}, {"re": 1.3, "im": 0.2}
    cases = [[[big], [z], True], [[z], [z], True], [[big], [big], True], [[big], [z], False], [[big], [], True]]
    results = in_node(
        """
told = given.map(([roots, trueRoots, linear]) => {
  const used = [];
  const pen = new Proxy({}, { get: () => () => {}, set: (_, name, value) => used.push([name, value]) });
  drawRoots({ pen, width: 100, height: 100 }, roots, trueRoots, linear, { bad: "red", colour: "own", truth: "grey" });
  return used.some(([name, value]) => name === "strokeStyle" && value === "red");
});
""",
        tmp_path,
        cases,
    )
    assert results == [True, False, False, False, True]


@pytest.fixture
def shown(browser: Any) -> Any:
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    web = context.new_page()
    web.set_default_timeout(20_000)
    yield web
    context.close()


def opened(web: Any, file: str, words: str) -> None:
    web.goto("about:blank")
    web.goto(file + words)
    web.evaluate("explorer.page.ready")


def top(web: Any, name: str) -> float:
    return float(web.locator(name).bounding_box()["y"])


@needs_browser
def test_the_first_screen_says_what_is_seen(shown: Any, file: str) -> None:
    """One sentence with the ring, the finding, errors in large numbers, and both curves, without scrolling."""
    opened(shown, file, "#scene=oscillator&at=20&play=0")
    sentence = shown.locator(".key-line")
    assert " ".join(sentence.inner_text().split()) == "Same equation, same step, two methods. The grey ring is the truth."
    assert sentence.locator(".ring").bounding_box()["width"] >= 12
    assert shown.locator("#finding").inner_text() == data_of("oscillator")["finding"]
    for lane, i in (("a", 0), ("b", 1)):
        error = shown.evaluate(f"explorer.page.race.errors[{i}].at(-1)")
        assert float(shown.locator(f"#error-{lane}").inner_text()) == pytest.approx(error, rel=0.05)
        assert shown.evaluate(f"parseFloat(getComputedStyle(document.getElementById('error-{lane}')).fontSize)") >= 24
    for name in ("#energy", "#error"):
        box = shown.locator(name).bounding_box()
        assert box["y"] + box["height"] <= 800
        assert box["y"] < top(shown, "#roots-a")
    shown.locator("#dt").focus()
    shown.keyboard.press("ArrowRight")
    assert shown.locator("#finding").inner_text() == "", "it is true with the scene's own step"


@needs_browser
def test_a_scene_brings_its_pair_unless_a_user_chose(shown: Any, file: str) -> None:
    opened(shown, file, "#play=0")
    for data in page().data["scenes"]:
        shown.locator("#scene").select_option(data["name"])
        shown.wait_for_function(f"explorer.page.scene.name === '{data['name']}'")
        assert shown.evaluate("[...explorer.page.keys, explorer.page.dt]") == [*data["pair"], data["step"]]
        assert shown.locator("#finding").inner_text() == data["finding"]
    shown.locator("#method-a").select_option("merson")
    shown.locator("#scene").select_option("pendulum")
    shown.wait_for_function("explorer.page.scene.name === 'pendulum'")
    assert shown.evaluate("explorer.page.keys") == ["merson", "leapfrog"]


@needs_browser
def test_panels_are_filled(shown: Any, file: str) -> None:
    """Where the page has no energy, a number of the state is in its place."""
    for name in ("van_der_pol", "oscillator"):
        opened(shown, file, f"#scene={name}&at=60&play=0")
        assert shown.locator("#watched").inner_text() == ("Energy" if name == "oscillator" else "y over time")
        assert shown.evaluate("explorer.page.race.energies[1].every(Number.isFinite)")
    # The strip below the oscillator's block reaches the end of the picture: something is drawn in every fifth of its height.
    opened(shown, file, "#scene=oscillator&at=60&play=0")
    inked = shown.evaluate(
        """() => {
          const canvas = document.getElementById("motion-b");
          const { width, height } = canvas;
          const pixels = canvas.getContext("2d").getImageData(0, 0, width, height).data;
          return [0, 1, 2, 3, 4].map((fifth) => {
            let [low, high] = [width, 0];
            for (let y = Math.floor((fifth * height) / 5); y < ((fifth + 1) * height) / 5; y++)
              for (let x = 0; x < width; x++)
                if (pixels[4 * (y * width + x) + 3] > 128) [low, high] = [Math.min(low, x), Math.max(high, x)];
            return high - low;
          });
        }"""
    )
    assert min(inked) > 60
    opened(shown, file, "#scene=oscillator&at=40&play=0")
    assert "stays on the ellipse v² − 0.3·v·y + y² = 1" in shown.locator("#phase-told-b").inner_text()
    grown, stays = shown.evaluate("explorer.page.zooms")
    assert stays < 1.5 < 3 < grown


CONTRAST = """(names) => {
  const channels = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => {
    const [x, y, z] = [r, g, b].map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * x + 0.7152 * y + 0.0722 * z;
  };
  const ground = (node) => {
    const own = channels(getComputedStyle(node).backgroundColor);
    return own.length === 4 && own[3] === 0 ? ground(node.parentElement) : own;
  };
  const texts = [...document.querySelectorAll(names)].filter((node) => node.textContent.trim() && node.offsetWidth);
  return texts.map((node) => {
    const [a, b] = [light(channels(getComputedStyle(node).color)), light(ground(node))];
    return [node.textContent.trim().slice(0, 30), (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05)];
  });
}"""


@needs_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_are_dark_enough(browser: Any, file: str, scheme: str) -> None:
    """Letters in a method's colour, too: yellow and green are too pale on white."""
    context = browser.new_context(viewport={"width": 1280, "height": 800}, color_scheme=scheme)
    web = context.new_page()
    for a, b in (("standard_euler", "leapfrog"), ("rk4", "dop853"), ("standard_heun", "backward_euler")):
        opened(web, file, f"#scene=oscillator&a={a}&b={b}&at=20&play=0")
        pale = [
            each for each in web.evaluate(CONTRAST, "p, b, h1, h2, span, output, figcaption, select, button") if each[1] < 4.5
        ]
        assert not pale
    context.close()


@needs_browser
def test_the_ring_of_the_focus_covers_no_label(shown: Any, file: str) -> None:
    opened(shown, file, "#scene=oscillator&play=0")
    for name in ("dt", "speed", "p-omega"):
        ring = shown.evaluate(
            """(name) => {
              const input = document.getElementById(name);
              input.focus({ focusVisible: true });
              const style = getComputedStyle(input);
              const label = input.closest(".slide").querySelector("span");
              const letters = label.getBoundingClientRect();
              const ring = parseFloat(style.outlineWidth) + parseFloat(style.outlineOffset);
              return input.getBoundingClientRect().top - ring - letters.bottom;
            }""",
            name,
        )
        assert ring >= 0, name


@pytest.mark.parametrize(
    "heaviest", family([True, False], lambda heaviest: heaviest, lambda heaviest: "heaviest" if heaviest else "others")
)
@needs_browser
def test_frames_of_scenes_leave_half_of_their_time(heaviest: bool, shown: Any, file: str) -> None:
    """Half of the frames, steps and pictures together, in half of the 16.7 ms that there are at 60 frames a second."""
    slow = {}
    opened(shown, file, "#play=0")
    for data in page().data["scenes"]:
        if (data["name"] in HEAVIEST) is not heaviest:
            continue
        shown.evaluate(
            "(name) => explorer.load(name, {}).then(() => { explorer.page.framesMs.length = 0; explorer.play(true); })",
            data["name"],
        )
        shown.wait_for_function("explorer.page.framesMs.length > 60 || explorer.page.race.over")
        frames = sorted(shown.evaluate("explorer.page.framesMs"))
        shown.evaluate("explorer.play(false)")
        if frames[len(frames) // 2] >= 8.4:
            slow[data["name"]] = frames[len(frames) // 2]
    assert not slow

"""The explorer's page without a browser: its steps in Node, and how it is made."""

import json
import re
import sys
import types
import warnings
from pathlib import Path

import numpy as np
import pytest
import stepwell as sw
from stepwell.views import cli
from stepwell.views.explorer import data as of_page
from stepwell.views.explorer import sliders
from stepwell.views.explorer.data import of_scene
from stepwell.views.explorer.page import IF_NAMED, MODULES, WEB, script
from support.cases import SOME
from support.explored import CHANGED, STEPS, data_of, expected, in_node, needs_node, page, races, scene_of
from support.refusals import refused

RUN = """
told = given.map(([name, key, values, steps]) => {
  const run = new Trajectory(scene(name), key, scene(name).dt, values).steps(steps);
  return run.lost === null ? [...run.v, ...run.y].map(bits) : [`lost after ${run.lost}`];
});
"""


@SOME
@needs_node
def test_every_step_has_the_bits_of_integrate(some: int | None, tmp_path: Path) -> None:
    """Each scene by methods that can step it; and with sliders moved, against the scene made with these parameters."""
    every = races(some)
    assert {name for name, *_ in every} == set(sliders.OFFERS)
    assert {key for _, key, *_ in every} == {m.name for m in sw.methods()} - set(IF_NAMED)
    results = in_node(RUN, tmp_path, [[name, key, values, STEPS] for name, key, values, _ in every])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        wrong = [each[:3] for each, got in zip(every, results, strict=True) if got != expected(each[3], each[1])]
    assert not wrong


@pytest.mark.mutant
@needs_node
def test_a_slider_that_is_not_heard_is_noticed(tmp_path: Path) -> None:
    mistake = ("trajectory", "value * factor", "slider.value * factor")
    every = [each for each in races() if each[2]]
    results = in_node(RUN, tmp_path, [[name, key, values, STEPS] for name, key, values, _ in every], mistake)
    assert not any(got == expected(each[3], each[1]) for each, got in zip(every, results, strict=True))


def test_sliders_begin_where_the_scene_is() -> None:
    """Each slider has its scene's own value, and each of its numbers is there: else it would move nothing."""
    for each in page().data["scenes"]:
        offered = sliders.OFFERS[each["name"]].sliders
        assert [slider["name"] for slider in each["sliders"]] == [slider.name for slider in offered]
        for slider in each["sliders"]:
            assert slider["low"] <= slider["value"] <= slider["high"]
    values = {slider["name"]: slider["value"] for slider in data_of("energy_control")["sliders"]}
    assert values == {"gain": 0.3}
    assert [slider["value"] for slider in data_of("pythagorean")["sliders"]] == [3.0, 4.0, 5.0, 0.0]
    assert {name for name, *_ in CHANGED.values()} <= set(sliders.OFFERS)


@needs_node
def test_a_run_blows_up_where_integrate_says(tmp_path: Path) -> None:
    """Far past the limits of all of them: the first step after which the state is not finite, with v that is computed, too."""
    keys = ["false_euler", "leapfrog", "verlet", "rk4", "merson", "standard_euler"]
    results = in_node(
        """
told = given.map((key) => {
  const run = new Trajectory(scene("oscillator"), key, 5, {}).steps(2000);
  return [run.lost, run.large];
});
""",
        tmp_path,
        keys,
    )
    for key, (lost, large) in zip(keys, results, strict=True):
        with pytest.warns(sw.DivergenceWarning):
            run = sw.integrate(sw.Oscillator(), key, v=0.0, y=1.0, dt=5.0, steps=2000, every=1)
        assert lost == run.first_bad_step
        size = np.maximum(np.abs(run.v), np.abs(run.y))
        assert large == int(np.argmax(size > 1e6))


@needs_node
def test_links_hold_numbers_to_the_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    numbers = [0.1 + 0.2, 1 / 3, 5e-324, 1.7e308, *rng.normal(size=50)]
    results = in_node(
        """
told = given.map((x) => bits(number(parse(format({ dt: x, name: "a b&c=d" })).dt, -1e309, 1e309, 0)));
told.push(parse(format({ name: "a b&c=d#é" })).name);
told.push(number("x", 0, 1, 0.5), number("7", 0, 1, 0.5), number(undefined, 0, 1, 0.25));
told.push(format({ a: undefined, b: 1 }));
""",
        tmp_path,
        numbers,
    )
    assert results[: len(numbers)] == [np.float64(x).view(np.uint64).item().to_bytes(8, "big").hex().lstrip("0") for x in numbers]
    assert results[len(numbers) :] == ["a b&c=d#é", 0.5, 1, 0.25, "#b=1"]


def test_pairs_are_in_a_page_if_they_are_named() -> None:
    assert "dopri5" not in {method["name"] for method in page().data["methods"]}
    named = sw.explore("oscillator", methods=["rk4", "dopri5", "vern9"])
    assert set(named.data["scenes"][0]["steps"]) >= {"rk4", "dopri5", "vern9"}


def test_one_file_without_a_network_holds_what_export_prints() -> None:
    text = page().html
    assert len(text.encode()) < 650_000
    assert "{{" not in text
    assert "default-src 'none'" in text
    assert not re.search(r"""(src|href)=["']?(?!data:)\w""", text)
    assert not re.search(r"\b(fetch|XMLHttpRequest|WebSocket|importScripts)\b", script())
    assert {path.stem for path in WEB.glob("*.js")} == set(MODULES)
    assert not re.search(r"^(import|export) ", script(), re.MULTILINE)
    from stepwell.views.charts.style import look

    for method in page().data["methods"]:
        assert method["colour"] == look(sw.method(method["name"]))["color"]
        assert re.fullmatch(r"#[0-9a-f]{6}", method["colour"])  # what the page can lighten
    # Unpacked, a step is the text of ``export``, all of it.
    import base64
    import zlib

    data = data_of("energy_control")
    sources = json.loads(zlib.decompress(base64.b64decode(data["packed"])))
    scene = scene_of("energy_control")
    step = sw.export(scene.system, "merson", "javascript", dt=scene.dt, v=scene.v, y=scene.y, control=scene.control, name="step")
    assert sources[data["steps"]["merson"]] == step.source
    assert "control" not in sources[data["steps"]["truth"]]


@sw.system
def own(t, v, y, *, stiffness=2.0, drag=0.25):  # type: ignore[no-untyped-def]
    return -stiffness * y - drag * v


def test_a_scene_of_ones_own_or_with_other_parameters_has_sliders_of_its_step() -> None:
    scene = sw.Scene(own(), v=0.0, y=1.0, horizon=20.0, name="mine", title="</script><b>")
    page = sw.explore(scene, methods=["rk4", "verlet", "false_euler"])
    (data,) = page.data["scenes"]
    assert [(s["name"], s["value"], s["low"], s["high"]) for s in data["sliders"]] == [
        ("stiffness", 2.0, 0.0, 4.0),
        ("drag", 0.25, 0.0, 0.5),
    ]
    assert set(data["steps"]) == {"rk4", "false_euler", "truth"}
    assert "verlet needs forces" in data["refused"]["verlet"]
    assert "</script><b>" not in page.html
    # What is offered for a built-in scene is meant for it as it is made without arguments.
    data = of_scene(sw.scenes.kepler(e=0.5), [sw.method("rk4")])
    assert [each["name"] for each in data["sliders"]] == ["Gm_0", "Gm_1", "softening"]
    assert data["sliders"][1]["targets"] == {"m.Gm[1]": 1.0, "e.Gm[1]": 1.0, "e.masses[1]": 1.0}
    assert data["truth"] is None


def test_saving_showing_and_notebooks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    scene = sw.scenes.oscillator()
    page = scene.explore(methods=["rk4"])
    assert opened == [next(tmp_path.glob("stepwell-*.html")).as_uri()]
    assert page == sw.explore("oscillator", methods=["rk4"])
    assert page.save(tmp_path / "x.html").read_text(encoding="utf-8") == page.html
    assert repr(page) == "<explorer of oscillator; 1 methods>"
    frame = page._repr_html_()
    assert frame.startswith("<iframe ")
    assert frame.count('"') == 6
    assert scene.explore(show=False) is not None
    shell = types.SimpleNamespace(get_ipython=lambda: types.SimpleNamespace(kernel=1))
    monkeypatch.setitem(sys.modules, "IPython", shell)
    scene.explore(methods=["rk4"])
    assert len(opened) == 1


def test_wrong_calls_say_what_is_wrong(tmp_path: Path) -> None:
    twice = [sw.Scene(sw.Oscillator(), v=0.0, y=1.0, horizon=1.0)] * 2
    for call, error, text in (
        (lambda: sw.explore("clowder"), sw.errors.UnknownNameError, "clowder"),
        (lambda: sw.explore([]), sw.errors.ArgumentError, "scenes: expected at least one"),
        (lambda: sw.explore(3), sw.errors.StepwellError, "scenes: "),
        (lambda: sw.explore(twice), sw.errors.ArgumentError, "scenes: .* different names, got 'unnamed' twice"),
        (lambda: sw.explore("clover", methods=["rk44"]), sw.errors.UnknownNameError, "rk44"),
        (lambda: page().save(tmp_path / "x.txt"), sw.errors.ArgumentError, "path: expected a file ending in .html or .htm"),
        (lambda: twice[0].explore(show=1), sw.errors.DTypeError, "show: expected True or False"),  # type: ignore[arg-type]
    ):
        refused(error, text, call)


def test_a_long_step_is_left_out_of_a_page_and_a_large_scene_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the length of its text; the truth is made by the first method that fits."""
    monkeypatch.setattr(of_page, "MAX_SOURCE", 5000)
    record = of_scene(scene_of("kepler"), [sw.method("false_euler"), sw.method("dop853")])
    assert set(record["steps"]) == {"false_euler", "truth"}
    assert record["truth_by"] == "standard_heun"
    assert re.fullmatch(r"a step of \d+ characters is too long for a page; at most 5000 fit", record["refused"]["dop853"])

    def refuse_to_export(*args: object, **options: object) -> None:
        raise AssertionError("a step was exported")

    monkeypatch.setattr(of_page, "export", refuse_to_export)
    refused(sw.errors.UnsupportedError, r"^scenes: no method steps cloth in a page: a step of about 99054 ", sw.explore, "cloth")
    refused(AssertionError, "a step was exported", sw.explore, "kepler")


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "page.html"
    assert cli.main(["explore", "--scene", "pendulum", "--only", "-o", str(path), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["written"], report["bytes"]) == ([str(path)], path.stat().st_size)
    (scene,) = report["scenes"]
    assert (scene["name"], scene["sliders"]) == ("pendulum", ["omega", "start", "push"])
    assert set(scene["methods"]) == {m.name for m in sw.methods()} - set(IF_NAMED)
    assert "Pendulum, 90" in path.read_text(encoding="utf-8")
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert cli.main(["explore", "--scene", "oscillator", "--only"]) == 0
    (file,) = tmp_path.glob("stepwell-*.html")
    assert opened == [file.as_uri()]
    out = capsys.readouterr().out
    assert out.startswith(f"opened in the browser: {file}\n")
    (row,) = [line for line in out.splitlines() if line.startswith("oscillator")]
    assert row.split() == ["oscillator", str(len(sw.methods()) - len(IF_NAMED)), "Undamped", "oscillator", "omega,", "start"]
    assert cli.main(["explore", "--scene", "nothing"]) == 2
    assert "nothing" in capsys.readouterr().err

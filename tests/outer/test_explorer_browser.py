"""The explorer's page in headless Chromium: its numbers, its link, its keys, on a phone, and how long a frame takes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from support.abroad import bits
from support.browser import needs_browser
from support.explored import STEPS, expected, page, scene_of, the_file  # noqa: F401

pytestmark = needs_browser

#: Milliseconds that the page may take to show something on a busy machine.
PATIENCE = 20_000


class Shown:
    """A page in a window; ``complaints`` is what its console said."""

    def __init__(self, browser: Any, file: str, words: str = "", is_ready: str = "explorer.page.ready", **window: Any) -> None:
        self.context = browser.new_context(**({"viewport": {"width": 1280, "height": 900}} | window))
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.complaints: list[str] = []
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on(
            "request", lambda request: self.complaints.append(request.url) if request.url[:5] not in (file[:5], "data:") else None
        )
        self.page.goto(file + words)
        self.page.evaluate(is_ready)

    def __enter__(self) -> Shown:
        return self

    def __exit__(self, *_: Any) -> None:
        self.context.close()

    def at(self, what: str) -> Any:
        """A value of the page's state."""
        return self.page.evaluate(f"explorer.page.{what}")

    def text(self, name: str) -> str:
        return self.page.locator(f"#{name}").inner_text()

    def until(self, what: str) -> None:
        self.page.wait_for_function(what)

    def states(self) -> list[list[str]]:
        """The bits of v and y of both runs."""
        runs = self.page.evaluate("explorer.page.race.runs.map((run) => ({ lost: run.lost, numbers: [...run.v, ...run.y] }))")
        return [
            [f"{bits(float(x)):x}" for x in run["numbers"]] if run["lost"] is None else [f"lost after {run['lost']}"]
            for run in runs
        ]


def test_states_are_those_of_integrate_to_the_bit(browser: Any, file: str) -> None:
    """Every scene, by link, two methods each: so the page's own way to its steps, and Chromium's arithmetic."""
    with Shown(browser, file, "#play=0") as shown:
        for i, data in enumerate(page().data["scenes"]):
            keys = [key for key in data["steps"] if key != "truth"]
            a, b = keys[i % len(keys)], keys[(3 * i + 1) % len(keys)]
            scene = scene_of(data["name"])
            shown.page.evaluate(
                "([name, words]) => explorer.load(name, words)",
                [data["name"], {"a": a, "b": b, "dt": repr(scene.dt), "at": str(STEPS), "play": "0"}],
            )
            assert shown.at("race.k") == STEPS or "lost" in str(shown.states())
            assert shown.states() == [expected(scene, a), expected(scene, b)], (data["name"], a, b)
        assert not shown.complaints


def test_it_plays_and_its_link_restores_the_state(browser: Any, file: str) -> None:
    words = "#scene=kepler&a=leapfrog&b=merson&dt=0.0123&speed=1&phase=2&p.start=0.95&play=1"
    with Shown(browser, file, words) as shown:
        shown.until("explorer.page.race.k > 20")
        shown.page.keyboard.press("Space")
        assert shown.at("playing") is False
        shown.page.wait_for_function("location.hash.includes('at=')")
        link, states, k = shown.page.url, shown.states(), shown.at("race.k")
        shown.page.keyboard.press("ArrowRight")
        assert shown.at("race.k") == k + 1
        assert shown.states() != states
        assert not shown.complaints
    with Shown(browser, file, "#" + link.partition("#")[2]) as again:
        assert again.at("playing") is False
        assert (again.at("race.k"), again.states()) == (k, states)
        assert (again.at("dt"), again.at("speed"), again.at("phase"), again.at("values.start")) == (0.0123, 1, 2, 0.95)
        assert again.page.locator("#method-a").input_value() == "leapfrog"
        assert not again.complaints


def test_nonsense_in_a_link_is_left_out_and_a_blow_up_said(browser: Any, file: str) -> None:
    words = "#scene=nothing&a=rk5&b=&dt=-1&speed=1e9&phase=-3&p.m1=x&at=1e99&more=%3Cb%3E"
    with Shown(browser, file, words + "&play=0") as shown:
        assert (shown.at("scene.name"), shown.at("keys")) == ("clover", ["false_euler", "rk4"])
        assert shown.at("dt") > 0
        assert (shown.at("values.m1"), shown.at("phase")) == (1, 0)
        assert not shown.complaints
    with Shown(browser, file, "#scene=oscillator&a=false_euler&b=rk4&dt=2.5&at=900&play=0") as shown:
        with pytest.warns(sw.DivergenceWarning):
            run = sw.integrate(sw.Oscillator(), "false_euler", v=0.0, y=1.0, dt=2.5, steps=900)
        assert shown.text("lost-a").startswith(f"Blew up: after step {run.first_bad_step} ")
        assert shown.text("lost-b") == ""
        assert "False Euler: Blew up" in shown.page.locator("#news").text_content()
        assert not shown.complaints
    with Shown(browser, file, "", reduced_motion="reduce") as shown:
        assert shown.at("playing") is False
        shown.page.locator("#play").click()
        assert shown.at("playing") is True
    with Shown(browser, file) as shown:
        assert shown.at("playing") is True


def test_controls_by_hand(browser: Any, file: str) -> None:
    with Shown(browser, file, "#scene=oscillator&a=false_euler&b=rk4&dt=0.3&play=0") as shown:
        web = shown.page
        assert shown.text("limits").split() == ["A", "2", "B", "2.828"]
        omega = web.locator("[data-name=omega]")
        omega.focus()
        for _ in range(5):
            web.keyboard.press("ArrowRight")
        assert shown.at("values.omega") > 1.0
        web.locator("#method-b").select_option("standard_euler")
        assert "stable: B for no dt" in shown.text("limits")
        assert shown.at("keys") == ["false_euler", "standard_euler"]
        web.locator("#one").click()
        web.locator("#one").click()
        assert shown.at("race.k") == 2
        assert "unstable" in shown.text("roots-told-b")
        assert "stable, neither grows nor dies" in shown.text("roots-told-a")
        web.keyboard.press("r")
        assert shown.at("race.k") == 0
        before = shown.at("dt")
        web.locator("#one").focus()
        web.keyboard.press("ArrowUp")
        assert shown.at("dt") == pytest.approx(1.05 * before, rel=0.01)
        web.locator("#scene").select_option("forced_oscillator")
        shown.until("explorer.page.scene.name === 'forced_oscillator'")
        assert web.locator("#method-a option[value=verlet]").is_disabled()
        web.locator("#code summary").click()
        shown.until("document.getElementById('code-a').textContent.includes('export class Step')")
        assert not shown.complaints


def test_the_limit_under_damping_is_that_of_stability_limit(browser: Any, file: str) -> None:
    """The page bisects down to its slider's numbers; dt of 1e-9 of itself is far below what rounding of p and q moves it by."""
    for damping in (0.1, 0.6):
        with Shown(browser, file, f"#scene=forced_oscillator&a=rk4&b=false_euler&p.damping={damping}&p.omega=2&play=0") as shown:
            for key, limit in zip(("rk4", "false_euler"), shown.at("limits"), strict=True):
                system = sw.Oscillator(2.0, damping, form="physical")
                assert limit == pytest.approx(float(sw.stability_limit(system, key)), rel=1e-9)


@pytest.mark.parametrize(("width", "scheme"), [(360, "light"), (360, "dark"), (768, "light"), (1280, "dark")])
def test_nothing_is_cut_off(browser: Any, file: str, width: int, scheme: str) -> None:
    window = {"viewport": {"width": width, "height": 780}, "color_scheme": scheme, "has_touch": width == 360}
    with Shown(browser, file, "#scene=forced_oscillator&play=0&at=50", **window) as shown:
        assert shown.page.evaluate("document.documentElement.scrollWidth") <= width
        for node in shown.page.locator("select, button, input, canvas, summary").all():
            box = node.bounding_box()
            assert box["width"] > 20
            assert box["height"] >= 20, node.evaluate("each => each.id")  # what a finger can meet
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width
        ground = shown.page.evaluate("getComputedStyle(document.body).backgroundColor")
        light = sum(map(int, ground[4:-1].split(","))) / 3
        assert light > 200 if scheme == "light" else light < 50
        assert not shown.complaints


def test_every_control_has_a_name_and_a_visible_focus(browser: Any, file: str) -> None:
    with Shown(browser, file, "#scene=clover&play=0") as shown:
        names = shown.page.evaluate(
            """[...document.querySelectorAll("button, select, input, summary, canvas")].map((each) =>
                 (each.getAttribute("aria-label") || (each.labels?.[0] ?? each).textContent).trim())"""
        )
        assert all(names)
        seen = set()
        for _ in range(40):
            shown.page.keyboard.press("Tab")
            focused = shown.page.evaluate(
                """(() => {
                  const e = document.activeElement;
                  return [e.dataset.name || e.id || e.tagName, getComputedStyle(e).outlineStyle];
                })()"""
            )
            if focused[0] == "BODY":
                break
            seen.add(focused[0])
            assert focused[1] == "solid", focused
        wanted = "scene play one reset speed dt link method-a method-b m1 m2 m3 soft phase"
        assert set(wanted.split()) <= seen


def test_a_frame_of_the_clover_takes_a_fraction_of_its_time(browser: Any, file: str) -> None:
    """Half of the frames, steps and pictures together, in half of the 16.7 ms that there are at 60 frames a second."""
    with Shown(browser, file, "#scene=clover&a=dop853&b=rk4&dt=0.01&speed=1&play=1") as shown:
        shown.until("explorer.page.framesMs.length > 90")
        frames = sorted(shown.at("framesMs"))
        assert frames[len(frames) // 2] < 8.4
        assert not shown.complaints


@sw.system(order=1)
def spiral(t, y, *, turn=2.0, fall=0.1):  # type: ignore[no-untyped-def]
    return np.array([-turn * y[1] - fall * y[0], turn * y[0] - fall * y[1]])


def test_a_scene_of_ones_own_and_a_frame_of_a_notebook(browser: Any, tmp_path: Path) -> None:
    """A first-order system has no v; and a page within a page has no address to write to."""
    scene = sw.Scene(spiral(), v=None, y=[1.0, 0.0], horizon=10.0, dt=0.1, name="spiral")
    own = sw.explore([scene], methods=["standard_euler", "rk4"])
    place = own.save(tmp_path / "own.html").as_uri()
    with Shown(browser, place, "#scene=spiral&a=standard_euler&b=rk4&at=25&play=0") as shown:
        runs = [scene.run(key, steps=25) for key in ("standard_euler", "rk4")]
        assert shown.states() == [[f"{bits(float(x)):x}" for x in run.y[-1]] for run in runs]
        assert [each["name"] for each in shown.at("scene.sliders")] == ["turn", "fall"]
        assert not shown.complaints
    (tmp_path / "notebook.html").write_text(f"<!doctype html><title>x</title>{own._repr_html_()}", encoding="utf-8")
    with Shown(browser, (tmp_path / "notebook.html").as_uri(), is_ready="1") as shown:
        frame = shown.page.frames[1]
        frame.wait_for_function("window.explorer?.page.race?.k > 3")
        frame.locator("#play").click()
        shown.page.wait_for_timeout(400)
        assert frame.evaluate("explorer.page.playing") is False
        assert not shown.complaints


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_two_methods_of_one_family_are_told_apart(browser: Any, file: str, scheme: str) -> None:
    """Their curves stand in one picture, so a common colour would hide which is which."""

    def shown_colours(a: str, b: str) -> list[str]:
        with Shown(browser, file, f"#scene=oscillator&a={a}&b={b}&play=0", color_scheme=scheme) as shown:
            style = "(name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim()"
            colours = [shown.page.evaluate(style, name) for name in ("--a", "--b", "--text")]
            assert not shown.complaints
            return colours

    a, b, text = shown_colours("standard_euler", "false_euler")
    assert a != b == text
    one, other, text = shown_colours("false_euler", "rk4")
    assert len({one, other, text}) == 3
    assert one == a
    same, again, _ = shown_colours("rk4", "rk4")
    assert same == again == other  # the second is dashed

"""Scenes of the explorer's page run in Node and by ``integrate``, with its sliders set; shared by its tests."""

from __future__ import annotations

import json
import shutil
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.views.explorer import sliders
from stepwell.views.explorer.page import WEB

from support.abroad import bits, executed
from support.cases import number

#: Steps that are compared to the bit: some impacts of the ball and the stop of the sliding block are among them.
STEPS = 60

#: Scenes with some sliders away from where they are at first, and the same scene made in Python.
CHANGED: dict[str, tuple[str, dict[str, float], Any]] = {
    "clover's masses": (
        "clover",
        {"m1": 1.5, "m3": 0.25, "soft": 0.125},
        lambda s: replace(s, system=sw.NBody([1.5, 1.0, 0.25], force="logarithmic", softening=0.125)),
    ),
    "oscillator": ("oscillator", {"omega": 2.5, "start": -0.5}, lambda s: replace(s, system=sw.Oscillator(2.5), y=-0.5)),
    "damping": (
        "forced_oscillator",
        {"omega": 2.0, "damping": 0.4, "amplitude": 0.5, "drive": 1.1},
        lambda s: replace(s, system=sw.Oscillator(2.0, 0.4, a=sw.Sinusoid(0.5, 1.1, 0.5), form="physical")),
    ),
    "pendulum": ("pendulum", {"start": 3.0, "push": 0.5}, lambda s: replace(s, v=0.5, y=3.0)),
    "chain": ("chain", {"stiffness": 3.0, "mass": 0.5}, lambda s: replace(s, system=sw.Chain(8, stiffness=3.0, mass=0.5))),
    "gain": ("energy_control", {"gain": 0.75}, lambda s: replace(s, control=sw.EnergyControl(0.75))),
    "speed": ("kepler", {"start": 0.9}, lambda s: replace(s, v=s.v * 0.9)),
    "restitution": (
        "bouncing_ball",
        {"restitution": 0.5, "gravity": 4.0},
        lambda s: replace(s, system=sw.Particles(gravity=4.0, floor=sw.Floor(restitution=0.5), dim=2)),
    ),
    "inertia": ("dzhanibekov", {"J1": 0.5, "J3": 2.0}, lambda s: replace(s, system=sw.RigidBody([0.5, 2.0, 2.0]))),
    "friction": (
        "sliding_block",
        {"friction": 1.5},
        lambda s: replace(s, system=sw.Oscillator(0.0, friction=1.5, form="physical")),
    ),
    "rods": (
        "double_pendulum",
        {"m2": 3.0, "gravity": 2.0},
        lambda s: replace(s, system=sw.Rods([1.0, 3.0], s.system.rods, 1.0, gravity=2.0)),
    ),
}


@cache
def page() -> sw.Explorer:
    """The page with all scenes and methods."""
    return sw.explore()


@pytest.fixture(scope="module", name="file")
def the_file(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page, as a browser opens it."""
    return page().save(tmp_path_factory.mktemp("page") / "explorer.html").as_uri()


def scene_of(name: str) -> sw.Scene:
    return sliders.rope() if name == "rope" else sw.scenes.scene(name)


def data_of(name: str) -> dict[str, Any]:
    (scene,) = (each for each in page().data["scenes"] if each["name"] == name)
    return scene


needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="there is no Node here")


def in_node(script: str, folder: Path, data: Any = None, change: tuple[str, str, str] | None = None) -> Any:
    """What a script makes of the page's modules, as JSON. ``change`` is a module, and a text in it for another: a mistake."""
    for module in WEB.glob("*.js"):
        text = module.read_text(encoding="utf-8")
        if change is not None and module.stem == change[0]:
            assert text.count(change[1]) == 1, "a mistake must be made in one place"
            text = text.replace(change[1], change[2])
        (folder / module.name).write_text(text, encoding="utf-8")
    (folder / "package.json").write_text('{"type": "module"}')
    (folder / "given.json").write_text(json.dumps({"scenes": page().data["scenes"], "given": data}))
    begin = """
import { readFileSync } from "node:fs";
import * as roots from "./roots.js";
import { ENERGIES } from "./energies.js";
import { TRUTHS } from "./truths.js";
import { Trajectory, unpack, settings } from "./trajectory.js";
import { Race, Truth, apart } from "./race.js";
import { around, conserved, equationOf } from "./conserved.js";
import { drawRoots } from "./plots.js";
import { format, number, parse } from "./state.js";
import { limitOf } from "./limits.js";
const { scenes, given } = JSON.parse(readFileSync("given.json", "utf8"));
for (const scene of scenes) scene.sources = await unpack(scene.packed);
const scene = (name) => scenes.find((each) => each.name === name);
const view = new DataView(new ArrayBuffer(8));
const bits = (x) => { view.setFloat64(0, x); return view.getBigUint64(0).toString(16); };
let told;
"""
    (folder / "run.js").write_text(begin + script + "\nconsole.log(JSON.stringify(told));\n", encoding="utf-8")
    return json.loads(executed(["node", "run.js"], folder))


def expected(scene: sw.Scene, method: str, steps: int = STEPS) -> list[str]:
    """The bits of v and y after these steps by ``integrate``, or the step after which they are no longer finite."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # stiff scenes blow up
        run = scene.run(method, steps=steps)
    if int(run.first_bad_step) >= 0:
        return [f"lost after {int(run.first_bad_step)}"]
    return [f"{bits(float(x)):x}" for block in (run.v[-1], run.y[-1]) for x in np.ravel(block)]


def races(some: int | None = None) -> list[tuple[str, str, dict[str, float], Any]]:
    """Name of a scene, method, sliders, the scene in Python: every scene by every method, and some with other parameters.

    Or every scene by some methods that are drawn for it, and every method once.
    """
    rows: list[tuple[str, str, dict[str, float], Any]] = []
    met: set[str] = set()
    for each in page().data["scenes"]:
        keys = sorted((key for key in each["steps"] if key != "truth"), key=lambda key: number(each["name"], key))
        rows += [
            (each["name"], key, {}, scene_of(each["name"]))
            for i, key in enumerate(keys)
            if some is None or i < some or key not in met
        ]
        met |= set(keys)
    for name, values, make in CHANGED.values():
        scene = make(scene_of(name))
        rows += [(name, key, values, scene) for key in ("false_euler", "leapfrog", "rk4") if key in data_of(name)["steps"]]
    return rows

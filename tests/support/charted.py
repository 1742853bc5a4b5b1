"""Work-precision charts that several tests look at."""

import csv
import functools
import importlib
import json

import pytest
import stepwell as sw
from stepwell.studies.measuring import timing

from support.families import family

#: The scenes with a solution that a fixed step does well; the others have their own test of orders. That of a ball is not smooth.
HARD = ("bouncing_ball", "figure_eight", "kepler", "pythagorean", "arenstorf", "sliding_block", "sticking_block")
SCENES = [scene for scene in sw.scenes.scenes() if scene.exact is not None and scene.name not in HARD]
METHODS = sw.methods()

#: The function hides the module of its name.
LADDER = importlib.import_module("stepwell.studies.measuring.work_precision")


#: Those of which all is tried by default: a linear scene of one number and one of several bodies, which some methods cannot step.
SHOWN = ("clover", "oscillator")


@functools.cache
def _made(some):
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(LADDER, "SMALLEST", 1 / 30)
        return {scene.name: sw.charts.work_precision(scene) for scene in SCENES if scene.name in SHOWN or not some}


@pytest.fixture(
    scope="module", name="charts", params=family([True, False], lambda some: some, lambda some: "some" if some else "all")
)
def the_charts(request):
    """These scenes by every method: what `stepwell chart` draws, but for the finest rungs of the ladder and with hasty times."""
    return _made(request.param)


def hasty(patched):
    """Times of steps are not what is looked at."""
    patched.setattr(timing, "CHARTS", timing.CHARTS._replace(members=64, repeats=2, seconds=1e-4))


@pytest.fixture(scope="module", autouse=True)
def _hasty_times():
    """Of all charts of a file that imports this."""
    with pytest.MonkeyPatch.context() as patched:
        hasty(patched)
        yield


@pytest.fixture(scope="module", name="small")
def the_small():
    return sw.charts.work_precision("forced_oscillator", ["verlet", "false_euler", "rk4"], [4, 40, 400])


def read(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def files_of(chart, folder):
    """The rows of its table, and what its JSON has, which is strict."""
    chart.to_csv(folder / "chart.csv")
    chart.to_json(folder / "chart.json")
    return read(folder / "chart.csv"), json.loads((folder / "chart.json").read_text(encoding="utf-8"), parse_constant=pytest.fail)


def drawn(chart, folder, **options):
    """The figure of a chart, whose picture has something in it."""
    figure = chart.plot(folder / "chart.png", **options)
    assert (folder / "chart.png").stat().st_size > 10_000
    return figure

"""The benchmark of ensembles: contestants find what is right, and the share of right outcomes tells if one does not."""

import importlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell

from benches.ensembles import __main__ as ensembles
from benches.ensembles import truth, work

#: Members enough to tell a mistake, and few enough for a second.
SMALL = {"bifurcation": 60, "basins": 8, "figure_eight": 6}


@pytest.fixture(scope="module", params=list(SMALL))
def known(request: pytest.FixtureRequest) -> Any:
    """A sweep, and what is right."""
    return request.param, truth.outcomes(request.param, SMALL[request.param])


def share(name: str, contestant: str, right: Any) -> float:
    """Of right outcomes."""
    module = importlib.import_module(f"benches.ensembles.{contestant}_{name}")
    outcomes = module.run(SMALL[name])
    assert len(outcomes) == work.members(name, SMALL[name])
    return truth.right(name, outcomes[truth.sampled(name, SMALL[name])], *right)


#: What two very exact computations agree on is found again by others, but for what is nearly chaotic.
LEAST = {"bifurcation": 0.8, "basins": 0.9, "figure_eight": 0.8}


@pytest.mark.parametrize("contestant", ["stepwell", "numba", "heyoka"])
def test_contestants_are_right(known: Any, contestant: str) -> None:
    for package in {"numba": ("numba", "joblib"), "heyoka": ("heyoka",)}.get(contestant, ()):
        pytest.importorskip(package)
    name, right = known
    assert share(name, contestant, right) >= LEAST[name]


@pytest.mark.parametrize("name", SMALL)
def test_a_wrong_one_is_told_of(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By other physics."""
    right = truth.outcomes(name, SMALL[name])
    module = importlib.import_module(f"benches.ensembles.stepwell_{name}")
    changed = {
        "bifurcation": ("DELTA", 0.35),
        "basins": ("FRICTION", 0.1),
        "figure_eight": ("BODIES", stepwell.NBody([1.0, 1.0, 1.0], force="logarithmic")),
    }[name]
    monkeypatch.setattr(module, *changed)
    assert share(name, "stepwell", right) < LEAST[name]


def test_right_is_counted_among_what_is_known_and_lines_among_code() -> None:
    outcomes, right = np.array([0, 1, 2, 2]), np.array([0, 1, 1, 2])
    assert truth.right("basins", outcomes, right, np.array([True, True, True, False])) == pytest.approx(2 / 3)
    never = np.array([np.nan, 1.0, np.nan, 5.0])
    assert truth.right("figure_eight", never, np.array([np.nan, 1.05, 2.0, np.nan]), np.ones(4, dtype=bool)) == 0.5
    states = np.zeros((2, 3))
    off = states + np.array([[0.0], [0.01]])
    assert truth.right("bifurcation", states, off, np.ones(2, dtype=bool)) == 0.5
    counted = {each: ensembles.lines(each, "basins") for each in ensembles.CONTESTANTS}
    assert 10 < counted["stepwell"] < counted["numba"]
    text = (ensembles.HERE / "stepwell_basins.py").read_text(encoding="utf-8")
    assert counted["stepwell"] < len(text.splitlines())


def test_the_page_has_what_was_measured(tmp_path: Path) -> None:
    each = {"seconds": 12.34, "ready": 1.5, "peak": 2**30, "right": 0.915}
    numbers: dict[str, Any] = {"machine": "this one."}
    numbers["basins"] = {"size": 2000, "contestants": {"stepwell": each, "numba": {"missing": "no numba"}}}
    page = tmp_path / "page.md"
    page.write_text(ensembles.PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    ensembles.write(numbers, page)
    text = page.read_text(encoding="utf-8")
    lines = ensembles.lines("stepwell", "basins")
    assert f"| stepwell | 12.3 | 1.5 s | {lines} | 1024 MiB | 91.5% |" in text
    assert "| numba + joblib | — | — | — | — | no numba |" in text
    assert "4 000 000 starts" in text
    assert text.endswith(ensembles.PAGE.read_text(encoding="utf-8")[-200:])


def test_what_was_measured_is_not_measured_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[str, str]] = []

    def measured(contestant: str, name: str, size: int, small: int, times: int) -> dict[str, Any]:
        calls.append((contestant, name))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return {"seconds": 1.0, "ready": 1.0, "peak": 1, "right": 1.0}

    monkeypatch.setattr(ensembles, "measured", measured)
    page = tmp_path / "page.md"
    page.write_text("<!-- measured: ensembles -->\n<!-- end measured -->", encoding="utf-8")
    options = ["--quick", "--only", "basins,figure_eight", "--numbers", str(tmp_path / "a.json"), "--page", str(page)]
    with pytest.raises(KeyboardInterrupt):
        ensembles.main(options)
    ensembles.main(options)
    assert len(calls) == 7  # six, and the one that was interrupted
    ensembles.main(options)
    assert len(calls) == 7
    ensembles.main([*options, "--again", "numba"])
    assert calls[7:] == [("numba", "basins"), ("numba", "figure_eight")]
    assert set(json.loads((tmp_path / "a.json").read_text())) == {"machine", "basins", "figure_eight"}

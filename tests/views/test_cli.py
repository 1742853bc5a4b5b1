"""The command line, through its entry point."""

import json
import math

import numpy as np
import pytest
import stepwell as sw
from stepwell.views import cli
from stepwell.views.cli import show
from support.charted import _hasty_times, read  # noqa: F401
from support.commands import complaint, listed, printed, run_command


def test_the_version_and_the_help_of_every_command(capsys):
    for words, *texts in (
        (["--version"], f"stepwell {sw.__version__}\n"),
        *(([command, "--help"], f"usage: stepwell {command}", "--json") for command in cli.COMMANDS),
    ):
        with pytest.raises(SystemExit) as end:
            cli.main(words)
        assert end.value.code == 0
        out = capsys.readouterr().out
        assert all(text in out for text in texts), words


def test_without_a_word_the_commands_are_listed_in_one_line_each(capsys):
    out = printed(capsys)
    lines = out.partition("commands:\n")[2].splitlines()[: len(cli.COMMANDS)]
    assert [line.split()[0] for line in lines] == list(cli.COMMANDS)
    assert all(len(line) <= 79 for line in out.splitlines())
    assert all(len(line.split()) > 2 for line in lines)


def test_scenes_and_methods_are_listed(capsys):
    scenes, methods = sw.scenes.scenes(), sw.methods()
    assert [(s["name"], s["dt"], s["horizon"]) for s in listed(capsys, "scenes")] == [(s.name, s.dt, s.horizon) for s in scenes]
    limits = [None if m.limit == math.inf else m.limit for m in methods]  # JSON has no infinity
    shown = [(m["limit"], m["name"], m["order"]) for m in listed(capsys, "methods")]
    assert shown == [(limit, m.name, m.order) for limit, m in zip(limits, methods, strict=True)]
    for command, things in (("scenes", scenes), ("methods", methods)):
        out = printed(capsys, command)
        assert all(each.name in out for each in things)
    assert printed(capsys, "methods", "verlet") == sw.method("verlet").__doc__ + "\n"
    assert listed(capsys, "methods", "verlet")["other_names"] == list(sw.method("verlet").other_names)


def test_run_says_what_integrate_says(capsys):
    run = sw.scenes.clover().run("false_euler", 0.1, steps=50, every=1)
    words = ("run", "clover", "--method", "false_euler", "--dt", "0.1", "--steps", "50")
    report = listed(capsys, *words)
    assert (report["dt"], report["steps"], report["kept"], report["diverged_at_step"]) == (0.1, 50, 51, None)
    assert report["last_y"] == run.y[-1].tolist()
    assert report["largest_state_error"] == sw.scenes.clover().state_error(run).max()
    out = printed(capsys, *words)
    last = out.partition("last y")[2].splitlines()[0].replace("[", " ").replace("]", " ").replace(",", " ").split()
    assert [float(number) for number in last] == pytest.approx(run.y[-1].ravel().tolist(), rel=1e-6)
    # Step and horizon are of the scene.
    report = listed(capsys, "run", "clover", "--method", "rk4")
    assert (report["dt"], report["steps"], report["last_t"]) == (0.3, 100, 30.0)
    report = listed(capsys, "run", "clover", "--method", "rk4", "--dt", "0.001")
    assert (report["steps"], report["kept"]) == (30_000, 1001)
    assert listed(capsys, "run", "clover", "--method", "rk4", "--steps", "2e2")["steps"] == 200


def test_run_writes_the_kept_states(capsys, tmp_path):
    run = sw.scenes.clover().run("rk4", every=20)
    for ending in ("csv", "npz"):
        out = printed(capsys, "run", "clover", "--method", "rk4", "--every", "20", "-o", str(tmp_path / f"run.{ending}"))
        assert f"run.{ending}" in out
    arrays = np.load(tmp_path / "run.npz")
    for name, values in (("t", run.t), ("v", run.v), ("y", run.y), ("energy", run.energy)):
        assert np.array_equal(arrays[name], values)
    rows = read(tmp_path / "run.csv")
    assert [float(row["t"]) for row in rows] == run.t.tolist()
    assert [float(row["y[2, 1]"]) for row in rows] == run.y[:, 2, 1].tolist()
    assert [float(row["state_error"]) for row in rows] == sw.scenes.clover().state_error(run).tolist()


def test_run_draws_a_picture_or_an_animation(capsys, tmp_path):
    for ending, start in {"png": b"\x89PNG", "gif": b"GIF89a", "html": b"<!doctype html>"}.items():
        path = tmp_path / f"run.{ending}"
        words = ("run", "figure_eight", "--method", "leapfrog", "-o", str(path), "--seconds", "0.2", "--fps", "10")
        report = listed(capsys, *words)
        assert report["written"] == str(path)
        assert report["kept"] == report["steps"] + 1  # all of them, for a smooth curve
        assert path.read_bytes().startswith(start)


def test_run_takes_kinds_of_numbers(capsys):
    words = ("run", "kepler", "--method", "rk4", "--dt", "0.02", "--steps", "50")
    plain = listed(capsys, *words)["last_y"]
    for word, option in (("--fused", {"fused": True}), ("--float32", {"dtype": "float32"})):
        run = sw.scenes.kepler().run("rk4", 0.02, steps=50, **option)
        assert listed(capsys, *words, word)["last_y"] == run.y[-1].tolist() != plain
    said = complaint(capsys, "run", "kepler", "--method", "dop853", "--tolerance", "1e-8", "--float32")
    assert "tolerance: in float32 a step rounds the state" in said


def test_run_takes_a_control(capsys):
    scene, words = sw.scenes.energy_control(), ("run", "energy_control", "--method", "standard_euler", "--steps")
    for more, control in (
        ((), sw.EnergyControl(0.3)),
        (("--control", "off"), None),
        (("--control", "0.5"), sw.EnergyControl(0.5)),
        (("--control", "0.5:printed"), sw.EnergyControl(0.5, "printed")),
        (("--control", "scaling"), sw.Projection("scaling")),
    ):
        run = scene.run("standard_euler", steps=300, control=control)
        assert listed(capsys, *words, "300", *more)["last_y"] == run.y[-1].tolist(), more
    code, _, err = run_command(capsys, *words, "5", "--control", "1000:printed")
    assert code == 0
    assert err.startswith("stepwell: warning: gain: h·C·K = ")


def test_a_run_without_an_exact_solution_and_one_that_diverged(capsys):
    report = listed(capsys, "run", "plummer", "--method", "leapfrog", "--steps", "50")
    assert 0 < report["largest_energy_error"] < 0.01
    assert "largest_state_error" not in report
    words = ("run", "oscillator", "--method", "standard_euler", "--dt", "100", "--steps", "400", "--json")
    code, out, err = run_command(capsys, *words)
    report = json.loads(out)
    assert code == 0
    assert err.startswith("stepwell: warning: the run diverged at step")
    assert err.count("\n") == 1
    assert report["diverged_at_step"] == 155
    assert report["largest_state_error"] is report["last_y"] is None


def test_chart_writes_a_picture_and_a_table_for_each_scene(capsys, tmp_path):
    """And prints a summary, of which the answer comes first."""
    out_dir = tmp_path / "not yet there"
    words = ("chart", "oscillator", "forced_oscillator", "-o", str(out_dir), "--methods", "rk4, verlet")
    code, out, _ = run_command(capsys, *words)
    cost = sw.charts.work_precision("forced_oscillator", ["rk4"]).curves[0].cheapest(1e-4)
    assert code == 0
    row = [line for line in out.splitlines() if line.startswith("Runge-Kutta 4")][-1]
    assert f" {show.number(cost)} " in row
    assert "not applicable: Verlet (needs forces that do not depend on the velocity" in out.replace("\n", " ")
    assert out.splitlines()[0].endswith(" digits.")
    assert "forced_oscillator.png" in out
    names = ["forced_oscillator.csv", "forced_oscillator.png", "oscillator.csv", "oscillator.png"]
    assert sorted(path.name for path in out_dir.iterdir()) == names
    assert (out_dir / "oscillator.png").read_bytes().startswith(b"\x89PNG")
    assert {row["method"] for row in read(out_dir / "oscillator.csv")} == {"rk4", "verlet"}


def test_chart_puts_several_scenes_into_one_picture(capsys, tmp_path):
    words = ("chart", "oscillator", "forced_oscillator", "--panel", "-o", str(tmp_path), "--methods", "rk4,verlet", "--json")
    code, out, _ = run_command(capsys, *words)
    charts = json.loads(out)
    assert code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["panel.csv", "panel.json", "panel.png"]
    assert [chart["scene"] for chart in charts] == ["oscillator", "forced_oscillator"]
    assert [[row["method"] for row in chart["summary"]] for chart in charts] == [["rk4", "verlet"], ["rk4"]]
    assert list(charts[1]["refused"]) == ["verlet"]
    assert all(chart["front"] for chart in charts)
    files = {file for chart in charts for file in chart["files"]}
    assert files == {str(path) for path in tmp_path.iterdir()}


def test_nothing_is_written_and_charted_for_minutes_that_was_not_asked_for(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words in (("chart", "oscillator", "--methods", "rk4"), ("figures", "rk4"), ("control", "clover", "--gains", "0.1")):
        assert printed(capsys, *words).endswith("-o DIR writes pictures and tables.\n"), words
        assert list(tmp_path.iterdir()) == []
    said = complaint(capsys, "chart", "oscillator", "cloth")
    assert said.startswith("stepwell: --methods: expected some for cloth, such as leapfrog,rk4: its state is 6144 numbers")


def test_criteria_says_what_criteria_says(capsys, tmp_path):
    some = ["rk4", "verlet", "trapezoidal"]
    rows = [{name: None if value == math.inf else value for name, value in row.items()} for row in sw.criteria(some).rows()]
    assert listed(capsys, "criteria", *some) == json.loads(json.dumps(rows))
    out = printed(capsys, "criteria", "rk4", "verlet", "--phi", "0.25, 2", "--markdown")
    assert out == sw.criteria(["rk4", "verlet"], phi=[0.25, 2]).markdown()
    texts = {}
    for name in ("c.md", "c.json"):
        assert name in printed(capsys, "criteria", "rk4", "-o", str(tmp_path / name)).replace("\n", "")
        texts[name] = (tmp_path / name).read_text(encoding="utf-8")
    assert texts["c.md"] == sw.criteria(["rk4"]).markdown()
    assert json.loads(texts["c.json"])[0]["method"] == "rk4"


def test_criteria_prints_tables_that_fit(capsys, monkeypatch):
    """One table at any usual width, whose note names what was left out; in no cell a text that was cut."""
    monkeypatch.setenv("COLUMNS", "80")
    out = printed(capsys, "criteria")
    assert max(map(len, out.splitlines())) <= 80
    assert "…" not in out
    for method in sw.methods():
        assert sum(line.startswith(method.title) for line in out.splitlines()) == 1
    assert "Left out, as the terminal is narrow: " in out
    monkeypatch.setenv("COLUMNS", "1000")
    out = printed(capsys, "criteria", "semi_false_heun", "rk4")
    assert "Left out" not in out
    semi = next(line for line in out.splitlines() if "Semi-False Heun" in line)
    assert semi.split()[:8] == ["Semi-False", "Heun", "1.572303", "3.996", "−Φ⁴/4", "−Φ²/12", "+", "7Φ⁴/160"]
    assert next(line.split() for line in out.splitlines() if "Runge-Kutta 4" in line)[-5:] == ["14", "18", "0", "0", "4"]


def test_explain_says_what_explain_says(capsys, tmp_path):
    explained = sw.explain(sw.Oscillator(), "false_euler")
    words, as_json = ("explain", "oscillator", "false_euler"), json.loads(json.dumps(explained.as_dict()))
    assert printed(capsys, *words) == f"{explained}\n"
    assert listed(capsys, "explain", "Oscillator", "false_euler") == as_json
    for name, text in (("a.txt", str(explained)), ("a.html", explained._repr_html_()), ("a.json", None)):
        printed(capsys, *words, "-o", str(tmp_path / name))
        written = (tmp_path / name).read_text(encoding="utf-8")
        assert written == text + "\n" if text else json.loads(written) == as_json
    scene = sw.scenes.energy_control()
    wanted = sw.explain(scene.system.for_state_shapes(scene.v, scene.y), "rk4", members=8, control=scene.control, fused=True)
    assert printed(capsys, "explain", "energy_control", "rk4", "--members", "8", "--fused") == f"{wanted}\n"
    assert "an attempt at a step of Pendulum" in printed(capsys, "explain", "Pendulum", "merson", "--attempt")


def test_explain_and_export_say_what_is_wrong(capsys):
    export = ("export", "--method", "rk4", "--language", "c")
    for words, message in (
        (("explain", "oscilator", "rk4"), "system: there is no 'oscilator'; expected a scene, aircraft, arenstorf, "),
        (("explain", "Chain", "rk4"), "system: Chain needs arguments"),
        (("explain", "System", "rk4"), "system: there is no 'System'"),
        (("explain", "oscillator", "rk44"), "method: there is no 'rk44'"),
        (("explain", "oscillator", "rk4", "--members", "0"), "members: expected 1 or more, got 0"),
        (("explain", "oscillator", "rk4", "-o", "a.pdf"), "-o: expected a file ending in .json, .html or .txt"),
        ((*export, "Chain"), "system: Chain needs arguments"),
        ((*export, "Pendulum", "--language", "fortran"), "language: there is no 'fortran'"),
        ((*export, "Pendulum", "--language", "javascript", "--fused"), "fused: JavaScript has no fused multiply-add"),
        ((*export, "Pendulum", "-o", "step.rs"), "-o: expected a file ending in .c or .h, got 'step.rs'"),
        ((*export, "Pendulum", "--name", "while"), "name: 'while' has a meaning of its own"),
        ((*export, "Pendulum", "--dt", "-1"), "dt: expected numbers above zero in units of time, got -1"),
    ):
        assert message in complaint(capsys, *words), words


def test_export_says_what_export_says(capsys, tmp_path):
    step = sw.export(sw.Pendulum(), "rk4", "rust", dt=0.02, fused=True, name="swing")
    words = ["export", "Pendulum", "--method", "rk4", "--language", "rust", "--dt", "0.02", "--fused", "--name", "swing"]
    assert printed(capsys, *words) == step.source
    assert listed(capsys, *words) == json.loads(json.dumps(step.as_dict()))
    path = tmp_path / "swing.rs"
    assert printed(capsys, *words, "-o", str(path)) == f"written: {path}\n"
    assert path.read_text(encoding="utf-8") == step.source
    scene = sw.scenes.energy_control()
    step = sw.export(scene.system, "rk4", "c", control=scene.control, v=scene.v, y=scene.y, dt=scene.dt)
    assert "control" in step.source
    assert printed(capsys, "export", "energy_control", "--method", "rk4", "--language", "c") == step.source
    verlet = sw.export(sw.Oscillator(), "verlet", "python", start="first_order")
    words = ["Oscillator", "--method", "verlet", "--language", "python", "--start", "first_order"]
    assert printed(capsys, "export", *words) == verlet.source


def test_stability_tells_limits_and_writes_nothing(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = printed(capsys, "stability")
    euler = next(line for line in out.splitlines() if "False Euler" in line)
    assert euler.split()[:5] == ["False", "Euler", "2", "3.142", "unstable"]  # the width of the rest is a terminal's affair
    assert "3Φ⁴/640" in out
    heun = next(line for line in out.splitlines() if line.startswith("False Heun"))
    assert "monotonic" in heun
    report = listed(capsys, "stability", "standard_heun", "rk4")
    assert report["files"] == []
    limits = [("standard_heun", 0.0), ("rk4", sw.stability_limit(sw.Oscillator(), "rk4").dt)]
    assert [(row["method"], row["limit"]) for row in report["summary"]] == limits
    assert list(tmp_path.iterdir()) == []


def test_stability_draws_what_was_asked_for_and_tells_what_it_refuses(capsys, tmp_path):
    folder = tmp_path / "not yet there"
    out = printed(capsys, "stability", "verlet", "rk4", "-o", str(folder))
    assert "no map of Verlet: verlet needs forces that do not depend on the velocity" in out.replace("\n", " ")
    names = ["stability-curves.png", "stability-loci.png", "stability-map-rk4.png", "stability.csv"]
    assert sorted(path.name for path in folder.iterdir()) == names
    for name in names[:3]:
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
        assert name in out.replace("\n", " ")
    drawn = [float(row["r1_squared"]) for row in read(folder / "stability.csv") if row["method"] == "rk4"]
    assert drawn == sw.charts.stability(["rk4"]).loci[0].r1_squared.tolist()
    folder = tmp_path / "asked"
    words = ("stability", "rk4", "-o", str(folder), "--charts", "map, loci,map", "--phi", "2.5")
    report = listed(capsys, *words)
    names = ["stability-loci.png", "stability-map-rk4.png", "stability.csv"]
    assert sorted(report["files"]) == sorted(str(folder / name) for name in names)
    assert sorted(path.name for path in folder.iterdir()) == names
    assert float(read(folder / "stability.csv")[-1]["phi"]) == 2.5
    refused = listed(capsys, "stability", "verlet", "-o", str(tmp_path), "--charts", "map", "--phi", "2.5")["refused"]
    assert list(refused) == ["verlet"]


def test_figures_writes_a_picture_for_each_method(capsys, tmp_path):
    words = ("figures", "false_heun", "-o", str(tmp_path), "--phi", "1", "--periods", "2")
    report = listed(capsys, *words)
    names = ["overview.png", "10-false_heun.png", "figures.csv", "figures.json"]
    assert report["phi"] == 1.0
    assert report["files"] == [str(tmp_path / name) for name in names]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert report["summary"][0]["r1_squared"] == pytest.approx(0.5)


def test_the_documents_pair_is_reached(capsys, tmp_path):
    """Appendix D as it is printed: force, potential, form of the control, method and steps."""
    words = ("--method", "standard_euler", "--control", "0.3:printed", "--steps", "1000", "--json")
    code, out, err = run_command(capsys, "run", "energy_control:pair=printed", *words)
    assert code == 0
    assert "bodies 0 and 1 met within step 370" in err
    report = json.loads(out)
    scene = sw.scenes.energy_control("printed", form="printed")
    with pytest.warns(sw.AccuracyWarning, match="met within step 370"):
        run = scene.run("standard_euler", steps=1000)
    assert (report["last_y"], report["last_energy"]) == (run.y[-1].tolist(), run.energy[-1])
    assert json.loads(run_command(capsys, "run", "energy_control", *words)[1])["last_energy"] != report["last_energy"]


def test_arguments_of_a_scene_are_numbers_or_words(capsys):
    assert sw.scenes.scene("energy_control:pair=printed, eps=0").system == sw.scenes.energy_control("printed", 0.0).system
    assert sw.scenes.scene("kepler:e=0.5").v.tolist() == sw.scenes.kepler(0.5).v.tolist()
    assert len(sw.scenes.scene("plummer:n=8,seed=3").y) == 8
    for name, message in (
        ("energy_control:par=printed", "scene energy_control: there is no 'par'; did you mean 'pair'?"),
        ("energy_control:pair", "scene: expected arguments as energy_control:NAME=VALUE,NAME=VALUE, got 'pair'"),
        ("energy_control:pair=3", "pair: there is no 3"),
        ("kepler:e=much", "e: expected real numbers"),
        ("clovr:x=1", "did you mean 'clover'?"),
    ):
        assert message in complaint(capsys, "run", name, "--method", "rk4")

"""The command line, through its entry point."""

import csv
import json
import math

import numpy as np
import pytest
import stepwell as sw
from stepwell.views import cli
from stepwell.views.cli import show
from support.commands import run_command


def test_the_version_is_run_command(capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"stepwell {sw.__version__}\n"


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_every_command_explains_itself(capsys, command):
    with pytest.raises(SystemExit) as end:
        cli.main([command, "--help"])
    out = capsys.readouterr().out
    assert end.value.code == 0
    assert f"usage: stepwell {command}" in out
    assert "--json" in out


@pytest.mark.parametrize("words", [["--verison"], ["run"], ["run", "clover", "--method", "rk4", "--dt", "x"]])
def test_words_that_make_no_command_end_with_2(capsys, words):
    with pytest.raises(SystemExit) as end:
        cli.main(words)
    assert end.value.code == 2
    assert capsys.readouterr().err.endswith(" --help lists the options.\n")


def test_without_a_word_the_commands_are_listed_in_one_line_each(capsys):
    code, out, err = run_command(capsys)
    assert (code, err) == (0, "")
    lines = out.partition("commands:\n")[2].splitlines()
    assert [line.split()[0] for line in lines[: len(cli.COMMANDS)]] == list(cli.COMMANDS)
    assert all(len(line) <= 79 for line in out.splitlines())
    assert all(len(line.split()) > 2 for line in lines[: len(cli.COMMANDS)])


# ---- lists


def test_scenes_lists_every_scene(capsys):
    code, out, err = run_command(capsys, "scenes", "--json")
    listed = json.loads(out)
    assert (code, err) == (0, "")
    assert [(s["name"], s["dt"], s["horizon"]) for s in listed] == [(s.name, s.dt, s.horizon) for s in sw.scenes.scenes()]
    code, out, err = run_command(capsys, "scenes")
    assert (code, err) == (0, "")
    for scene in sw.scenes.scenes():
        assert scene.name in out


def test_methods_lists_every_method(capsys):
    code, out, err = run_command(capsys, "methods", "--json")
    listed = json.loads(out)
    assert (code, err) == (0, "")
    limits = [None if m.limit == math.inf else m.limit for m in sw.methods()]  # JSON has no infinity
    assert [m["limit"] for m in listed] == limits
    assert [(m["name"], m["order"]) for m in listed] == [(m.name, m.order) for m in sw.methods()]
    code, out, err = run_command(capsys, "methods")
    assert (code, err) == (0, "")
    for method in sw.methods():
        assert method.name in out


def test_methods_describes_one(capsys):
    assert run_command(capsys, "methods", "verlet") == (0, sw.method("verlet").__doc__ + "\n", "")
    code, out, _ = run_command(capsys, "methods", "verlet", "--json")
    assert code == 0
    assert json.loads(out)["other_names"] == list(sw.method("verlet").other_names)


# ---- run


def test_run_says_what_integrate_says(capsys):
    run = sw.scenes.clover().run("false_euler", 0.1, steps=50, every=1)
    words = ("run", "clover", "--method", "false_euler", "--dt", "0.1", "--steps", "50")
    code, out, err = run_command(capsys, *words, "--json")
    report = json.loads(out)
    assert (code, err) == (0, "")
    assert (report["dt"], report["steps"], report["kept"], report["diverged_at_step"]) == (0.1, 50, 51, None)
    assert report["last_y"] == run.y[-1].tolist()
    assert report["largest_state_error"] == sw.scenes.clover().state_error(run).max()
    code, out, err = run_command(capsys, *words)
    assert (code, err) == (0, "")
    last = out.partition("last y")[2].splitlines()[0].replace("[", " ").replace("]", " ").replace(",", " ").split()
    assert [float(number) for number in last] == pytest.approx(run.y[-1].ravel().tolist(), rel=1e-6)


def test_run_takes_step_and_horizon_from_the_scene(capsys):
    report = json.loads(run_command(capsys, "run", "clover", "--method", "rk4", "--json")[1])
    assert (report["dt"], report["steps"], report["last_t"]) == (0.3, 100, 30.0)
    report = json.loads(run_command(capsys, "run", "clover", "--method", "rk4", "--dt", "0.001", "--json")[1])
    assert (report["steps"], report["kept"]) == (30_000, 1001)


def test_run_writes_the_kept_states(capsys, tmp_path):
    run = sw.scenes.clover().run("rk4", every=20)
    for ending in ("csv", "npz"):
        code, out, err = run_command(
            capsys, "run", "clover", "--method", "rk4", "--every", "20", "-o", str(tmp_path / f"run.{ending}")
        )
        assert (code, err) == (0, "")
        assert f"run.{ending}" in out
    read = np.load(tmp_path / "run.npz")
    for name, values in (("t", run.t), ("v", run.v), ("y", run.y), ("energy", run.energy)):
        assert np.array_equal(read[name], values)
    with (tmp_path / "run.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["t"]) for row in rows] == run.t.tolist()
    assert [float(row["y[2, 1]"]) for row in rows] == run.y[:, 2, 1].tolist()
    assert [float(row["state_error"]) for row in rows] == sw.scenes.clover().state_error(run).tolist()


def test_run_draws_a_picture_or_an_animation(capsys, tmp_path):
    starts = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF", "gif": b"GIF89a", "html": b"<!doctype html>"}
    for ending, start in starts.items():
        path = tmp_path / f"run.{ending}"
        words = ("run", "figure_eight", "--method", "leapfrog", "-o", str(path), "--seconds", "0.2", "--fps", "10", "--json")
        code, out, err = run_command(capsys, *words)
        report = json.loads(out)
        assert (code, err, report["written"]) == (0, "", str(path))
        assert report["kept"] == report["steps"] + 1  # all of them, for a smooth curve
        assert path.read_bytes().startswith(start)


def test_run_takes_fused_multiply_adds(capsys):
    words = ("run", "kepler", "--method", "rk4", "--dt", "0.02", "--steps", "50", "--json")
    plain, fused = (json.loads(run_command(capsys, *words, *more)[1]) for more in ((), ("--fused",)))
    run = sw.scenes.kepler().run("rk4", 0.02, steps=50, fused=True)
    assert fused["last_y"] == run.y[-1].tolist() != plain["last_y"]


def test_run_takes_float32(capsys):
    words = ("run", "kepler", "--method", "rk4", "--dt", "0.02", "--steps", "50", "--json")
    wide, narrow = (json.loads(run_command(capsys, *words, *more)[1]) for more in ((), ("--float32",)))
    run = sw.scenes.kepler().run("rk4", 0.02, steps=50, dtype="float32")
    assert narrow["last_y"] == run.y[-1].tolist() != wide["last_y"]
    code, out, err = run_command(capsys, "run", "kepler", "--method", "dop853", "--tolerance", "1e-8", "--float32")
    assert (code, out) == (2, "")
    assert "tolerance: in float32 a step rounds the state" in err


def test_run_takes_a_control(capsys):
    def last(*words):
        code, out, err = run_command(
            capsys, "run", "energy_control", "--method", "standard_euler", "--steps", "300", "--json", *words
        )
        assert (code, err) == (0, "")
        return json.loads(out)["last_y"]

    scene = sw.scenes.energy_control()
    for words, control in (
        ((), sw.EnergyControl(0.3)),
        (("--control", "off"), None),
        (("--control", "0.5"), sw.EnergyControl(0.5)),
        (("--control", "0.5:printed"), sw.EnergyControl(0.5, "printed")),
        (("--control", "scaling"), sw.Projection("scaling")),
    ):
        assert last(*words) == scene.run("standard_euler", steps=300, control=control).y[-1].tolist()


def test_a_control_that_overshoots_is_warned_of(capsys):
    words = ("run", "energy_control", "--method", "standard_euler", "--steps", "5", "--control", "1000:printed")
    code, _, err = run_command(capsys, *words)
    assert code == 0
    assert err.startswith("stepwell: warning: gain: h·C·K = ")


def test_a_run_without_an_exact_solution_tells_the_energy_and_no_state_error(capsys):
    report = json.loads(run_command(capsys, "run", "plummer", "--method", "leapfrog", "--steps", "50", "--json")[1])
    assert 0 < report["largest_energy_error"] < 0.01
    assert "largest_state_error" not in report


def test_a_diverged_run_is_a_warning_and_a_result(capsys):
    words = ("run", "oscillator", "--method", "standard_euler", "--dt", "100", "--steps", "400", "--json")
    code, out, err = run_command(capsys, *words)
    report = json.loads(out)
    assert code == 0
    assert err.startswith("stepwell: warning: the run diverged at step")
    assert err.count("\n") == 1
    assert report["diverged_at_step"] == 155
    assert report["largest_state_error"] is report["last_y"] is None


# ---- chart


def test_chart_writes_a_picture_and_a_table_for_each_scene(capsys, tmp_path):
    out_dir = tmp_path / "not yet there"
    words = ("chart", "oscillator", "forced_oscillator", "-o", str(out_dir), "--methods", "rk4, verlet")
    code, out, _ = run_command(capsys, *words, "--json")
    charts = json.loads(out)
    assert code == 0
    assert [chart["scene"] for chart in charts] == ["oscillator", "forced_oscillator"]
    assert [[row["method"] for row in chart["summary"]] for chart in charts] == [["rk4", "verlet"], ["rk4"]]
    assert list(charts[1]["refused"]) == ["verlet"]
    assert sorted(path.name for path in out_dir.iterdir()) == [
        "forced_oscillator.csv",
        "forced_oscillator.png",
        "oscillator.csv",
        "oscillator.png",
    ]
    assert [file for chart in charts for file in chart["files"]] == [
        str(out_dir / f"{scene}.{ending}") for scene in ("oscillator", "forced_oscillator") for ending in ("png", "csv")
    ]
    assert (out_dir / "oscillator.png").read_bytes().startswith(b"\x89PNG")
    with (out_dir / "oscillator.csv").open(encoding="utf-8") as file:
        assert {row["method"] for row in csv.DictReader(file)} == {"rk4", "verlet"}


def test_chart_prints_a_summary(capsys, tmp_path):
    code, out, _ = run_command(capsys, "chart", "forced_oscillator", "-o", str(tmp_path), "--methods", "rk4,verlet")
    cost = sw.charts.work_precision("forced_oscillator", ["rk4"]).curves[0].cheapest(1e-4)
    assert code == 0
    row = next(line for line in out.splitlines() if line.startswith("Runge-Kutta 4"))
    assert f" {show.number(cost)} " in row
    assert "not applicable: Verlet (needs forces that do not depend on the velocity" in out.replace("\n", " ")
    assert out.splitlines()[0].endswith(" digits.")  # the answer comes first
    assert "forced_oscillator.png" in out


def test_chart_puts_several_scenes_into_one_picture(capsys, tmp_path):
    words = ("chart", "oscillator", "clover", "--panel", "-o", str(tmp_path), "--methods", "rk4,merson", "--json")
    code, out, _ = run_command(capsys, *words)
    charts = json.loads(out)
    assert code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["panel.csv", "panel.json", "panel.png"]
    assert [chart["scene"] for chart in charts] == ["oscillator", "clover"]
    assert all(chart["front"] for chart in charts)


@pytest.mark.parametrize(
    "words", [("chart", "oscillator", "--methods", "rk4"), ("figures", "rk4"), ("control", "clover", "--gains", "0.1")]
)
def test_nothing_is_written_that_was_not_asked_for(capsys, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    code, out, err = run_command(capsys, *words)
    assert (code, err) == (0, "")
    assert out.endswith("-o DIR writes pictures and tables.\n")
    assert list(tmp_path.iterdir()) == []


def test_a_chart_that_would_take_many_minutes_says_so_at_once(capsys):
    code, out, err = run_command(capsys, "chart", "oscillator", "cloth")
    assert (code, out) == (2, "")
    assert err.startswith("stepwell: --methods: expected some for cloth, such as leapfrog,rk4: its state is 6144 numbers")


# ---- criteria


def test_criteria_says_what_criteria_says(capsys):
    code, out, err = run_command(capsys, "criteria", "--json")
    assert (code, err) == (0, "")
    rows = [{name: None if value == math.inf else value for name, value in row.items()} for row in sw.criteria().rows()]
    assert json.loads(out) == json.loads(json.dumps(rows))
    code, out, err = run_command(capsys, "criteria", "rk4", "verlet", "--phi", "0.25, 2", "--markdown")
    assert (code, out, err) == (0, sw.criteria(["rk4", "verlet"], phi=[0.25, 2]).markdown(), "")


def test_criteria_prints_tables_that_fit(capsys, monkeypatch):
    """One table at any usual width, whose note names what was left out; in no cell a text that was cut."""
    for width in (80, 130):
        monkeypatch.setenv("COLUMNS", str(width))
        code, out, err = run_command(capsys, "criteria")
        assert (code, err) == (0, "")
        assert max(map(len, out.splitlines())) <= width
        assert "…" not in out
        for method in sw.methods():
            assert sum(line.startswith(method.title) for line in out.splitlines()) == 1
        assert "Left out, as the terminal is narrow: " in out
    monkeypatch.setenv("COLUMNS", "1000")
    out = run_command(capsys, "criteria")[1]
    assert "Left out" not in out
    semi = next(line for line in out.splitlines() if "Semi-False Heun" in line)
    assert semi.split()[:8] == ["Semi-False", "Heun", "1.572303", "3.996", "−Φ⁴/4", "−Φ²/12", "+", "7Φ⁴/160"]
    assert next(line.split() for line in out.splitlines() if "Runge-Kutta 4" in line)[-5:] == ["14", "18", "0", "0", "4"]


def test_criteria_writes_a_file(capsys, tmp_path):
    for name, wanted in (("c.md", sw.criteria(["rk4"]).markdown()), ("c.json", None)):
        code, out, _ = run_command(capsys, "criteria", "rk4", "-o", str(tmp_path / name))
        assert code == 0
        assert f"{name}" in out.replace("\n", "")
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert text == wanted if wanted else json.loads(text)[0]["method"] == "rk4"


# ---- explain


def test_explain_says_what_explain_says(capsys, tmp_path):
    explained = sw.explain(sw.Oscillator(), "false_euler")
    assert run_command(capsys, "explain", "oscillator", "false_euler") == (0, f"{explained}\n", "")
    code, out, err = run_command(capsys, "explain", "Oscillator", "false_euler", "--json")
    assert (code, json.loads(out), err) == (0, json.loads(json.dumps(explained.as_dict())), "")
    for name, text in (("a.txt", str(explained)), ("a.html", explained._repr_html_())):
        assert run_command(capsys, "explain", "oscillator", "false_euler", "-o", str(tmp_path / name))[0] == 0
        assert (tmp_path / name).read_text(encoding="utf-8") == text + "\n"
    assert run_command(capsys, "explain", "oscillator", "false_euler", "-o", str(tmp_path / "a.json"))[0] == 0
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8")) == json.loads(json.dumps(explained.as_dict()))


def test_explain_takes_a_scene_with_its_control(capsys):
    scene = sw.scenes.energy_control()
    wanted = sw.explain(scene.system.for_state_shapes(scene.v, scene.y), "rk4", members=8, control=scene.control, fused=True)
    assert run_command(capsys, "explain", "energy_control", "rk4", "--members", "8", "--fused") == (0, f"{wanted}\n", "")
    code, out, _ = run_command(capsys, "explain", "Pendulum", "merson", "--attempt")
    assert code == 0
    assert "an attempt at a step of Pendulum" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["oscilator", "rk4"], "system: there is no 'oscilator'; expected a scene, aircraft, arenstorf, "),
        (["Chain", "rk4"], "system: Chain needs arguments"),
        (["System", "rk4"], "system: there is no 'System'"),
        (["oscillator", "rk5"], "method: there is no 'rk5'"),
        (["oscillator", "rk4", "--members", "0"], "members: expected 1 or more, got 0"),
        (["oscillator", "rk4", "-o", "a.pdf"], "-o: expected a file ending in .json, .html or .txt"),
    ],
)
def test_explain_says_what_is_wrong(capsys, words, message):
    code, out, err = run_command(capsys, "explain", *words)
    assert (code, out) == (2, "")
    assert message in err


# ---- export


def test_export_says_what_export_says(capsys, tmp_path):
    step = sw.export(sw.Pendulum(), "rk4", "rust", dt=0.02, fused=True, name="swing")
    words = ["export", "Pendulum", "--method", "rk4", "--language", "rust", "--dt", "0.02", "--fused", "--name", "swing"]
    assert run_command(capsys, *words) == (0, step.source, "")
    code, out, err = run_command(capsys, *words, "--json")
    assert (code, json.loads(out), err) == (0, json.loads(json.dumps(step.as_dict())), "")
    path = tmp_path / "swing.rs"
    assert run_command(capsys, *words, "-o", str(path)) == (0, f"written: {path}\n", "")
    assert path.read_text(encoding="utf-8") == step.source


def test_export_takes_a_scene_with_its_start_and_its_control(capsys):
    scene = sw.scenes.energy_control()
    state = {"v": scene.v, "y": scene.y, "dt": scene.dt}
    step = sw.export(scene.system, "rk4", "c", control=scene.control, **state)
    assert scene.control is not None
    assert run_command(capsys, "export", "energy_control", "--method", "rk4", "--language", "c") == (0, step.source, "")
    verlet = sw.export(sw.Oscillator(), "verlet", "python", start="first_order")
    words = ["Oscillator", "--method", "verlet", "--language", "python", "--start", "first_order"]
    assert run_command(capsys, "export", *words) == (0, verlet.source, "")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["Chain"], "system: Chain needs arguments"),
        (["Pendulum", "--language", "fortran"], "language: there is no 'fortran'"),
        (["Pendulum", "--language", "javascript", "--fused"], "fused: JavaScript has no fused multiply-add"),
        (["Pendulum", "-o", "step.rs"], "-o: expected a file ending in .c or .h, got 'step.rs'"),
        (["Pendulum", "--name", "while"], "name: 'while' has a meaning of its own"),
        (["Pendulum", "--dt", "-1"], "dt: expected numbers above zero in units of time, got -1"),
    ],
)
def test_export_says_what_is_wrong(capsys, words, message):
    code, out, err = run_command(capsys, "export", "--method", "rk4", "--language", "c", *words)
    assert (code, out) == (2, "")
    assert message in err


# ---- stability


def test_stability_tells_limits_and_writes_nothing(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = run_command(capsys, "stability")
    assert (code, err) == (0, "")
    euler = next(line for line in out.splitlines() if "False Euler" in line)
    assert euler.split()[:5] == ["False", "Euler", "2", "3.142", "unstable"]  # the width of the rest is a terminal's affair
    assert "3Φ⁴/640" in out
    heun = next(line for line in out.splitlines() if line.startswith("False Heun"))
    assert "monotonic" in heun
    code, out, err = run_command(capsys, "stability", "standard_heun", "rk4", "--json")
    report = json.loads(out)
    assert (code, err, report["files"]) == (0, "", [])
    assert [row["method"] for row in report["summary"]] == ["standard_heun", "rk4"]
    assert [row["limit"] for row in report["summary"]] == [0.0, sw.stability_limit(sw.Oscillator(), "rk4").dt]
    assert list(tmp_path.iterdir()) == []


def test_stability_writes_pictures_and_tells_what_it_refuses(capsys, tmp_path):
    folder = tmp_path / "not yet there"
    code, out, err = run_command(capsys, "stability", "verlet", "rk4", "-o", str(folder))
    assert (code, err) == (0, "")
    assert "no map of Verlet: verlet needs forces that do not depend on the velocity" in out.replace("\n", " ")
    names = ["stability-curves.png", "stability-loci.png", "stability-map-rk4.png", "stability.csv"]
    assert sorted(path.name for path in folder.iterdir()) == names
    for name in names[:3]:
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
        assert name in out.replace("\n", " ")
    with (folder / "stability.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["r1_squared"]) for row in rows if row["method"] == "rk4"] == (
        sw.charts.stability(["rk4"]).loci[0].r1_squared.tolist()
    )


def test_stability_draws_what_was_asked_for(capsys, tmp_path):
    words = ("stability", "verlet", "rk4", "-o", str(tmp_path), "--charts", "map, loci,map", "--phi", "2.5", "--json")
    code, out, err = run_command(capsys, *words)
    report = json.loads(out)
    assert (code, err) == (0, "")
    names = ["stability-map-rk4.png", "stability-loci.png", "stability.csv"]
    assert sorted(report["files"]) == sorted(str(tmp_path / name) for name in names)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert list(report["refused"]) == ["verlet"]
    with (tmp_path / "stability.csv").open(encoding="utf-8") as file:
        assert float(list(csv.DictReader(file))[-1]["phi"]) == 2.5


# ---- figures


def test_figures_writes_a_picture_for_each_method(capsys, tmp_path):
    code, out, err = run_command(capsys, "figures", "-o", str(tmp_path / "all"))
    assert (code, err) == (0, "")
    written = sorted(path.name for path in (tmp_path / "all").iterdir())
    assert written == sorted(
        ["overview.png", *(each.file for each in sw.charts.figures().samples), "04-harmonic.png", "figures.csv", "figures.json"]
    )
    assert "07-false_euler.png" in written
    for name in written:
        assert name in out.replace("\n", " ") or len(str(tmp_path)) > 40  # a long path is broken within a cell
    code, out, err = run_command(capsys, "figures", "false_heun", "-o", str(tmp_path), "--phi", "1", "--periods", "2", "--json")
    report = json.loads(out)
    assert (code, err, report["phi"]) == (0, "", 1.0)
    assert report["files"] == [
        str(tmp_path / name) for name in ("overview.png", "10-false_heun.png", "figures.csv", "figures.json")
    ]
    assert report["summary"][0]["r1_squared"] == pytest.approx(0.5)


# ---- scenes with arguments


def test_the_documents_pair_is_reached(capsys, tmp_path):
    """Appendix D as it is printed: force, potential, form of the control, method and steps."""
    words = ("--method", "standard_euler", "--control", "0.3:printed", "--steps", "1000", "--json")
    code, out, err = run_command(capsys, "run", "energy_control:pair=printed", *words)
    assert code == 0
    assert "bodies 0 and 1 met within step 370" in err
    printed = json.loads(out)
    scene = sw.scenes.energy_control("printed", form="printed")
    with pytest.warns(sw.AccuracyWarning, match="met within step 370"):
        run = scene.run("standard_euler", steps=1000)
    assert printed["last_y"] == run.y[-1].tolist()
    assert printed["last_energy"] == run.energy[-1]
    assert json.loads(run_command(capsys, "run", "energy_control", *words)[1])["last_energy"] != printed["last_energy"]


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
        code, _, err = run_command(capsys, "run", name, "--method", "rk4")
        assert code == 2
        assert message in err


def test_stability_draws_powers_if_asked(tmp_path):
    assert cli.main(["stability", "rk4", "-o", str(tmp_path), "--charts", "powers", "--json"]) == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["powers-rk4.png", "stability.csv"]


def test_a_whole_number_may_have_an_exponent(capsys):
    short, long = (
        run_command(capsys, "run", "clover", "--method", "rk4", "--steps", steps, "--json") for steps in ("2e2", "200")
    )
    assert short == long
    assert json.loads(short[1])["steps"] == 200

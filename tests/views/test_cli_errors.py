"""What goes wrong in commands: a message in words, and an exit code."""

import subprocess
import sys

import pytest
from stepwell.views import cli
from support.charted import _hasty_times  # noqa: F401
from support.commands import complaint, printed, run_command


def is_refused(capsys, folder, words, message):
    """In one line, and nothing is written."""
    said = complaint(capsys, *words)
    assert said.startswith("stepwell: ")
    assert message in said
    assert (said.count("\n"), list(folder.iterdir())) == (1, [])


def said_at_the_end(capsys, *words):
    """By words that are no command at all."""
    with pytest.raises(SystemExit) as end:
        cli.main(words)
    assert end.value.code == 2
    return capsys.readouterr().err


#: Wrong words, and what is said of them.
WRONG = [
    (["methods", "rk44"], "did you mean 'rk4'?"),
    (["run", "clovr", "--method", "rk4"], "did you mean 'clover'?"),
    (["run", "clover", "--method", "rk4", "--dt", "-1"], "dt: expected numbers above zero"),
    (["run", "clover", "--method", "rk4", "--steps", "0"], "steps: expected 1 or more"),
    (["run", "clover", "--method", "rk4", "--every", "0"], "every: expected 1 or more"),
    (["run", "clover", "--method", "rk4", "-o", "run.txt"], "-o: expected a file ending in .csv, .npz, .png"),
    (["run", "forced_oscillator", "--method", "verlet"], "verlet needs forces that do not depend on the velocity"),
    (["run", "oscillator", "--method", "rk4", "--control", "1"], "control: Oscillator(omega=1.0, form='canonical') has no en"),
    (["run", "clover", "--method", "rk4", "--control", "x"], "--control: expected a gain and a form, such as 0.3:printed"),
    (["run", "clover", "--method", "rk4", "--control", "1:prnted"], "form: there is no 'prnted'; did you mean 'printed'?"),
    (["run", "clover", "--method", "rk4", "--control=-1"], "gain: expected numbers of zero or more"),
    (["run", "clover", "--method", "verlet", "--control", "1"], "control: verlet carries y_prev in place of v"),
    (["run", "clover", "--method", "rk4", "-o", "run.gif", "--fps", "0"], "fps: expected numbers above zero"),
    (["chart", "oscillator", "clovr"], "did you mean 'clover'?"),
    (["chart", "oscillator", "--methods", "rk4,"], "method: there is no ''"),
    (["criteria", "rk44"], "did you mean 'rk4'?"),
    (["criteria", "--phi", "0.1,x"], "--phi: expected numbers in rad, such as 0.1,0.5, got '0.1,x'"),
    (["criteria", "--phi=-1"], "phi: expected numbers above zero in rad"),
    (["criteria", "--json", "--markdown"], "--markdown: expected either this or --json"),
    (["criteria", "-o", "criteria.txt"], "-o: expected a file ending in .json or .md"),
    (["stability", "rk44", "-o", "out"], "did you mean 'rk4'?"),
    (["stability", "--charts", "locus", "-o", "out"], "--charts: there is no 'locus'; did you mean 'loci'?"),
    (["stability", "--charts", "loci"], "-o: expected a folder for the charts of --charts, got none"),
    (["stability", "--phi", "0", "-o", "out"], "--phi: expected numbers above zero in rad"),
    (["figures", "rk44", "-o", "out"], "did you mean 'rk4'?"),
    (["figures", "--phi", "0", "-o", "out"], "phi: expected numbers above zero in rad"),
    (["figures", "--periods", "1e9", "-o", "out"], "expected 100000 or fewer"),
]


def test_an_error_is_one_line_and_ends_with_2(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words, message in WRONG:
        is_refused(capsys, tmp_path, words, message)


def test_a_file_and_a_command_that_are_not_there(capsys, tmp_path):
    code, _, err = run_command(capsys, "run", "clover", "--method", "rk4", "-o", str(tmp_path / "no" / "run.csv"))
    assert (code, "No such file or directory" in err, err.count("\n")) == (2, True, 1)
    known = "stepwell: command: there is no 'rum'; did you mean 'run'? Known: scenes, methods, run, "
    assert complaint(capsys, "rum").startswith(known)


def test_ctrl_c_ends_with_130(capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("stepwell.views.cli.run.noticing", interrupted)
    assert run_command(capsys, "run", "clover", "--method", "rk4") == (130, "", "stepwell: interrupted\n")


def test_without_rich_everything_works(capsys, monkeypatch, tmp_path):
    for module in [name for name in sys.modules if name.split(".")[0] == "rich"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "rich", None)
    out = str(tmp_path / "out")
    for words in (
        ("scenes",),
        ("methods",),
        ("methods", "rk4"),
        ("run", "clover", "--method", "rk4"),
        ("chart", "oscillator", "--methods", "rk4", "-o", out),
        ("criteria", "rk4"),
        ("criteria", "rk4", "--markdown"),
        ("stability", "rk4", "-o", out, "--charts", "loci"),
        ("figures", "rk4", "-o", out),
    ):
        printed(capsys, *words)


def test_without_matplotlib_numbers_are_told_and_no_folder_is_made(capsys, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    run = ("run", "clover", "--method", "rk4", "-o")
    for words in (
        ("stability", "rk4", "-o", str(tmp_path / "out")),
        ("figures", "rk4", "-o", str(tmp_path / "out")),
        (*run, str(tmp_path / "run.png")),
        (*run, str(tmp_path / "run.gif")),
    ):
        said = "stepwell: plot: a picture needs matplotlib; pip install 'stepwell[chart]'\n"
        assert complaint(capsys, *words) == said
        assert list(tmp_path.iterdir()) == []
    for words in ((*run, str(tmp_path / "run.csv")), ("stability", "rk4"), ("criteria", "rk4")):
        printed(capsys, *words)


def test_a_reader_who_leaves_early_is_no_error():
    """`stepwell methods --json | head`: the pipe is closed before anything is written to it."""
    code = "import sys; from stepwell.views.cli import main; sys.stdin.read(); sys.exit(main(['methods', '--json']))"
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.close()
    process.stdin.close()
    with process:
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_words_that_are_not_understood_say_what_was_expected(capsys):
    run = ("run", "clover", "--method", "rk4")
    for words, message in (
        (("run",), "missing: SCENE"),
        ((*run, "--dt", "abc"), "--dt: expected a number, got 'abc'"),
        *(((*run, "--steps", n), f"--steps: expected a whole number, got '{n}'") for n in ("1.5", "many", "1e-3")),
    ):
        assert said_at_the_end(capsys, *words) == f"stepwell run: {message}\nstepwell run --help lists the options.\n"
    assert said_at_the_end(capsys, "--verison").endswith(" --help lists the options.\n")


def test_a_long_message_is_wrapped_between_words(capsys, monkeypatch):
    whole = complaint(capsys, "run", "clovr", "--method", "rk4")
    assert whole.count("\n") == 1
    monkeypatch.setenv("COLUMNS", "60")
    lines = complaint(capsys, "run", "clovr", "--method", "rk4").splitlines()
    assert len(lines) > 3
    assert max(map(len, lines)) <= 60
    assert " ".join(lines) == whole.strip()


def test_what_memory_has_no_room_for_is_told_in_words(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "2000")
    for words in (
        ("advise", "oscillator", "--frame", "1e-12"),
        ("advise", "oscillator", "--frame", "1e-12", "-o", "advice.json"),
        ("run", "plummer:n=100000000000", "--method", "rk4", "--steps", "1"),
        ("run", "chain:n=100000000000", "--method", "rk4", "--steps", "1"),
    ):
        is_refused(capsys, tmp_path, words, "")

    def full(args):
        raise MemoryError

    monkeypatch.setattr(cli.methods, "command", full)
    assert run_command(capsys, "methods") == (2, "", "stepwell: there is not enough memory for this\n")

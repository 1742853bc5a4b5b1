"""What a step is said to be: listings read by hand and evaluated, counts by hand, machine code and why there is none."""

import json
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell import _core
from stepwell.errors import ArgumentError, UnsupportedError
from stepwell.reference import adaptive
from stepwell.reference.implicit import Implicit
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from stepwell.runs.engine import direct, linear
from stepwell.runs.engine.adaptive import evaluated_attempt
from stepwell.runs.engine.plan import per_step
from stepwell.source.explanation import listing, naming
from stepwell.source.explanation.formula import number
from stepwell.views import cli
from support.cases import ADAPTIVE, SOME, SYSTEMS, drawn, fits, has_branches
from support.explain import evaluate, leaves, lines
from support.export import LANGUAGES, pair
from support.refusals import refused
from support.snapshots import Snapshots
from support.tracing import ABLE, CONTROLS, MEMBERS, METHODS, H, T, a_pace, assert_computes, made

LINEAR = sw.LinearSystem([[1, 2, 3], [4, 5, 6], [7, 8, 9.0]], np.ones((3, 2)), x=[None, 2.0], velocities=[2])
DRIVEN = sw.Oscillator([1.0, 2.0], 0.1, a=sw.Sampled([1.0, 2.0], 0.5), form="physical")
UNDAMPED = ("standard_euler", "damped_euler", "false_euler", "leapfrog", "verlet", "standard_heun", "rk4")

LISTINGS: dict[str, tuple[sw.System, str, dict[str, Any]]] = {
    **{f"undamped/{method}": (sw.Oscillator(), method, {}) for method in UNDAMPED},
    # Both increments of a block have one factor, which is multiplied last.
    **{f"fused/{method}": (sw.Oscillator(), method, {"fused": True}) for method in ("false_euler", "leapfrog", "standard_heun")},
    "start": (sw.Oscillator(), "verlet", {"start": "first_order"}),
    "members": (sw.Oscillator([1.0, 2.0]), "false_euler", {}),
    # The sample at the start of the step, that at its end, and for how much of it the latter has been there.
    "sampled": (DRIVEN, "damped_euler", {}),
    # Newton's law, a = G·m·d/r³, of which the cube is r²·√r².
    "bodies": (sw.NBody([3.0, 4.0], force="newton"), "false_euler", {}),
    "matrices": (LINEAR, "standard_euler", {}),
    "transition": (sw.Oscillator(), "rk4", {"form": "matrix"}),
    "implicit": (pair(), "linearly_implicit_euler", {}),
}


def test_listings(snapshot: Snapshots) -> None:
    """Values before the steps, in each step, and at both ends of what a method carries."""
    for name, (system, method, options) in LISTINGS.items():
        text = str(sw.explain(system, method, **options))
        listing, _, rest = text.partition("\n\noperations of a step")
        ends = re.findall(r"^(?:at the start of a run|where a state is kept), .*\n(?:  .*\n)+", rest, re.MULTILINE)
        snapshot(f"{name}.txt", "\n".join([listing, "", *ends]))


def test_the_transition_matrix() -> None:
    explained = sw.explain(sw.Oscillator(), "rk4", form="matrix")
    assert (explained.computed["additions"], explained.computed["multiplications"]) == (2, 4)
    assert explained.written == explained.computed
    assert "P, Q: the transition matrix of a step, and what the inputs add at each node" in str(explained)


def test_counts() -> None:
    """Sums and products."""
    for method, written, computed in (
        ("standard_euler", (2, 2), (2, 2)),
        ("damped_euler", (2, 2), (2, 2)),
        ("false_euler", (2, 2), (2, 2)),
        ("verlet", (2, 3), (2, 3)),  # 2y − y_prev − Φ·(Φy)
        ("standard_heun", (6, 6), (6, 6)),
        ("semi_false_heun", (7, 6), (6, 6)),  # rates are asked for at v + dv, which is there when dy is added
    ):
        explained = sw.explain(sw.Oscillator(), method)
        for kinds, wanted in ((explained.written, written), (explained.computed, computed)):
            assert (kinds["additions"], kinds["multiplications"]) == wanted, method
            assert sum(kinds.values()) == sum(wanted), method
        assert explained.hoisted == {"run": 1, "member": 0, "step": 0}, method  # Φ


def test_counts_of_a_fused_step() -> None:
    explained = sw.explain(sw.Oscillator(), "false_euler", fused=True)
    assert explained.computed["fused"] == sum(explained.computed.values()) == 2
    assert explained.counts() == [("additions", 2, 0), ("multiplications", 2, 0), ("fused", 0, 2)]


def test_the_criteria_are_those_of_the_tape() -> None:
    for method in METHODS:
        counts = sw.stability.operations(method)
        written = sw.explain(sw.Oscillator(), method).written
        assert counts[:4] == tuple(written[kind] for kind in counts._fields[:4]), method
        assert counts.rate_evaluations == method.evaluations, method


def state(explained: sw.Explanation, plan: engine.Plan, known: dict[str, Any], mark: str = "'") -> list[Any]:
    return [np.broadcast_to(known[name], MEMBERS) for name in naming.states(plan, explained.attempt, mark)]


def assert_listing_is_a_step(
    system: sw.System, method: sw.Method, v: Any, y: Any, *, fused: bool, dtype: str = "float64"
) -> None:
    explained = sw.explain(system, method, fused=fused, dtype=dtype)  # type: ignore[arg-type]
    number = np.dtype(dtype).type
    plan = engine.Plan(system, method, (MEMBERS,), float(number(H)), t0=T, fused=fused, single=dtype == "float32")
    assert explained.parts is None
    known, tables = leaves(plan)
    v, y = (block.astype(number).astype(float) for block in (v, y))
    rows = [*v.reshape(-1, MEMBERS), *y.reshape(-1, MEMBERS), np.zeros(MEMBERS)]
    known |= dict(zip(naming.states(plan, False), rows, strict=False))
    if plan.single:
        known = {name: value if callable(value) else np.asarray(value, number) for name, value in known.items()}
    after = state(explained, plan, evaluate(explained, known, tables))
    assert {each.dtype for each in after} == {np.dtype(number)}
    out = engine.advance(plan, v, y, carried=True)
    wanted = [out.slot, out.y[-1]]
    if system.control is not None:
        wanted.append(out.work)
        after[-1] = per_step(plan, after[-1])
    assert_computes(after, *wanted)
    assert_counted(explained)


def assert_counted(explained: sw.Explanation) -> None:
    """What the lines take is what the core counts in all."""
    total = sum((Counter(line.operations) for line in explained.sections[-1].lines), Counter[str]())
    assert total == +Counter(explained.computed)
    assert all(len(line.formula) < 120 for section in explained.sections for line in section.lines)


def refused_in_float32(system: sw.System, method: sw.Method) -> bool:
    """Whether float32 does not work with them, in words that say so."""
    try:
        sw.explain(system, method, dtype="float32")
    except (ArgumentError, UnsupportedError) as error:
        if not re.search("dtype: |in float32 ", str(error)):
            raise
        return True
    return False


#: Systems whose steps are one tape.
SHORT = [name for name in SYSTEMS if made(name)[1].size <= 30 * MEMBERS]


@SOME
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("fused", [False, True], ids=["plain", "fused"])
def test_every_listing_is_a_step(fused: bool, dtype: str, some: int | None) -> None:
    """Of each system by one method, in one of four ways; in the long run all by all."""
    for name in SHORT[2 * fused + (dtype == "float32") :: 4] if some else SHORT:
        system, v, y = made(name)
        for method in drawn([each for each in METHODS if fits(system, each)], some and some // 2, name, fused, dtype):
            if _core.in_parts(engine.model(engine.Plan(system, method, (MEMBERS,), H)), MEMBERS):
                continue
            if dtype == "float64" or not refused_in_float32(system, method):
                assert_listing_is_a_step(system, method, v, y, fused=fused, dtype=dtype)


@SOME
def test_every_listing_under_control_is_a_step(some: int | None) -> None:
    names = ("three bodies", "two bodies", "three bodies in space, newton")
    ways = [(control, fused, name) for control in CONTROLS for fused in (False, True) for name in names]
    for control, fused, name in ways[:: 5 if some else 1]:
        system, v, y = made(name)
        controlled = system.controlled(CONTROLS[control], v, y, H)
        for method in drawn([each for each in METHODS if fits(controlled, each)], some and 1, name, control, fused):
            explained = sw.explain(system, method, control=CONTROLS[control], fused=fused)
            assert explained == sw.explain(controlled, method, fused=fused)
            assert_listing_is_a_step(controlled, method, v, y, fused=fused)


def assert_listings_of_an_attempt(name: str, fused: bool, some: int | None) -> None:
    system, v, y = made(name)
    system = system.uncontrolled
    pace = a_pace(engine.groups_of(engine.Plan(system, ABLE[0], (MEMBERS,), H)))._replace(own=np.empty((0, MEMBERS)))
    for method in drawn(ABLE, some and 1, name, fused):
        plan = engine.Plan(system, method, (MEMBERS,), H, fused=fused)
        if _core.in_parts(engine.model(plan._replace(fused=False)), MEMBERS, attempts=True):
            continue  # it is not one tape
        if method.has_series and has_branches(system):
            continue  # with numbers, which member a branch is of is not known; runs evaluate the tape
        explained = sw.explain(system, method, attempt=True, fused=fused)
        known, tables = leaves(plan)
        rows = [*v.reshape(-1, MEMBERS), *y.reshape(-1, MEMBERS), *pace.numbers]
        known |= dict(zip(naming.states(plan, True), rows, strict=True)) | {"max_steps": 9.0}
        after = state(explained, plan, evaluate(explained, known, tables))
        if fused:
            following, v1, y1 = evaluated_attempt(plan, 9)(pace, 9, v, y)
        else:
            s = adaptive.Attempted(system.reference_at_step(1.0, system.batch), system.parts(system.batch))
            with np.errstate(all="ignore"):
                following, v1, y1 = engine.attempts(plan, s)(pace, 9.0, v, y)
        assert_computes(after, v1, y1, *following.numbers)
        assert_counted(explained)


@SOME
def test_every_listing_of_an_attempt_is_one(some: int | None) -> None:
    names = [name for name in ADAPTIVE if not name.startswith("thirty-five")]
    for i, name in enumerate(names[::9] if some else names):
        for fused in (i % 2 == 0,) if some else (False, True):
            assert_listings_of_an_attempt(name, fused, some)


#: γ of implicit methods that have no file of coefficients.
GAMMAS = {"linearly_implicit_euler": 1.0, "backward_euler": 1.0, "implicit_midpoint": 0.5, "trapezoidal": 0.5}


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_what_a_method_does_to_blocks(method: sw.Method) -> None:
    """The listing of a step that is no single tape."""
    system, rng = sw.Chain(700), np.random.default_rng(1)
    if method.has_series:  # whose step is always one tape
        refused(UnsupportedError, "take dop853 for a large system", sw.explain, system, method)
        return
    explained = sw.explain(system, method)
    if method.is_implicit:
        system = sw.Chain(20)  # the reference finds derivatives number by number; a listing is the same for chains of any length
    v, y = rng.normal(size=(2, *system.v_shape))
    s, carry = system.scaled(H, ()), method.carry or "v"
    known = {carry: v, "y": y, "h": H, "t": T, "dv": s.dv, "dy": s.dy}
    if method.is_implicit:
        equations = Implicit(s, T, v, y)
        gamma = method.steps.METHOD.gamma if hasattr(method.steps, "METHOD") else GAMMAS[method.name]
        known |= {f"solve_{block}": lambda a, b, i=i: equations.solve(gamma, a, b)[i] for i, block in enumerate("vy")}
        known["square"] = equations.square
        known |= dict(zip(("dv_by_t", "dy_by_t"), equations.by_time(H), strict=True))
        assert "solve_v, solve_y: x of" in str(explained)
    else:
        assert explained.parts == "hand"
        calls = [line.formula[:2] for section in explained.sections for line in section.lines]
        assert calls.count("dv") == method.evaluations
    values = evaluate(explained, known, {})
    for block, after in zip((f"{carry}'", "y'"), method.steps.step(s, T, H, v, y), strict=True):
        np.testing.assert_array_equal(values[block], after)


def assert_computes_lines(section: listing.Section, known: dict[str, Any], names: list[str], wanted: Any) -> None:
    """The lines of these names are what is wanted, number by number."""
    alone = replace(sw.explain(sw.Oscillator(), "rk4"), sections=(section,))
    values = evaluate(alone, known, {})
    assert_computes([np.broadcast_to(values[name], MEMBERS) for name in names], wanted)


@SOME
@pytest.mark.parametrize("fused", [False, True], ids=["plain", "fused"])
def test_every_listing_of_both_ends_and_of_what_is_recorded(fused: bool, some: int | None) -> None:
    for name in SHORT[fused::3] if some else SHORT:
        system, v, y = made(name)
        for method in drawn([m for m in METHODS if m.carry and fits(system, m)], some and 1, name) or METHODS[:1]:
            for start in method.starts or (None,):
                plan = engine.Plan(system, method, (MEMBERS,), H, t0=T, choice=method.start_choice(start), fused=fused)
                if _core.in_parts(engine.model(plan._replace(fused=False)), MEMBERS):
                    continue
                explained = sw.explain(system, method, start=start, fused=fused, record=list(system.quantities))
                assert len(explained.beside) == 2 * bool(method.carry) + len(system.quantities)
                known, _ = leaves(plan)
                tables = naming.parameters(plan)[1]
                tracer = Tracer(system, _core.Tape())
                tracer.scaled(H)
                tables = dict(zip(tables, tracer.tables, strict=True))
                s = system.scaled(H, (MEMBERS,))
                for section in explained.beside:
                    slot = method.carry if section.when == "finish" else "v"
                    rows = [*v.reshape(-1, MEMBERS), *y.reshape(-1, MEMBERS)]
                    blocks = ((slot, system.v_shape), ("y", system.y_shape))
                    labels = [naming.indexed(str(n), i) for n, shape in blocks for i in np.ndindex(shape)]
                    values = known | dict(zip(labels, rows, strict=True)) | {name: table.sample for name, table in tables.items()}
                    makes = {"start": method.carry, "finish": "v"}.get(section.when, section.when.removeprefix("record "))
                    shape = system.quantities.get(str(makes), system.v_shape)
                    results = [naming.indexed(str(makes), i) for i in np.ndindex(shape)]
                    if section.when.startswith("record"):
                        wanted = np.asarray(s.record(section.when.removeprefix("record "), v, y)).reshape(-1, MEMBERS)
                    elif fused:
                        wanted = engine_ends(plan, section.when, v, y)
                    else:
                        wanted = getattr(method.steps, section.when)(s, plan.choice, T, v, y).reshape(-1, MEMBERS)
                    assert_computes_lines(section, values, results, wanted)


def engine_ends(plan: engine.Plan, which: str, v: Any, y: Any) -> Any:
    """What a method carries at the start, or the v that is made of it, with fused multiply-adds by the reference."""
    run = (direct.to_slot if which == "start" else lambda plan, v, y: direct.to_velocity(plan)(T, v, y))(plan, v, y)
    return np.asarray(run).reshape(-1, MEMBERS)


@SOME
def test_every_listing_of_a_transition_matrix_is_a_step(some: int | None) -> None:
    for name in SHORT:
        if made(name)[0].linear:
            for method in drawn([each for each in METHODS if fits(made(name)[0], each)], some and 1, name):
                assert_listing_of_a_transition_matrix(name, method)


def assert_listing_of_a_transition_matrix(name: str, method: sw.Method) -> None:
    system, v, y = made(name)
    explained = sw.explain(system, method, form="matrix")
    if explained.parts is not None:
        assert explained.listing == f"in each step, for each member\n  s' = P·s{' + Q·x' * bool(system.given_inputs())}"
        assert "its products of matrices are made by a loop" in str(explained)
        return
    plan = engine.Plan(system, method, (MEMBERS,), H, t0=T, form="matrix")
    p, q = linear.transition(plan), linear.pulses(plan, system.given_inputs())
    known, samples = leaves(plan, [*p.reshape(-1, MEMBERS), *q.reshape(-1, MEMBERS)])
    rows = [*v.reshape(-1, MEMBERS), *y.reshape(-1, MEMBERS)]
    known |= dict(zip(naming.states(plan, False), rows, strict=True))
    after = state(explained, plan, evaluate(explained, known, samples))
    out = engine.advance(plan, v, y, carried=True)
    assert_computes(after, out.slot, out.y[-1])
    assert_counted(explained)


@pytest.mark.skipif(len(sw.isa_levels()) < 2, reason="no machine code here")
def test_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    level, width, registers = ("neon", 2, 32) if "neon" in sw.isa_levels() else ("avx2", 4, 16)
    monkeypatch.setenv("STEPWELL_KERNELS", level)
    explained = sw.explain(sw.Oscillator(), "false_euler", members=1000)
    code = explained.code
    assert code is not None
    assert (explained.level, explained.interpreted_because, code.width, code.registers) == (level, None, width, registers)
    assert explained.lanes == code.width * code.vectors * code.turns
    assert code.resident
    assert code.size > 50
    assert code.spills == 0
    many = sw.explain(sw.NBody(), "rk4", members=1000)
    assert many.code is not None
    assert many.code.spills > 0
    assert f"{many.code.spills} values beside them" in str(many)
    lone = sw.explain(sw.Oscillator(), "false_euler").code
    assert lone is not None
    assert (lone.width, lone.vectors, lone.turns) == (1, 1, 1)


def test_interpreted_if_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STEPWELL_KERNELS", "interpret")
    explained = sw.explain(sw.Oscillator(), "false_euler")
    assert (explained.level, explained.code) == ("interpret", None)
    assert explained.interpreted_because is not None
    wanted = "STEPWELL_KERNELS" if len(sw.isa_levels()) > 1 else "this CPU"
    assert wanted in explained.interpreted_because
    assert "It is interpreted, one member at a time: " in str(explained)
    assert "between them is interpreted" in str(sw.explain(sw.Chain(1000), "rk4"))


def test_large_systems() -> None:
    chain = sw.explain(sw.Chain(1000), "rk4")
    assert (chain.parts, chain.written, chain.computed, chain.code) == ("hand", {}, {}, None)
    assert "a step of Chain(1000), 1 member\n" in str(chain)
    assert "of about 24000 operations" in str(chain)
    bodies = sw.explain(sw.NBody(np.ones(60)), "rk4", members=100)
    assert bodies.parts == "rates"
    assert "the rates are a tape of their own" in str(bodies)


def test_text_and_html() -> None:
    explained = sw.explain(sw.Oscillator([1.0, 2.0]), "verlet", fused=True)
    text, html = str(explained), explained._repr_html_()
    assert text.startswith(
        "Verlet: a step of Oscillator(omega=array(2,), form='canonical'), 2 members, with fused multiply-adds\n"
    )
    assert "y_prev: what is carried in place of v between steps" in text
    assert "fma(a, b, c) = a·b + c, rounded once" in text
    assert '<td style="text-align:left">y_prev&#x27;</td>' in html
    assert html.count("<table>") == html.count("</table>") == 2
    assert "<" not in re.sub(r"</?(p|b|table|tr|td|th)( [^>]*)?>", "", html)
    less = sw.explain(sw.Oscillator(), "merson", attempt=True)._repr_html_()
    assert "0 &lt; extra" in less


def test_json(tmp_path: Path) -> None:
    explained = sw.explain(sw.Oscillator(), "false_euler")
    explained.to_json(tmp_path / "step.json")
    data = json.loads((tmp_path / "step.json").read_text(encoding="utf-8"))
    assert data == explained.as_dict() | {"sections": data["sections"], "beside": []}
    first = {"name": "v'", "formula": "v − Φ·y", "operations": {"additions": 1, "multiplications": 1}, "note": ""}
    assert data["sections"][3]["lines"][0] == first


def test_an_attempt_under_control_is_explained() -> None:
    """The push is in the listing, with the step of the attempt, and the energy that it adds."""
    bodies = sw.NBody([1.0, 1.0], force="newton")
    free, controlled = (sw.explain(bodies, "merson", attempt=True, control=each) for each in (None, sw.EnergyControl(0.1)))
    assert "control.gain" in str(controlled.listing)
    assert re.search(r"work' += work \+|work' += a\d+", str(controlled.listing))
    assert sum(controlled.computed.values()) > sum(free.computed.values())


def test_what_cannot_be_explained_says_so() -> None:
    free, bodies, single = sw.Oscillator(), sw.NBody(), {"dtype": "float32"}
    relative, sampled = sw.EnergyControl(relative=0.1), sw.Oscillator(a=sw.Sampled([1.0, 2.0], 1.0))
    of_shapes, of_types = sw.errors.ShapeError, sw.errors.DTypeError
    cases: list[tuple[Any, str, dict[str, Any], type[Exception], str]] = [
        (bodies, "rk4", {"members": 3, "control": sw.EnergyControl([0.1, 0.2])}, of_shapes, "batch shapes do not broadcast"),
        (sw.Oscillator([1.0, 2.0]), "rk4", {"members": 3}, ArgumentError, "members: expected a multiple .* batch of 2, got 3"),
        (free, "rk4", {"attempt": True}, UnsupportedError, "attempt: rk4 does not estimate its error"),
        (bodies, "merson", {"attempt": True, "control": relative}, UnsupportedError, "give gain in place of relative"),
        (free, "rk4", {"control": sw.EnergyControl(0.1)}, UnsupportedError, r"control: .* has no energy control"),
        (sw.Oscillator(1.0, 0.1), "verlet", {}, UnsupportedError, "verlet needs forces"),
        (free, "rk4", {"form": "matrix", "fused": True}, UnsupportedError, "form: form='matrix' goes without fused="),
        (sw.Pendulum(), "rk4", {"form": "matrix"}, UnsupportedError, "form: only linear systems have a transition matrix"),
        (free, "rk4", {"form": "power"}, ArgumentError, r"form: .*Known: direct, matrix"),
        (bodies, "rk4", {"record": "enrgy"}, ArgumentError, r"record: .*did you mean 'energy'"),
        (sw.LinearSystem([[0.0]]), "rk4", {"record": "energy"}, UnsupportedError, "record: nothing can be recorded of Linear"),
        (free, "rk4", {"fused": "yes"}, of_types, "fused: expected True or False"),
        (free, "merson", single | {"attempt": True}, UnsupportedError, "attempt: in float32 an attempt is two lists"),
        (free, "taylor", single, UnsupportedError, "dtype: float32 does not work with taylor"),
        (bodies, "rk4", single | {"record": "energy"}, UnsupportedError, "record: float32 runs compute it of the saved states"),
        (sampled, "rk4", single, UnsupportedError, "dtype: a listing has numbers of one width"),
        (sw.NBody(np.ones(200)), "rk4", single, ArgumentError, "is too long; float32 works with steps of up to 100000"),
    ]
    for system, method, options, error, message in cases:
        refused(error, message, sw.explain, system, method, **options)


def test_numbers_are_the_shortest_that_are_read_as_them() -> None:
    assert "v'  = v + 0.16666667·(2·(−a1 − a3 − a4) − Φ·(y + dy3))" in lines(sw.explain(sw.Oscillator(), "rk4", dtype="float32"))
    assert number(0x3E2AAAAB, single=True).text == "0.16666667"
    assert number(0xCB400000, single=True).text == "−12582912"
    assert number(0x7F800000, single=True).text == "∞"
    assert number(0x7FC00000, single=True).text == "0x7fc00000"
    # A listing with the constants of float64 would be another step.
    assert float(np.float32(1 / 6)) != 1 / 6
    for bits in np.random.default_rng(1).integers(0, 0x7F800000, 1000):
        text = number(int(bits), single=True).text
        assert np.float32(text).view(np.uint32) == bits


def test_the_kernel_is_that_of_float32() -> None:
    """Vectors of as many bytes hold twice as many members."""
    wide, half = (sw.explain(sw.Oscillator(), "rk4", members=10_000, dtype=dtype) for dtype in ("float64", "float32"))
    assert (wide.dtype, half.dtype) == ("float64", "float32")
    assert half.title.endswith(", in float32")
    if wide.code is not None:
        assert half.code is not None
        assert half.code.width == 2 * wide.code.width
        assert half.code.size > 0
    assert half.as_dict()["dtype"] == "float32"
    assert wide.computed == half.computed
    pendulum = sw.explain(sw.Pendulum(), "rk4", dtype=np.float32)
    assert pendulum.computed["additions"] < sw.explain(sw.Pendulum(), "rk4").computed["additions"]  # of shorter polynomials


def test_both_ends_of_what_is_carried() -> None:
    explanation = sw.explain(sw.Pendulum(), "verlet", dtype="float32")
    assert [each.when for each in explanation.beside] == ["start", "finish"]
    assert all("12582912" in " ".join(line.formula for line in each.lines) for each in explanation.beside)


def test_the_command(capsys: Any) -> None:
    assert cli.main(["explain", "Pendulum", "false_euler", "--float32"]) == 0
    assert capsys.readouterr().out.startswith("False Euler: a step of Pendulum(omega=1.0), 1 member, in float32")


writes_vectors = pytest.mark.skipif(_core.isa() not in ("avx2", "avx512"), reason="no vectors of one member are written")


def packing(system: sw.System, method: str, **options: Any) -> sw.explanation.Packing | None:
    code = sw.explain(system, method, **options).code
    return None if code is None else code.packing


@writes_vectors
def test_why_operations_of_one_member_are_packed_or_not() -> None:
    """Three pairs in the plane are; a chain of operations is not; of several members and of too short a step nothing is said."""
    three = sw.NBody(np.ones(3), force="newton")
    packed = packing(three, "leapfrog")
    assert packed is not None
    assert packed.used
    # Of each of three pairs 2 differences, 2 squares, 2 sums, a root, its product, a quotient, and 2 and 4 products with masses
    # and differences; of each velocity a difference and a sum, of each place a product and a sum: 3 · 15 + 6 · 2 + 6 · 2.
    assert packed.operations == sum(sw.explain(three, "leapfrog").computed.values()) == 69
    assert packed.vectors < 69
    assert packed.cycles is not None
    assert packed.chain_cycles <= packed.cycles <= 0.96 * packed.single_cycles
    text = sw.explain(three, "leapfrog").machine
    assert f"Equal operations are lanes of one vector: {packed.vectors} vectors for 69 operations, {packed.moves} of them" in text
    chain = packing(sw.Oscillator(1.0), "rk4")
    assert chain is not None
    assert not chain.used
    assert chain.cycles is None
    # Each of four stages is a product and a sum or two, of 3 cycles each: no order of them takes fewer.
    assert chain.chain_cycles >= 4 * 2 * 3
    assert "not packed into vectors: nearly all of its" in sw.explain(sw.Oscillator(1.0), "rk4").machine
    assert packing(sw.Oscillator(1.0), "false_euler") is None
    assert packing(sw.NBody(np.ones((3, 5)), force="newton"), "leapfrog") is None


@writes_vectors
def test_packed_steps_have_the_bits_of_the_reference() -> None:
    """A world is packed from its first step on; the reference does number by number what is on the tape."""
    random = np.random.default_rng(3)
    for bodies, dim, method in [(3, 2, "leapfrog"), (3, 3, "rk4"), (4, 3, "false_euler"), (6, 3, "pefrl")]:
        system = sw.NBody(random.uniform(0.5, 1.5, bodies), force="newton", softening=0.1)
        assert (packed := packing(system.__class__(np.ones(bodies), force="newton"), method)) is not None
        assert packed.used
        v, y = random.normal(size=(2, bodies, dim))
        world = sw.World(system, method, v=v.copy(), y=y.copy(), dt=0.01)
        world.step(50)
        run = sw.integrate(system, method, v=v, y=y, dt=0.01, steps=50, every=None, backend="numpy")
        assert np.array_equal(world.y, run.y[-1])
        assert np.array_equal(world.v, run.v[-1])


def test_a_run_that_changes_to_packed_code_keeps_its_bits() -> None:
    """After 12 000 steps of a kernel that no other test has; a world, made afterwards, has packed code from its first step on."""
    system = sw.NBody([1.0, 2.0, 3.0], force="printed", softening=1.0)
    start = np.array([[0.0, 1.0], [1.0, -0.2], [-1.0, 0.1]])
    run = sw.integrate(system, "damped_euler", v=np.zeros((3, 2)), y=start, dt=1e-4, steps=70_000)
    world = sw.World(system, "damped_euler", v=np.zeros((3, 2)), y=start.copy(), dt=1e-4)
    for _ in range(7):
        world.step(10_000)
    assert np.array_equal(run.y[-1], world.y)
    assert np.array_equal(run.v[-1], world.v)


# Implicit steps: in listings and in exported code the parts of the elimination have names.
def test_every_part_has_its_name() -> None:
    """Of each solve the unknowns; numbers of rates begin at 1, although derivatives evaluate them, too."""
    for method in sw.methods():
        if not method.is_implicit:
            continue
        ways: list[dict[str, Any]] = [{}, {"dtype": "float32"}]
        if method.error_order is not None:
            ways.append({"attempt": True})
        solves = {"rosenbrock23": 2, "rodas4": 6, "rodas5p": 8, "linearly_implicit_euler": 1}.get(method.name, 3)
        for options in ways:
            lines = {line.name: line for section in sw.explain(pair(), method, **options).sections for line in section.lines}
            parts = ["matrix[0,1]", "exchange[0,1]", "reciprocal[0]", "reciprocal[1]", "factor[1,0]"]
            parts += [] if "attempt" in options else ["dy1[0]", "dy1[1]"]
            parts += [f"solution{i}[1]" for i in range(1, solves)]
            assert [name for name in parts if name not in lines] == [], (method, options)
            assert lines["exchange[0,1]"].formula == "|matrix[0,0]| < |matrix[1,0]|", (method, options)


def test_a_system_of_second_order_solves_for_its_velocities() -> None:
    listing = sw.explain(sw.Pendulum(1.0, 0.1), "trapezoidal").listing
    assert "  reciprocal[0] = 1/(" in listing
    assert "solution1[0]" in listing
    assert "exchange" not in listing
    assert "solution1[1]" not in listing


def test_exported_steps_have_the_same_names() -> None:
    for language in LANGUAGES:
        source = sw.export(pair(), "rosenbrock23", language, dt=0.1).source
        for part in ("matrix_0_1", "exchange_0_1", "reciprocal_1", "factor_1_0", "solution1_1", "solution2_0"):
            assert part in source, language

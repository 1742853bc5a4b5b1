"""What tests of explain share."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import stepwell as sw
from stepwell import _core
from stepwell.reference.bits import DOUBLE, SINGLE, Precision
from stepwell.reference.fma import fma
from stepwell.reference.traced import Tracer
from stepwell.runs import engine
from stepwell.source.explanation import naming

from support.tracing import MEMBERS, H, T


def lines(explained: sw.Explanation) -> list[str]:
    return [line.strip() for line in explained.listing.splitlines()]


#: What is done with bits.
ON_BITS = {
    "and_bits": np.bitwise_and,
    "or_bits": np.bitwise_or,
    "xor_bits": np.bitwise_xor,
    "add_bits": np.add,
    "sub_bits": np.subtract,
    "shift_up": np.left_shift,
    "shift_down": np.right_shift,
}


def functions(precision: Precision) -> dict[str, Any]:
    """What a formula calls, for numbers of this precision."""
    number, whole = (np.float32, np.uint32) if precision is SINGLE else (np.float64, np.uint64)

    def as_bits(x: Any) -> Any:
        if isinstance(x, int):
            return whole(x)
        x = np.asarray(x)
        return np.where(x, whole(precision.all_bits), whole(0)) if x.dtype == bool else x.astype(number).view(whole)

    def on_bits(f: Any) -> Any:
        return lambda *of: np.asarray(f(*map(as_bits, of))).view(number)

    others = {"sqrt": np.sqrt, "floor": np.floor, "fma": fma, "magnitude": np.abs}
    return others | {name: on_bits(f) for name, f in ON_BITS.items()}


#: By dtype the type of constants, and what formulas call.
ARITHMETIC: dict[str, tuple[Any, dict[str, Any]]] = {
    "float64": (np.float64, functions(DOUBLE)),
    "float32": (np.float32, functions(SINGLE)),
}


COMPARED = {ast.Lt: np.less, ast.LtE: np.less_equal, ast.Eq: np.equal}


DONE = {ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide}


def _value(node: Any, known: dict[str, Any], dtype: str) -> Any:
    """Of Python's grammar, but that a choice takes one of two arrays number by number."""
    of = lambda each: _value(each, known, dtype)  # noqa: E731
    number, called = ARITHMETIC[dtype]
    match node:
        case ast.Constant():
            return number(node.value)
        case ast.Name():
            return known[node.id]
        case ast.UnaryOp(op=ast.USub()):
            return np.negative(of(node.operand))
        case ast.UnaryOp(op=ast.Not()):
            return np.logical_not(of(node.operand))
        case ast.BinOp():
            return DONE[type(node.op)](of(node.left), of(node.right))
        case ast.Compare(ops=[op], comparators=[right]):
            return COMPARED[type(op)](of(node.left), of(right))
        case ast.BoolOp(values=truths):
            return (np.logical_and if isinstance(node.op, ast.And) else np.logical_or).reduce(
                np.broadcast_arrays(*map(of, truths))
            )
        case ast.IfExp():
            return np.where(of(node.test), of(node.body), of(node.orelse))
        case ast.Call() if node.func.id.endswith("_bits") or node.func.id.startswith("shift"):  # whose constants are bits
            return called[node.func.id](*(each.value if isinstance(each, ast.Constant) else of(each) for each in node.args))
        case ast.Call():
            return known.get(node.func.id, called.get(node.func.id))(*map(of, node.args))
    raise AssertionError(ast.dump(node))


#: A name in a formula, with a place in an array behind it, or, of a sampled input, with the name of the number of a sample.
NAME = re.compile(r"(?<![\w.])([^\W\d][\w.]*'?(?:\[\d+(?:,\d+)*\])?(?:\.\w+)*)(?:\[([^\W\d]\w*)\])?")


SIGNS = (("·", "*"), ("−", "-"), ("√", "sqrt"), ("≤", "<="), (" = ", " == "), ("∞", "1e999"))


def evaluate(explained: sw.Explanation, known: dict[str, Any], tables: dict[str, Any]) -> dict[str, Any]:
    """The values of all lines, by name, from the texts of their formulas."""
    values, out = dict(known), {}
    values |= {
        f"look up {name}": lambda at, samples=samples: samples[np.asarray(at, dtype=int)] for name, samples in tables.items()
    }
    places = {name: f"name_{i}" for i, name in enumerate(values)}

    def plain(match: re.Match[str]) -> str:
        name, of = match.groups()
        return places.get(name, name) if of is None else f"{places[f'look up {name}']}({places[of]})"

    numbered = {places[name]: value for name, value in values.items()}
    with np.errstate(all="ignore"):
        for section in explained.sections:
            for line in section.lines:
                text = NAME.sub(plain, line.formula)
                for sign, python in SIGNS:
                    text = text.replace(sign, python)
                text = re.sub(r"\|([^|]+)\|", r"magnitude(\1)", text)
                assert line.name not in places, f"{line.name} twice"
                places[line.name] = f"name_{len(places)}"
                out[line.name] = numbered[places[line.name]] = _value(
                    ast.parse(text, mode="eval").body, numbered, explained.dtype
                )
    return out


def leaves(plan: engine.Plan, before: Sequence[Any] = ()) -> tuple[dict[str, Any], dict[str, Any]]:
    """What stands behind the names of parameters, and samples by the name of their table; a row of each for every member.

    Before the parameters of inputs there are those of a step, or, of a transition matrix, its elements.
    """
    names, tables = naming.parameters(plan)
    tracer = Tracer(plan.system, _core.Tape())
    if before:
        tracer.symbols([each.signal() for each in plan.system.given_inputs().values()], (MEMBERS,))
    else:
        tracer.scaled(H)
    known = dict(zip(names, [*before, *tracer.numbers], strict=True)) | {"h": H, "t": T}
    samples, first = {}, 0
    for name, table in zip(tables, tracer.tables, strict=True):
        values = np.asarray(table.values)
        known |= {f"{name}.start": table.start, f"{name}.interval": table.interval, f"{name}.last": len(values) - 1.0}
        known |= {f"{name}.first": float(first)}
        samples[name] = values
        first += len(values)
    wide = [np.broadcast_to(each.reshape(len(each), -1), (len(each), MEMBERS)) for each in samples.values()]
    every = np.concatenate(wide) if wide else np.zeros((0, MEMBERS))
    known |= {"lanes": 1.0, "sample": lambda at: every[np.broadcast_to(at, MEMBERS).astype(int), np.arange(MEMBERS)]}
    return known, samples

"""What an implicit step computes, as it is read: in listings and in exported code the parts of the elimination have names."""

from __future__ import annotations

from typing import Any

import stepwell as sw
from support.export import LANGUAGES, pair


def test_a_step_is_read_from_top_to_bottom() -> None:
    assert sw.explain(pair(), "linearly_implicit_euler").listing == (
        "once a run\n"
        "  c1            = h·k\n"
        "  matrix[1,0]   = −c1\n"
        "  c2            = −h\n"
        "  matrix[0,0]   = c1 + 1\n"
        "  matrix[1,1]   = h + 1\n"
        "  exchange[0,1] = |matrix[0,0]| < |matrix[1,0]|\n"
        "  reciprocal[0] = 1/(matrix[1,0] if exchange[0,1] else matrix[0,0])\n"
        "  factor[1,0]   = (matrix[0,0] if exchange[0,1] else matrix[1,0])·reciprocal[0]\n"
        "in each step\n"
        "  a1            = k·y[0]\n"
        "  dy1[0]        = h·(y[1]·y[1] − a1)\n"
        "  dy1[1]        = h·(a1 − y[1])\n"
        "  matrix[0,1]   = c2·(y[1] + y[1])\n"
        "  a2            = matrix[1,1] if exchange[0,1] else matrix[0,1]\n"
        "  reciprocal[1] = 1/((matrix[0,1] if exchange[0,1] else matrix[1,1]) − factor[1,0]·a2)\n"
        "  a3            = dy1[1] if exchange[0,1] else dy1[0]\n"
        "  solution1[1]  = reciprocal[1]·((dy1[0] if exchange[0,1] else dy1[1]) − factor[1,0]·a3)\n"
        "  solution1[0]  = reciprocal[0]·(a3 − a2·solution1[1])\n"
        "  y'[0]         = y[0] + solution1[0]\n"
        "  y'[1]         = y[1] + solution1[1]"
    )


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

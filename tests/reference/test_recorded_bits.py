"""The bits of runs that were recorded with the core that was compiled ahead of time, kernel by kernel, are those of today."""

import pytest
import stepwell as sw
from support import recorded

RUNS = recorded.runs()
WRITTEN = recorded.written()


@pytest.mark.parametrize("part", range(8))
def test_the_bits_are_those_that_were_recorded(part: int) -> None:
    wrong = []
    for name in sorted(WRITTEN)[part::8]:
        assert name in RUNS, f"{name}: recorded, but no run of that name is made any more"
        bits, values = recorded.hashes(recorded.made(RUNS[name]))
        if bits != WRITTEN[name][0]:
            same = values == WRITTEN[name][1]
            wrong.append(f"{name}: {'the values are the same, but the sign of a zero is another' if same else 'other values'}")
    assert not wrong


def test_so_many_are_recorded() -> None:
    """What a new method or system adds is recorded when somebody writes it down; what was recorded stays."""
    assert len(WRITTEN) >= 701


def test_every_method_and_every_variant_is_recorded() -> None:
    """In as many combinations as tell a fault of one from a fault of the other."""
    drawn = recorded.drawn()
    assert {case.start for case in drawn if case.method == "verlet"} == set(sw.method("verlet").starts)
    for system in recorded.SYSTEMS:
        assert len({case.method for case in drawn if case.system == system}) >= 4, system
    for method in recorded.METHODS:
        mine = [case for case in drawn if case.method == method]
        assert len({case.system for case in mine}) >= 10, method
        assert {case.form for case in mine} == {"direct", "matrix"}, method

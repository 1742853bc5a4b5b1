"""Every method, system, control and record that the comparison of graphs covers has the bits of the core on a device of OpenCL.

That comparison shows that core and reference are one graph; these runs show that what is printed of the graph and compiled
computes it, among them with infinite, subnormal and missing numbers. Of thousands of runs, most of a second, few are made that
show every method, every family of systems, every control and record; by ``make test-long`` those that show each of them with
all kinds of numbers and steps, and the others.
"""

from __future__ import annotations

import importlib
from collections import OrderedDict

import numpy as np
import pytest
from stepwell.device import fixed, printer
from stepwell.errors import ArgumentError
from support import ROOT, device_proof, families
from support.device_proof import Proof
from support.devices import assert_same, needs_device

pytestmark = needs_device

CHOSEN = device_proof.chosen()
#: Each method, family, control, record and kind of numbers once; the long run has the pairs of them.
FEW = device_proof.few(CHOSEN)


def assert_proven(proof: Proof) -> None:
    """The run of the device is that of the core; what the core refuses is refused in the same words."""
    if refusal := proof.refusal():
        assert proof.refusal("opencl") == refusal, proof
        return
    try:
        got, core = proof.runs()
    except ArgumentError as error:
        if "float32 works with steps of up to" not in str(error):  # which is found when the step is traced, by both
            raise
        return
    assert_same(got, core, "t", "v", "y", "first_bad_step", "status", "work", "carry")
    assert got.recorded.keys() == core.recorded.keys()
    pairs = [(name, got.recorded[name], each) for name, each in core.recorded.items()]
    if core.paces is not None and got.paces is not None:
        pairs += zip(core.paces._fields, got.paces, core.paces, strict=True)
    for name, one, other in pairs:
        wrong = (one != other) & ~(np.isnan(one) & np.isnan(other))
        assert not wrong.any(), (str(proof), name, np.argwhere(wrong)[:3].tolist(), one[wrong][:3], other[wrong][:3])


@pytest.mark.parametrize("proof", families.family([(each,) for each in sorted(CHOSEN, key=str)], FEW.__contains__, ids=str))
def test_some(proof: Proof) -> None:
    assert_proven(proof)


@pytest.mark.long
@pytest.mark.parametrize("name", device_proof.SYSTEMS if families.LONG else [])
def test_all(name: str) -> None:
    """Every run of a system whose step is short enough."""
    for proof in device_proof.every():
        if proof.system == name and proof not in CHOSEN and proof.operations() <= device_proof.MOST:
            assert_proven(proof)


def test_every_method_family_control_and_record_is_among_the_chosen() -> None:
    """What the others could show beside, those of long steps left out, is nothing."""
    shown = {each for proof in CHOSEN for each in proof.shows()}
    missing = {each for proof in device_proof.every() for each in proof.shows() if each not in shown}
    assert not missing
    assert {each for proof in FEW for each in proof.parts()} == {each for proof in CHOSEN for each in proof.parts()}


@pytest.mark.mutant
def test_a_wrong_statement_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(printer.ARITHMETIC, "subtract", "{} + -{} * (real)1.0000001")
    monkeypatch.setattr(fixed, "_TEXTS", OrderedDict())  # the text of that run may be there already
    proof = next(each for each in sorted(CHOSEN, key=str) if each.method == "rk4" and not each.single)
    with pytest.raises(AssertionError):
        assert_proven(proof)


@pytest.mark.long
@pytest.mark.parametrize(
    "option", ["device", "tolerance", "resume", "events", "force", "float32", "energy", "own t0", "projection"]
)
def test_the_page_of_options_is_that_of_a_device(option: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is written without one: what a device refuses, and what it makes, is what the page says."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    options = importlib.import_module("options")
    names = ("device",) if option == "device" else (option, "device")
    for kind in options.KINDS:
        with options.anywhere():
            expected = options.refusal(kind, names)
        assert options.refusal(kind, names) == expected, kind.name

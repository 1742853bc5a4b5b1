"""The benchmark of growth measures what it says: equations of so many operations, in the form that it names."""

import pytest
import stepwell as sw
from stepwell import _core
from stepwell.runs import engine

from benches import growth
from benches.compile import arithmetic


def test_ladders_forms_and_times(monkeypatch):
    rungs = growth.ladder(1, 1000)
    assert (rungs[0], rungs[-1]) == (1, 1000)
    assert rungs == sorted(set(rungs))
    # Of 100 000 lines of a tape; n operations of this equation take 3n/2 lines, as each product has a number of its own.
    assert growth.form_of(growth.of_length(66_000)(), "false_euler") == "one tape"
    assert growth.form_of(growth.of_length(67_000)(), "false_euler") == "rates"
    times = iter([0.0, 3.0, 10.0, 11.0, 20.0, 25.0])
    monkeypatch.setattr(growth.time, "process_time", lambda: next(times))
    assert growth.least(lambda: None, 3) == 1.0


@pytest.mark.parametrize("n", [10, 100, 1000])
def test_an_equation_has_so_many_operations(n):
    """n of the loop, one behind it, and of False Euler a product with h and a sum for each block: 5 more."""
    # The first factor is 1, and y·1 is not computed; a product of constants may be computed before the steps.
    system = growth.of_length(n)()
    kernel = _core.compiled(engine.model(engine.Plan(system, sw.method("false_euler"), (), 1e-3)), 1)
    assert n - 1 <= arithmetic(kernel["computed"]) <= n + 5

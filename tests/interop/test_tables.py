"""Runs as tables of xarray and pandas."""

import sys
from typing import Any

import numpy as np
import pytest
import stepwell as sw
from stepwell.errors import ArgumentError, ShapeError, UnsupportedError
from support import own_systems as own
from support.for_each import for_each
from support.refusals import refused

OMEGA = np.array([1.0, 2.0, 3.0])


def sweep(**options: Any) -> sw.Run:
    return sw.integrate(sw.Oscillator(OMEGA), "rk4", v=0.0, y=1.0, dt=0.1, steps=10, every=5, **options)


def test_a_dataset_shares_the_arrays_of_the_run() -> None:
    pytest.importorskip("xarray")
    run = sweep(record="energy")
    table = run.to_xarray(dims=["omega"], coords={"omega": OMEGA})
    assert dict(table.sizes) == {"t": 3, "omega": 3}
    for name, array in {"v": run.v, "y": run.y, "energy": run.recorded["energy"], "status": run.status}.items():
        assert np.shares_memory(table[name].values, array), name
    assert table.y.sel(omega=2.0, t=1.0).item() == run.y[-1, 1]
    np.testing.assert_array_equal(table.t, run.t)
    assert table.attrs["method"] == "rk4"
    assert table.attrs["dt"] == 0.1
    assert "Oscillator" in table.attrs["system"]


@for_each(
    ("make", "v_dims", "y_dims"),
    [
        (lambda: sw.integrate(sw.Oscillator(), "rk4", v=0.0, y=1.0, dt=0.1, steps=4, every=2), ("t",), ("t",)),
        (lambda: sw.scenes.figure_eight().run("rk4", steps=4, every=2), ("t", "bodies", "dim"), ("t", "bodies", "dim")),
        (lambda: sw.scenes.dzhanibekov().run("rk4", steps=4, every=2), ("t", "v_component"), ("t", "y_component")),
        (
            lambda: sw.integrate(sw.Chain(3), "rk4", v=0.0, y=np.ones((3, 2, 4)), dt=0.1, steps=4),
            *(("t", "component", "member_0", "member_1"),) * 2,
        ),
        (
            lambda: sw.integrate(own.springs, "rk4", v=0.0, y=np.ones((5, 3)) * np.arange(5.0)[:, None], dt=0.1, steps=4),
            *(("t", "component_0", "component_1"),) * 2,
        ),
    ],
)  # fmt: skip
def test_axes_have_names(make: Any, v_dims: tuple[str, ...], y_dims: tuple[str, ...]) -> None:
    pytest.importorskip("xarray")
    run = make()
    table = run.to_xarray()
    assert table.v.dims == v_dims
    assert table.y.dims == y_dims
    np.testing.assert_array_equal(table.y.values, run.y)


def test_first_order_has_no_velocities() -> None:
    pytest.importorskip("xarray")
    pytest.importorskip("pandas")
    run = sw.integrate(own.lorenz, "rk4", y=np.ones(3), dt=0.01, steps=10, every=5)
    assert "v" not in run.to_xarray()
    assert list(run.to_dataframe().columns) == ["y_0", "y_1", "y_2"]


def test_adaptive_steps_are_counted() -> None:
    pytest.importorskip("xarray")
    run = sw.integrate(sw.Pendulum(), "dop853", v=0.0, y=[1.0, 2.0], tolerance=1e-6, at=[1.0, 2.0])
    table = run.to_xarray()
    assert run.paces is not None
    np.testing.assert_array_equal(table.evaluations, run.paces.evaluations)
    assert "dt" not in table.attrs


def test_a_dataset_can_be_written(tmp_path: Any) -> None:
    """Attributes are what files can hold."""
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    run = sweep(record="energy")
    run.to_xarray().to_zarr(tmp_path / "sweep.zarr", consolidated=False)
    back = xarray.open_zarr(tmp_path / "sweep.zarr", consolidated=False)
    np.testing.assert_array_equal(back.y, run.y)
    assert back.attrs == run.to_xarray().attrs


def test_a_frame_has_a_row_for_each_state_of_each_member() -> None:
    pytest.importorskip("pandas")
    run = sweep(record="energy")
    table = run.to_dataframe()
    assert list(table.columns) == ["v", "y", "energy"]
    assert table.index.names == ["t", "member"]
    assert len(table) == 9
    for i, member in np.ndindex(3, 3):
        assert tuple(table.loc[(run.t[i], member), ["y", "energy"]]) == (run.y[i, member], run.energy[i, member])
    assert run.to_dataframe(dims="omega").index.names == ["t", "omega"]


def test_a_frame_of_a_single_member_is_indexed_by_time() -> None:
    pytest.importorskip("pandas")
    run = sw.scenes.figure_eight().run("rk4", steps=4, every=2, record=["energy", "momentum"])
    table = run.to_dataframe()
    assert table.index.name == "t"
    np.testing.assert_array_equal(table["y_2_1"], run.y[:, 2, 1])
    np.testing.assert_array_equal(table["momentum_1"], run.recorded["momentum"][:, 1])
    assert table.attrs["method"] == "rk4"


def test_a_frame_of_two_batch_axes() -> None:
    pytest.importorskip("pandas")
    run = sw.integrate(sw.Oscillator(OMEGA), "rk4", v=0.0, y=np.array([[1.0], [2.0]]), dt=0.1, steps=10)
    table = run.to_dataframe()
    assert table.index.names == ["t", "member_0", "member_1"]
    assert table.loc[(1.0, 1, 2), "y"] == run.y[-1, 1, 2]


def test_wrong_names() -> None:
    pytest.importorskip("xarray")
    pytest.importorskip("pandas")
    several = "dims: expected a name for each of the 1 batch axes"
    for dims, error, match in (
        (["a", "b"], ShapeError, several),
        ([1], ShapeError, several),
        (["t"], ArgumentError, "dims: expected different names, none of them 't'"),
    ):
        for make in (sweep().to_xarray, sweep().to_dataframe):
            refused(error, match, make, dims)
    refused(ArgumentError, "coords: expected names of their own, got y", sweep().to_xarray, coords={"y": OMEGA})


@for_each("package", ["xarray", "pandas"])
def test_a_package_that_is_missing_is_named(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    run = sweep()
    with pytest.raises(UnsupportedError, match=rf"needs {package}, which is not installed; pip install 'stepwell\[tables\]'"):
        (run.to_xarray if package == "xarray" else run.to_dataframe)()

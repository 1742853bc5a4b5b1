//! The Python binding: arrays in, arrays out, the GIL released, errors mapped. No arithmetic and no decisions here.

mod model;
mod tape;
mod world;

use numpy::{PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2, PyReadwriteArrayDyn};
use pyo3::{exceptions::PyKeyboardInterrupt, prelude::*, types::PyDict};
use stepwell_core::{
    error::Error,
    isa::Level,
    method::{Needs, Record},
    run::{
        Machine,
        batch::{self, Arrays, Plan},
        chosen,
        stage::Clock,
    },
    spec::Row,
    steppers, systems as kinds,
};

use model::{ModelSpec, by_row, core_error};

/// Everything that a method says of itself.
fn describe<'py>(py: Python<'py>, r: &Record) -> PyResult<Bound<'py, PyDict>> {
    let d = PyDict::new(py);
    let program = r.program();
    d.set_item("name", r.name)?;
    d.set_item("title", r.title)?;
    d.set_item("other_names", r.other_names)?;
    d.set_item("false_friends", r.false_friends)?;
    d.set_item("order", r.order)?;
    d.set_item("evaluations", program.evaluations())?;
    d.set_item("family", r.family)?;
    d.set_item("limit", r.limit)?;
    d.set_item("nodes", program.nodes(r.needs == Needs::Rates))?;
    d.set_item("needs_acceleration", r.needs == Needs::Acceleration)?;
    d.set_item("carry", r.carry.as_ref().map(|c| c.name))?;
    d.set_item("starts", r.carry.as_ref().map_or(&[][..], |c| c.starts))?;
    d.set_item("error_order", r.estimate.as_ref().map(|e| e.order))?;
    d.set_item("section", r.section)?;
    d.set_item("reference", r.reference)?;
    d.set_item("about", r.about)?;
    Ok(d)
}

/// The records of all methods, by name.
#[pyfunction]
fn catalogue(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    steppers::RECORDS.iter().map(|r| describe(py, r)).collect()
}

/// The names of all systems that the core has.
#[pyfunction]
fn systems() -> Vec<&'static str> {
    kinds::KINDS.iter().map(|kind| kind.name).collect()
}

/// The CPU level in use.
#[pyfunction]
fn isa() -> PyResult<&'static str> {
    Level::choose().map(Level::name).map_err(core_error)
}

/// The CPU levels that this machine has, ascending.
#[pyfunction]
fn isa_levels() -> Vec<&'static str> {
    Level::available().into_iter().map(Level::name).collect()
}

/// The steps, counted from the first, at which a run keeps its state.
#[pyfunction]
#[pyo3(signature = (steps, every))]
fn saves(steps: i64, every: Option<i64>) -> Vec<i64> {
    batch::saves(steps, every).collect()
}

/// Makes a run from the rows of `v` and `y`, each of one number or one per member, and fills what is kept.
#[pyfunction]
#[pyo3(signature = (model, *, t0, dt, start, first, steps, every, threads, carried, v, y, saved_v, saved_y, recorded, tally, carry, first_bad, progress))]
#[allow(clippy::too_many_arguments, reason = "a flat boundary; the callers on both sides have structures")]
fn run(
    py: Python<'_>,
    model: &ModelSpec,
    t0: f64,
    dt: f64,
    start: usize,
    first: i64,
    steps: i64,
    every: Option<i64>,
    threads: usize,
    carried: bool,
    v: PyReadonlyArray2<'_, f64>,
    y: PyReadonlyArray2<'_, f64>,
    mut saved_v: PyReadwriteArrayDyn<'_, f64>,
    mut saved_y: PyReadwriteArrayDyn<'_, f64>,
    mut recorded: PyReadwriteArrayDyn<'_, f64>,
    mut tally: PyReadwriteArrayDyn<'_, f64>,
    mut carry: PyReadwriteArrayDyn<'_, f64>,
    mut first_bad: PyReadwriteArray1<'_, i64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<()> {
    let machine = Machine { level: Level::choose().map_err(core_error)?, threads };
    let arrays = Arrays {
        saved_v: saved_v.as_slice_mut()?,
        saved_y: saved_y.as_slice_mut()?,
        recorded: recorded.as_slice_mut()?,
        tally: tally.as_slice_mut()?,
        carry: carry.as_slice_mut()?,
        first_bad: first_bad.as_slice_mut()?,
    };
    let rows = model.rows(py)?;
    let tables = model.tables(py)?;
    let members = arrays.first_bad.len();
    let plan = Plan {
        model: model.model(model.started(start), &rows, &tables)?,
        clock: Clock { t0, h: dt },
        machine,
        first,
        steps,
        every,
        v: by_row(&v)?,
        y: by_row(&y)?,
        members,
        carried,
    };
    detached(py, progress, |monitor| batch::run(&plan, arrays, monitor))
}

/// Makes a run of steps of chosen length from the rows of `v` and `y`, and fills what is kept at the times of `at`.
#[pyfunction]
#[pyo3(signature = (model, *, t0, at, first, relative, absolute, budget, threads, v, y, saved_v, saved_y, reached, counts, progress))]
#[allow(clippy::too_many_arguments, reason = "a flat boundary; the callers on both sides have structures")]
fn adapt(
    py: Python<'_>,
    model: &ModelSpec,
    t0: f64,
    at: Vec<f64>,
    first: PyReadonlyArray2<'_, f64>,
    relative: PyReadonlyArray2<'_, f64>,
    absolute: PyReadonlyArray2<'_, f64>,
    budget: i64,
    threads: usize,
    v: PyReadonlyArray2<'_, f64>,
    y: PyReadonlyArray2<'_, f64>,
    mut saved_v: PyReadwriteArrayDyn<'_, f64>,
    mut saved_y: PyReadwriteArrayDyn<'_, f64>,
    mut reached: PyReadwriteArray2<'_, f64>,
    mut counts: PyReadwriteArray2<'_, i64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<()> {
    let members = counts.as_array().ncols();
    let arrays = chosen::Arrays {
        saved_v: saved_v.as_slice_mut()?,
        saved_y: saved_y.as_slice_mut()?,
        reached: reached.as_slice_mut()?,
        counts: counts.as_slice_mut()?,
    };
    let rows = model.rows(py)?;
    let tables = model.tables(py)?;
    let plan = chosen::Plan {
        model: model.model(model.attempts(), &rows, &tables)?,
        machine: Machine { level: Level::choose().map_err(core_error)?, threads },
        t0,
        at: &at,
        first: Row(first.as_slice()?),
        relative: Row(relative.as_slice()?),
        absolute: Row(absolute.as_slice()?),
        budget,
        v: by_row(&v)?,
        y: by_row(&y)?,
        members,
    };
    detached(py, progress, |monitor| chosen::run(&plan, arrays, monitor))
}

/// Runs without the GIL, tells how far it is and hears Ctrl-C.
fn detached(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    run: impl FnOnce(&mut dyn FnMut(f64) -> bool) -> Result<(), Error> + Send,
) -> PyResult<()> {
    let mut raised = None;
    let mut monitor = |share: f64| {
        Python::attach(|py| {
            let told = progress.as_ref().map_or(Ok(()), |p| p.call1(py, (share,)).map(drop));
            match told.and_then(|()| py.check_signals()) {
                Ok(()) => true,
                Err(error) => {
                    raised = Some(error);
                    false
                }
            }
        })
    };
    let result = py.detach(|| run(&mut monitor));
    match (result, raised) {
        (_, Some(error)) => Err(error),
        (Err(Error::Interrupted), None) => Err(PyKeyboardInterrupt::new_err(())),
        (Err(error), None) => Err(core_error(error)),
        (Ok(()), None) => Ok(()),
    }
}

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_function(wrap_pyfunction!(catalogue, m)?)?;
    m.add_function(wrap_pyfunction!(systems, m)?)?;
    m.add_function(wrap_pyfunction!(isa, m)?)?;
    m.add_function(wrap_pyfunction!(isa_levels, m)?)?;
    m.add_function(wrap_pyfunction!(saves, m)?)?;
    m.add_function(wrap_pyfunction!(run, m)?)?;
    m.add_function(wrap_pyfunction!(adapt, m)?)?;
    m.add_class::<ModelSpec>()?;
    m.add_class::<tape::Tape>()?;
    m.add_class::<tape::Symbol>()?;
    m.add_class::<world::World>()?;
    Ok(())
}

//! The Python binding: arrays in, arrays out, the GIL released, errors mapped. No arithmetic and no decisions here.

mod events;
mod methods;
mod model;
mod prepared;
mod prepared_adaptive;
mod tape;
mod world;

use std::cell::RefCell;

use numpy::{
    Element, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArray2, PyReadwriteArray, PyReadwriteArray1, PyReadwriteArray2,
    PyReadwriteArrayDyn, ndarray::Dimension,
};
use pyo3::{exceptions::PyKeyboardInterrupt, prelude::*, types::PyDict};
use stepwell_core::{
    error::Error,
    events::motion::Events,
    isa::Level,
    model::systems as kinds,
    run::{
        adaptive,
        fixed::{self, Arrays, FixedRun, Steppable},
    },
    stage::{Clock, Machine},
    tape::{
        Counts,
        real::Precision,
        split::{self, Body, Split},
    },
};

use model::{ModelSpec, by_row, core_error, readable};
use tape::{Operation, operation};

/// Whether something is an array of floats that can be used as it is: contiguous, aligned, and finite or above zero where that is
/// asked. What is wrong with any other is for others to say; this is asked of every array of every call.
#[pyfunction]
fn sound(value: &Bound<'_, PyAny>, finite: bool, positive: bool) -> bool {
    let Ok(array) = value.cast::<PyArrayDyn<f64>>() else { return false };
    let Ok(array) = array.try_readonly() else { return false };
    if !array.data().is_aligned() {
        return false;
    }
    let Ok(numbers) = array.as_slice() else { return false };
    // One after the other: both together take three times as long, since no vectors are made of them.
    (!finite || all(numbers, |x| x.abs() < f64::INFINITY)) && (!positive || all(numbers, |x| x > 0.0))
}

/// Whether something is true of all numbers. Exceptions are counted, without an early end: so the loop is over vectors.
fn all<T: Copy>(numbers: &[T], is: impl Fn(T) -> bool) -> bool {
    numbers.iter().map(|x| u64::from(!is(*x))).sum::<u64>() == 0
}

/// The names of all systems that the core has.
#[pyfunction]
fn systems() -> Vec<&'static str> {
    kinds::KINDS.iter().map(|kind| kind.name).collect()
}

/// The CPU level in use.
#[pyfunction]
fn isa() -> PyResult<&'static str> {
    Level::choose().map(Level::name).map_err(|unknown| core_error(unknown.into()))
}

/// Whether the environment names a device for all runs. (`os.environ` takes a microsecond to say so.)
#[pyfunction]
fn names_device() -> bool {
    std::env::var_os("STEPWELL_DEVICE").is_some_and(|name| !name.is_empty())
}

/// The CPU levels that this machine has, ascending.
#[pyfunction]
fn isa_levels() -> Vec<&'static str> {
    Level::available().into_iter().map(Level::name).collect()
}

/// The attributes of a plan that are read: see `Plan` in `runs/engine/plan.py`.
#[derive(FromPyObject)]
struct PlanOf {
    t0: f64,
    dt: f64,
    choice: usize,
    first: i64,
    steps: i64,
    every: Option<i64>,
    threads: usize,
    progress: Option<Py<PyAny>>,
}

/// The input and output of a run: see `Arrays` in `runs/engine/plan.py`.
#[derive(FromPyObject)]
struct ArraysOf<'py, T: Element + 'py> {
    v: Bound<'py, PyArray2<f64>>,
    y: Bound<'py, PyArray2<f64>>,
    carried: bool,
    saved_v: PyReadwriteArrayDyn<'py, T>,
    saved_y: PyReadwriteArrayDyn<'py, T>,
    recorded: Option<PyReadwriteArrayDyn<'py, T>>,
    tally: Option<PyReadwriteArray1<'py, T>>,
    carry: Option<PyReadwriteArrayDyn<'py, T>>,
    first_bad: PyReadwriteArray1<'py, i64>,
}

/// Makes a run from the rows of `v` and `y`, each of one number or one per member, and fills the arrays of saved states. Returns
/// whether some member diverged, now or before.
#[pyfunction]
fn run(py: Python<'_>, model: &ModelSpec, plan: PlanOf, arrays: Bound<'_, PyAny>) -> PyResult<bool> {
    match model.precision {
        Precision::Double => run_with::<f64>(py, model, plan, arrays.extract()?, None),
        Precision::Single => run_with::<f32>(py, model, plan, arrays.extract()?, None),
    }
}

/// Makes a run with events, as `run`, and returns their occurrences, too.
#[pyfunction]
fn run_and_look(
    py: Python<'_>,
    model: &ModelSpec,
    plan: PlanOf,
    arrays: Bound<'_, PyAny>,
    events: events::EventsOf<'_>,
) -> PyResult<(bool, events::AllFound)> {
    match model.precision {
        Precision::Double => look_with::<f64>(py, model, plan, arrays.extract()?, &events),
        Precision::Single => look_with::<f32>(py, model, plan, arrays.extract()?, &events),
    }
}

fn look_with<T: Steppable + Element>(
    py: Python<'_>,
    model: &ModelSpec,
    plan: PlanOf,
    arrays: ArraysOf<'_, T>,
    events: &events::EventsOf<'_>,
) -> PyResult<(bool, events::AllFound)> {
    let events = events.of_core(arrays.first_bad.as_array().len())?;
    let diverged = run_with(py, model, plan, arrays, Some(&events))?;
    Ok((diverged, events::found(py, &events)))
}

fn run_with<T: Steppable + Element>(
    py: Python<'_>,
    model: &ModelSpec,
    plan: PlanOf,
    mut arrays: ArraysOf<'_, T>,
    events: Option<&Events>,
) -> PyResult<bool> {
    let (rows, tables) = (model.rows(py)?, model.tables(py)?);
    let (v, y) = (readable(&arrays.v)?, readable(&arrays.y)?);
    let run = FixedRun {
        model: model.model(model.started(plan.choice), &rows, &tables)?,
        clock: Clock { t0: plan.t0, h: plan.dt },
        machine: Machine { level: Level::choose().map_err(|unknown| core_error(unknown.into()))?, threads: plan.threads },
        first: plan.first,
        steps: plan.steps,
        every: plan.every,
        v: by_row(&v)?,
        y: by_row(&y)?,
        members: arrays.first_bad.as_array().len(),
        own: arrays.first_bad.as_array().len(),
        events,
        carried: arrays.carried,
    };
    let to_fill = Arrays {
        saved_v: arrays.saved_v.as_slice_mut()?,
        saved_y: arrays.saved_y.as_slice_mut()?,
        recorded: filled(&mut arrays.recorded)?,
        tally: filled(&mut arrays.tally)?,
        carry: filled(&mut arrays.carry)?,
        first_bad: arrays.first_bad.as_slice_mut()?,
    };
    interruptible(py, plan.progress, |monitor| fixed::run(&run, to_fill, monitor))?;
    Ok(!all(arrays.first_bad.as_slice()?, |step| step < 0))
}

/// Fills rows with the recorded quantities of states, from the rows of their `v` and `y`; parameters of fewer members repeat.
#[pyfunction]
fn recorded(
    py: Python<'_>,
    model: &ModelSpec,
    dt: f64,
    own: usize,
    v: PyReadonlyArray2<'_, f64>,
    y: PyReadonlyArray2<'_, f64>,
    mut rows: PyReadwriteArray2<'_, f64>,
) -> PyResult<()> {
    let (parameters, tables) = (model.rows(py)?, model.tables(py)?);
    let members = rows.as_array().ncols();
    let mut first_bad = vec![-1; members];
    let run = FixedRun {
        model: model.model(model.started(0), &parameters, &tables)?,
        clock: Clock { t0: 0.0, h: dt },
        machine: Machine { level: Level::choose().map_err(|unknown| core_error(unknown.into()))?, threads: 1 },
        first: 0,
        steps: 0,
        every: Some(1),
        v: by_row(&v)?,
        y: by_row(&y)?,
        members,
        carried: false,
        own,
        events: None,
    };
    let to_fill = Arrays {
        saved_v: &mut [],
        saved_y: &mut [],
        recorded: rows.as_slice_mut()?,
        tally: &mut [],
        carry: &mut [],
        first_bad: &mut first_bad,
    };
    interruptible(py, None, |monitor| fixed::run(&run, to_fill, monitor))
}

/// The numbers of an array; none if there is no array.
fn filled<'a, T: Element, D: Dimension>(array: &'a mut Option<PyReadwriteArray<'_, T, D>>) -> PyResult<&'a mut [T]> {
    array.as_mut().map_or(Ok(&mut []), |array| Ok(array.as_slice_mut()?))
}

/// The times of the saved states of a run.
#[pyfunction]
fn times(plan: PlanOf, mut t: PyReadwriteArray1<'_, f64>) -> PyResult<()> {
    let clock = Clock { t0: plan.t0, h: plan.dt };
    let numbers = t.as_slice_mut()?;
    // Whole numbers up to 2⁵³ are exact as floats, so the step numbers can be counted as floats, several at once.
    let every = plan.every.unwrap_or(plan.steps) as f64;
    let ahead: [f64; 16] = std::array::from_fn(|i| i as f64 * every);
    for (i, chunk) in numbers.chunks_mut(ahead.len()).enumerate() {
        let k = plan.first as f64 + (i * ahead.len()) as f64 * every;
        chunk.iter_mut().zip(&ahead).for_each(|(t, ahead)| *t = clock.t0 + (k + ahead) * clock.h);
    }
    if let Some(last) = numbers.last_mut() {
        *last = clock.at(plan.first + plan.steps);
    }
    Ok(())
}

/// When the state is asked for, and how long to try: see `Pacing` in `runs/engine/adaptive.py`.
#[derive(FromPyObject)]
struct PacingOf<'py> {
    at: PyReadonlyArray2<'py, f64>,
    jumps: PyReadonlyArray2<'py, f64>,
    budget: i64,
    begins: bool,
    every: i64,
    extends: bool,
    is_part: bool,
}

/// The steps that are kept: see `KeptSteps` in `runs/engine/adaptive.py`.
#[derive(FromPyObject)]
struct KeptStepsOf<'py> {
    counts: PyReadwriteArray1<'py, i64>,
    t: PyReadwriteArray2<'py, f64>,
    v: PyReadwriteArrayDyn<'py, f64>,
    y: PyReadwriteArrayDyn<'py, f64>,
}

/// The input and output of a run with a tolerance: see `AdaptiveArrays` in `runs/engine/adaptive.py`.
#[derive(FromPyObject)]
struct AdaptiveArraysOf<'py> {
    v: Bound<'py, PyArray2<f64>>,
    y: Bound<'py, PyArray2<f64>>,
    paces: PyReadonlyArray2<'py, f64>,
    saved_v: PyReadwriteArrayDyn<'py, f64>,
    saved_y: PyReadwriteArrayDyn<'py, f64>,
    last_state: PyReadwriteArray2<'py, f64>,
    last_paces: PyReadwriteArray2<'py, f64>,
    status: PyReadwriteArray1<'py, i64>,
    trail: Option<PyReadwriteArrayDyn<'py, f64>>,
    steps: Option<KeptStepsOf<'py>>,
    waypoints: Option<PyReadwriteArrayDyn<'py, f64>>,
}

/// Makes a run of adaptive steps from the rows of `v` and `y`, and fills what is kept at the times of the pacing. Returns whether
/// it did: see `adaptive::run`.
#[pyfunction]
fn adapt(py: Python<'_>, model: &ModelSpec, plan: PlanOf, pacing: PacingOf, arrays: AdaptiveArraysOf<'_>) -> PyResult<bool> {
    adapt_with(py, model, plan, pacing, arrays, None)
}

/// Makes a run with events, as `adapt`, and returns their occurrences, too.
#[pyfunction]
fn adapt_and_look(
    py: Python<'_>,
    model: &ModelSpec,
    plan: PlanOf,
    pacing: PacingOf,
    arrays: AdaptiveArraysOf<'_>,
    events: events::EventsOf<'_>,
) -> PyResult<(bool, events::AllFound)> {
    let events = events.of_core(arrays.status.as_array().len())?;
    let made = adapt_with(py, model, plan, pacing, arrays, Some(&events))?;
    Ok((made, events::found(py, &events)))
}

fn adapt_with(
    py: Python<'_>,
    model: &ModelSpec,
    plan: PlanOf,
    pacing: PacingOf,
    mut arrays: AdaptiveArraysOf<'_>,
    events: Option<&Events>,
) -> PyResult<bool> {
    let (rows, tables) = (model.rows(py)?, model.tables(py)?);
    let (v, y) = (readable(&arrays.v)?, readable(&arrays.y)?);
    let run = adaptive::AdaptiveRun {
        model: model.model(model.attempts(), &rows, &tables)?,
        machine: Machine { level: Level::choose().map_err(|unknown| core_error(unknown.into()))?, threads: plan.threads },
        at: by_row(&pacing.at)?,
        jumps: by_row(&pacing.jumps)?,
        paces: by_row(&arrays.paces)?,
        begins: pacing.begins,
        extends: pacing.extends,
        is_part: pacing.is_part,
        budget: pacing.budget,
        every: pacing.every,
        v: by_row(&v)?,
        y: by_row(&y)?,
        members: arrays.status.as_array().len(),
        events,
    };
    let (steps, accepted_steps): ([&mut [f64]; 3], &mut [i64]) = match &mut arrays.steps {
        Some(KeptStepsOf { counts, t, v, y }) => {
            ([t.as_slice_mut()?, v.as_slice_mut()?, y.as_slice_mut()?], counts.as_slice_mut()?)
        }
        None => ([&mut [], &mut [], &mut []], &mut []),
    };
    let to_fill = adaptive::Arrays {
        saved_v: arrays.saved_v.as_slice_mut()?,
        saved_y: arrays.saved_y.as_slice_mut()?,
        state: arrays.last_state.as_slice_mut()?,
        paces: arrays.last_paces.as_slice_mut()?,
        status: arrays.status.as_slice_mut()?,
        attempt_log: filled(&mut arrays.trail)?,
        steps,
        accepted_steps,
        waypoints: filled(&mut arrays.waypoints)?,
    };
    interruptible(py, plan.progress, |monitor| adaptive::run(&run, to_fill, monitor))
}

thread_local! {
    /// The function that this thread asks at intervals while it steps: signals reach the main thread alone.
    static ASKED: RefCell<Option<Py<PyAny>>> = const { RefCell::new(None) };
}

/// Lets this thread ask a function at intervals while it steps, or none; what the function raises ends the run.
#[pyfunction]
fn ask(function: Option<Py<PyAny>>) {
    ASKED.with(|asked| *asked.borrow_mut() = function);
}

/// Raises if this thread is to stop: what the function says that it asks, and `KeyboardInterrupt` after Ctrl-C.
#[pyfunction]
pub fn listen(py: Python<'_>) -> PyResult<()> {
    let asked = ASKED.with(|asked| asked.borrow().as_ref().map(|function| function.clone_ref(py)));
    asked.map_or(Ok(()), |function| function.call0(py).map(drop)).and_then(|()| py.check_signals())
}

/// Runs without the GIL, reports progress and answers Ctrl-C.
fn interruptible<T: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    run: impl FnOnce(&mut dyn FnMut(f64) -> bool) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let mut raised = None;
    let mut monitor = |share: f64| {
        Python::attach(|py| {
            let told = progress.as_ref().map_or(Ok(()), |p| p.call1(py, (share,)).map(drop));
            match told.and_then(|()| listen(py)) {
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
        (Ok(made), None) => Ok(made),
    }
}

/// A number of operations of each kind.
pub fn kinds_of<'py>(py: Python<'py>, counts: &Counts) -> PyResult<Bound<'py, PyDict>> {
    let d = PyDict::new(py);
    d.set_item("additions", counts.additions)?;
    d.set_item("multiplications", counts.multiplications)?;
    d.set_item("fused", counts.fused)?;
    d.set_item("divisions", counts.divisions)?;
    d.set_item("square_roots", counts.square_roots)?;
    d.set_item("choices", counts.choices)?;
    d.set_item("bits", counts.bits)?;
    Ok(d)
}

/// A body's operations, and the indices of its results.
fn body_of(body: &Body) -> (Vec<Operation>, Vec<usize>) {
    let operations = body.ops.iter().map(|op| operation(*op, |operand| operand as usize)).collect();
    (operations, body.next.iter().map(|id| *id as usize).collect())
}

/// A cut tape: see `compiled` in `_core.pyi`.
fn split_of<'py>(py: Python<'py>, split: &Split) -> PyResult<Bound<'py, PyDict>> {
    let source = |source: &split::UniformSource| match *source {
        split::UniformSource::Step => ("step", 0),
        split::UniformSource::Param(i) => ("parameter", i),
        split::UniformSource::Start(table) => ("start", table),
        split::UniformSource::Interval(table) => ("interval", table),
        split::UniformSource::Last(table) => ("last", table),
        split::UniformSource::First(table) => ("first", table),
        split::UniformSource::Lanes => ("lanes", 0),
        split::UniformSource::Slack => ("slack", 0),
    };
    let entry = |entry: &split::Entry| match *entry {
        split::Entry::Value => ("value", 0),
        split::Entry::Sample(table) => ("sample", table),
        split::Entry::Row(table) => ("row", table),
    };
    let d = PyDict::new(py);
    d.set_item("given", split.sources.iter().map(source).collect::<Vec<_>>())?;
    d.set_item("params", &split.params)?;
    d.set_item("entries", split.entries.iter().map(entry).collect::<Vec<_>>())?;
    let bodies =
        [("run", &split.run), ("member", &split.member), ("step", &split.step), ("clock", &split.clock), ("body", &split.body)];
    for (name, body) in bodies {
        d.set_item(name, body_of(body))?;
    }
    Ok(d)
}

/// Raises if a model cannot be stepped so.
#[pyfunction]
fn check(py: Python<'_>, model: &ModelSpec) -> PyResult<()> {
    let (rows, tables) = (model.rows(py)?, model.tables(py)?);
    model.model(model.started(0), &rows, &tables)?.traced().map(drop).map_err(core_error)
}

/// About how many operations a step has: see `_core.pyi`.
#[pyfunction]
fn operations(py: Python<'_>, model: &ModelSpec) -> PyResult<usize> {
    let (rows, tables) = (model.rows(py)?, model.tables(py)?);
    let traced = model.model(model.started(0), &rows, &tables)?.traced().map_err(core_error)?;
    Ok(traced.operations.1)
}

/// The cost of a step with a series, in function evaluations: see `_core.pyi`.
#[pyfunction]
#[pyo3(signature = (model, *, attempts=false))]
fn series_evaluations(py: Python<'_>, model: &ModelSpec, attempts: bool) -> PyResult<usize> {
    let (rows, tables) = (model.rows(py)?, model.tables(py)?);
    let how = if attempts { model.attempts() } else { model.started(0) };
    let tapes = model.model(how, &rows, &tables)?.traced().and_then(|traced| traced.tapes()).map_err(core_error)?;
    Ok(tapes.series_evaluations)
}

/// The tape and machine code of a step, made anew for `members` members: see `_core.pyi`.
#[pyfunction]
#[pyo3(signature = (model, members, *, choice=0, attempts=false))]
fn compiled<'py>(
    py: Python<'py>,
    model: &ModelSpec,
    members: usize,
    choice: usize,
    attempts: bool,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let (rows, tables) = (model.rows(py)?, model.tables(py)?);
    let level = Level::choose().map_err(|unknown| core_error(unknown.into()))?;
    let how = if attempts { model.attempts() } else { model.started(choice) };
    let made = model.model(how, &rows, &tables)?.compiled(Machine { level, threads: 1 }, members).map_err(core_error)?;
    let Some(made) = made else { return Ok(None) };
    let d = PyDict::new(py);
    d.set_item("level", level.name())?;
    d.set_item("split", split_of(py, &made.split)?)?;
    match made.layout {
        Ok(layout) => {
            d.set_item("interpreted", py.None())?;
            d.set_item("width", layout.width)?;
            d.set_item("block_vectors", layout.block_vectors)?;
            d.set_item("blocks", layout.blocks)?;
            d.set_item("resident", layout.resident)?;
            d.set_item("registers", layout.registers)?;
        }
        Err(why) => d.set_item("interpreted", why.name())?,
    }
    d.set_item("written", kinds_of(py, &made.written)?)?;
    d.set_item("computed", kinds_of(py, &made.computed)?)?;
    let [run, member, step] = made.before;
    d.set_item("per_run", run)?;
    d.set_item("per_member", member)?;
    d.set_item("per_step", step)?;
    d.set_item("lanes", made.lanes)?;
    d.set_item("bytes", made.bytes)?;
    d.set_item("spills", made.spills)?;
    let packing = made.packing.map(|(is_packed, verdict)| {
        let d = PyDict::new(py);
        d.set_item("used", is_packed)?;
        d.set_item("cycles", verdict.packed)?;
        d.set_item("single_cycles", verdict.single)?;
        d.set_item("chain_cycles", verdict.chain)?;
        d.set_item("operations", verdict.operations)?;
        d.set_item("vectors", verdict.vectors)?;
        d.set_item("moves", verdict.moves)?;
        PyResult::Ok(d)
    });
    d.set_item("packing", packing.transpose()?)?;
    d.set_item("trace", made.trace.as_secs_f64())?;
    d.set_item("compile", made.compile.as_secs_f64())?;
    Ok(Some(d))
}

/// The number of a model's tapes: see `_core.pyi`.
#[pyfunction]
#[pyo3(signature = (model, *, choice=0, attempts=false))]
fn tape_number(py: Python<'_>, model: &ModelSpec, choice: usize, attempts: bool) -> PyResult<u64> {
    let (rows, tables) = (model.rows(py)?, model.tables(py)?);
    let how = if attempts { model.attempts() } else { model.started(choice) };
    Ok(model.model(how, &rows, &tables)?.traced().map_err(core_error)?.number)
}

/// The cut tapes of a run: see `_core.pyi`.
#[pyfunction]
#[pyo3(signature = (model, *, choice=0, attempts=false, extends=false))]
fn stages<'py>(py: Python<'py>, model: &ModelSpec, choice: usize, attempts: bool, extends: bool) -> PyResult<Bound<'py, PyDict>> {
    let (rows, tables) = (model.rows(py)?, model.tables(py)?);
    let how = if attempts { model.attempts() } else { model.started(choice) };
    let stages = model.model(how, &rows, &tables)?.stages(extends).map_err(core_error)?;
    let d = PyDict::new(py);
    for (name, size) in stages.sizes {
        d.set_item(name, size)?;
    }
    d.set_item("carries", stages.carries)?;
    d.set_item("is_series", stages.is_series)?;
    d.set_item("tried", stages.tried)?;
    let splits = PyDict::new(py);
    for (name, split) in &stages.splits {
        splits.set_item(name, split_of(py, split)?)?;
    }
    d.set_item("splits", splits)?;
    Ok(d)
}

/// How a step that is too long for one tape is computed; None if it is one tape: see `_core.pyi`.
#[pyfunction]
#[pyo3(signature = (model, members, *, choice=0, attempts=false))]
fn in_parts(
    py: Python<'_>,
    model: &ModelSpec,
    members: usize,
    choice: usize,
    attempts: bool,
) -> PyResult<Option<(&'static str, usize, usize)>> {
    let (rows, tables) = (model.rows(py)?, model.tables(py)?);
    let level = Level::choose().map_err(|unknown| core_error(unknown.into()))?;
    let how = if attempts { model.attempts() } else { model.started(choice) };
    model.model(how, &rows, &tables)?.in_parts(Machine { level, threads: 1 }, members, attempts).map_err(core_error)
}

/// Begins with new caches: see `stepwell_core::step::cache::forget`.
#[pyfunction]
fn forget() {
    stepwell_core::step::cache::forget();
}

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_function(wrap_pyfunction!(methods::catalogue, m)?)?;
    m.add_function(wrap_pyfunction!(tape::tape_operations, m)?)?;
    m.add_function(wrap_pyfunction!(sound, m)?)?;
    m.add_function(wrap_pyfunction!(systems, m)?)?;
    m.add_function(wrap_pyfunction!(isa, m)?)?;
    m.add_function(wrap_pyfunction!(isa_levels, m)?)?;
    m.add_function(wrap_pyfunction!(names_device, m)?)?;
    m.add_function(wrap_pyfunction!(ask, m)?)?;
    m.add_function(wrap_pyfunction!(listen, m)?)?;
    m.add_function(wrap_pyfunction!(run, m)?)?;
    m.add_function(wrap_pyfunction!(run_and_look, m)?)?;
    m.add_function(wrap_pyfunction!(events::locate, m)?)?;
    m.add_function(wrap_pyfunction!(recorded, m)?)?;
    m.add_function(wrap_pyfunction!(adapt, m)?)?;
    m.add_function(wrap_pyfunction!(adapt_and_look, m)?)?;
    m.add_function(wrap_pyfunction!(times, m)?)?;
    m.add_function(wrap_pyfunction!(check, m)?)?;
    m.add_function(wrap_pyfunction!(compiled, m)?)?;
    m.add_function(wrap_pyfunction!(in_parts, m)?)?;
    m.add_function(wrap_pyfunction!(stages, m)?)?;
    m.add_function(wrap_pyfunction!(tape_number, m)?)?;
    m.add_function(wrap_pyfunction!(operations, m)?)?;
    m.add_function(wrap_pyfunction!(methods::program, m)?)?;
    m.add_function(wrap_pyfunction!(methods::define, m)?)?;
    m.add_function(wrap_pyfunction!(series_evaluations, m)?)?;
    m.add_function(wrap_pyfunction!(forget, m)?)?;
    m.add_class::<ModelSpec>()?;
    m.add_class::<model::Equations>()?;
    m.add_class::<tape::Tape>()?;
    m.add_class::<tape::Symbol>()?;
    m.add_class::<tape::Evaluation>()?;
    m.add_function(wrap_pyfunction!(prepared::prepared, m)?)?;
    m.add_class::<prepared::Prepared>()?;
    m.add_function(wrap_pyfunction!(prepared_adaptive::prepared_adaptive, m)?)?;
    m.add_class::<prepared_adaptive::PreparedAdaptive>()?;
    m.add_class::<world::World>()?;
    Ok(())
}

//! Methods: the records of those that are built in, and programs, also of those that users define.

use pyo3::{prelude::*, types::PyDict};
use stepwell_core::{
    error::Error,
    model::{
        method::{Fact, Needs, Record},
        methods::{self, Method},
        program::{Block, Entry, Program, Time},
        steppers,
    },
};

use crate::model::{argument_error, core_error};

/// The metadata of a method.
fn describe<'py>(py: Python<'py>, r: &Record) -> PyResult<Bound<'py, PyDict>> {
    let d = PyDict::new(py);
    for (name, fact) in r.facts() {
        match fact {
            Fact::Text(text) => d.set_item(name, text)?,
            Fact::MaybeText(text) => d.set_item(name, text)?,
            Fact::Texts(texts) => d.set_item(name, texts)?,
            Fact::Whole(whole) => d.set_item(name, whole)?,
            Fact::Number(number) => d.set_item(name, number)?,
            Fact::Numbers(numbers) => d.set_item(name, numbers)?,
            Fact::Truth(truth) => d.set_item(name, truth)?,
        }
    }
    Ok(d)
}

/// The records of all methods, by name.
#[pyfunction]
pub(crate) fn catalogue(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    steppers::RECORDS.iter().map(|r| describe(py, r)).collect()
}

/// A name, the places of operands, and a time or a factor.
type BlockOperation = (&'static str, Vec<usize>, f64);

/// The operations of a method on blocks: names, operands, times or factors, and the indices of the results; see `_core.pyi`.
#[pyfunction]
#[pyo3(signature = (method, *, attempts=false, stage="step", choice=0))]
pub(crate) fn program(method: &str, attempts: bool, stage: &str, choice: usize) -> PyResult<(Vec<BlockOperation>, Vec<usize>)> {
    let record =
        stepwell_core::model::methods::method(method).map_err(|_| argument_error(format!("method: there is no {method:?}")))?;
    let missing = || argument_error(format!("stage: {method} has no {stage} of number {choice}"));
    let Program { entries, results } = match stage {
        "step" if attempts => record.attempt().ok_or_else(|| core_error(Error::NoEstimate))?,
        "step" => record.program(),
        "start" => record.start(choice).ok_or_else(missing)?,
        "finish" => record.finish(choice).ok_or_else(missing)?,
        _ => return Err(missing()),
    };
    let entry = |entry: &Entry| {
        let (name, number) = match *entry {
            Entry::V => ("v", 0.0),
            Entry::Y => ("y", 0.0),
            Entry::Dv(t, ..) => ("dv", t.node()),
            Entry::Dy(t, ..) => ("dy", t.node()),
            Entry::Velocity(_) => ("velocity", 0.0),
            Entry::Add(..) => ("add", 0.0),
            Entry::Sub(..) => ("subtract", 0.0),
            Entry::Scale(by, _) => ("scale", by),
            Entry::SeriesV(order, ..) => ("series of v", f64::from(order)),
            Entry::SeriesY(order, ..) => ("series of y", f64::from(order)),
            Entry::ImplicitV(gamma, ..) => ("implicit v", gamma),
            Entry::ImplicitY(gamma, ..) => ("implicit y", gamma),
            Entry::ByTimeV => ("v by time", 0.0),
            Entry::ByTimeY => ("y by time", 0.0),
            Entry::Mass(_) => ("mass", 0.0),
            Entry::Kick(t, ..) => ("kick", t.node()),
            Entry::DriftV(share, ..) => ("drift of v", share),
            Entry::DriftY(share, ..) => ("drift of y", share),
            Entry::SquareV(..) => ("square for v", 0.0),
            Entry::SquareY(..) => ("square for y", 0.0),
            Entry::IfAtMost(_) => ("if at most", 0.0),
            Entry::Kept(i, of_v) => (if of_v { "kept v" } else { "kept y" }, f64::from(i)),
        };
        (name, entry.operands().into_iter().map(|block| block.index()).collect(), number)
    };
    Ok((entries.iter().map(entry).collect(), results.iter().map(|block| block.index()).collect()))
}

/// Operations on blocks, and the places of results.
type BlockOperations = (Vec<(String, Vec<usize>, f64)>, Vec<usize>);

/// A program of operations as `program` returns them, of those that a user's method has.
fn program_of((operations, results): BlockOperations, kept: &[bool]) -> PyResult<Program> {
    let entry = |(name, of, number): (String, Vec<usize>, f64)| {
        let of: Vec<Block> = of.into_iter().map(Block::at).collect();
        Some(match (name.as_str(), of.as_slice()) {
            ("v", []) => Entry::V,
            ("y", []) => Entry::Y,
            ("kept v", []) if kept.get(number as usize) == Some(&true) => Entry::Kept(number as u32, true),
            ("kept y", []) if kept.get(number as usize) == Some(&false) => Entry::Kept(number as u32, false),
            ("dv", &[v, y]) => Entry::Dv(Time::after(number), v, y),
            ("dy", &[v, y]) => Entry::Dy(Time::after(number), v, y),
            ("velocity", &[d]) => Entry::Velocity(d),
            ("add", &[a, b]) => Entry::Add(a, b),
            ("subtract", &[a, b]) => Entry::Sub(a, b),
            ("scale", &[a]) => Entry::Scale(number, a),
            _ => return None,
        })
    };
    let entries: Option<Vec<Entry>> = operations.into_iter().map(entry).collect();
    let program = entries.and_then(|entries| Program::of(entries, results));
    program.ok_or_else(|| argument_error("program: expected operations on blocks, each after what it reads".to_owned()))
}

/// Makes a user's method known by a key: see `_core.pyi`.
#[pyfunction]
#[pyo3(signature = (key, name, step, *, acceleration, attempt=None, error_order=0, start=None, kept=Vec::new()))]
#[expect(clippy::too_many_arguments, reason = "they are what a method is, each by its name")]
pub(crate) fn define(
    key: &str,
    name: &str,
    step: BlockOperations,
    acceleration: bool,
    attempt: Option<BlockOperations>,
    error_order: u32,
    start: Option<BlockOperations>,
    kept: Vec<bool>,
) -> PyResult<()> {
    let needs = if acceleration { Needs::Acceleration } else { Needs::Rates };
    let step = program_of(step, &kept)?;
    let attempt = attempt.map(|attempt| program_of(attempt, &[])).transpose()?.map(|program| (program, error_order));
    let start = start.map(|start| program_of(start, &[])).transpose()?.map(|program| (program, kept));
    methods::define(key, Method::own(name, needs, step, attempt, start));
    Ok(())
}

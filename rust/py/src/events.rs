//! The events of a run: tapes and parameters that stay Python's, and what was found.

use std::sync::{Mutex, PoisonError};

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use stepwell_core::{
    events::{
        self, Brackets,
        found::{Found, Rest},
        motion::{self, Events, Trial},
    },
    isa::Level,
    model::spec::Row,
};

use crate::{
    model::{Tables, argument_error, core_error, tables},
    tape::{Evaluation, Values},
};

/// Values of a tape, with their parameters: see `Values` in `runs/events/by_core.py`.
#[derive(FromPyObject)]
struct ValuesOf<'py> {
    of: Bound<'py, Evaluation>,
    parameters: Vec<PyReadonlyArray1<'py, f64>>,
    tables: Tables<'py>,
}

/// Known times: see `TimesOfCore` there.
#[derive(FromPyObject)]
struct TimesOf<'py> {
    keys: PyReadonlyArray2<'py, f64>,
    signs: PyReadonlyArray2<'py, f64>,
}

impl TimesOf<'_> {
    fn of_core(&self, members: usize) -> PyResult<motion::Times<'_>> {
        let (keys, signs, columns) = (self.keys.as_slice()?, self.signs.as_slice()?, self.keys.as_array().ncols());
        let is_ended = keys.rchunks(columns.max(1)).next().is_some_and(|last| last.iter().all(|key| *key == f64::INFINITY));
        if !is_ended || keys.len() != signs.len() || (columns != 1 && columns != members) {
            return Err(argument_error(format!("expected rows of one time or {members}, the last infinite, got {columns}")));
        }
        Ok(motion::Times { keys, signs, columns })
    }
}

/// An event: see `OfCore` there.
#[derive(FromPyObject)]
struct EventOf<'py> {
    times: Option<TimesOf<'py>>,
    quantity: ValuesOf<'py>,
    slope: Option<ValuesOf<'py>>,
    then: Option<ValuesOf<'py>>,
    direction: f64,
    terminal: i64,
    most: i64,
}

/// All events of a run: see `Sought` there.
#[derive(FromPyObject)]
pub(crate) struct EventsOf<'py> {
    events: Vec<EventOf<'py>>,
    step: ValuesOf<'py>,
    repeats: bool,
    rates: ValuesOf<'py>,
    numbers: usize,
    groups: usize,
    begin: PyReadonlyArray1<'py, f64>,
    sign: f64,
    way: f64,
    jumps: Option<TimesOf<'py>>,
}

/// A row of one number for all members, or one for each.
fn row<'a>(numbers: &'a PyReadonlyArray1<'_, f64>, members: usize) -> PyResult<Row<'a>> {
    let numbers = numbers.as_slice()?;
    if numbers.len() != 1 && numbers.len() != members {
        return Err(argument_error(format!("expected one number or {members}, got {}", numbers.len())));
    }
    Ok(Row(numbers))
}

impl ValuesOf<'_> {
    fn of_core(&self, members: usize) -> PyResult<motion::Values<'_>> {
        let parameters = self.parameters.iter().map(|numbers| row(numbers, members)).collect::<PyResult<_>>()?;
        Ok(motion::Values { of: self.of.get().double()?.clone(), parameters, tables: tables(&self.tables)? })
    }
}

impl EventsOf<'_> {
    fn step_of_core(&self, members: usize) -> PyResult<Trial<'_>> {
        let Values::Single(of) = &self.step.of.get().0 else { return self.step.of_core(members).map(Trial::Double) };
        let parameters = self.step.parameters.iter().map(|numbers| row(numbers, members)).collect::<PyResult<_>>()?;
        Ok(Trial::Single(motion::Values { of: of.clone(), parameters, tables: Vec::new() }))
    }

    /// As the core takes them.
    pub(crate) fn of_core(&self, members: usize) -> PyResult<Events<'_>> {
        let events = self
            .events
            .iter()
            .map(|event| {
                Ok(motion::Event {
                    times: event.times.as_ref().map(|times| times.of_core(members)).transpose()?,
                    quantity: event.quantity.of_core(members)?,
                    slope: event.slope.as_ref().map(|slope| slope.of_core(members)).transpose()?,
                    then: event.then.as_ref().map(|then| then.of_core(members)).transpose()?,
                    direction: event.direction,
                    terminal: event.terminal,
                    most: event.most,
                })
            })
            .collect::<PyResult<Vec<_>>>()?;
        let found = Mutex::new(Found::new(events.len(), members));
        Ok(Events {
            events,
            step: self.step_of_core(members)?,
            repeats: self.repeats,
            rates: self.rates.of_core(members)?,
            numbers: self.numbers,
            groups: self.groups,
            begin: row(&self.begin, members)?,
            sign: self.sign,
            way: self.way,
            jumps: self.jumps.as_ref().map(|jumps| jumps.of_core(members)).transpose()?,
            level: Level::choose().map_err(|unknown| core_error(unknown.into()))?,
            found,
        })
    }
}

/// An array of whole numbers, or of others.
type Whole = Py<PyArray1<i64>>;
type Real = Py<PyArray1<f64>>;
/// For each member at rest its number, its event, whether that leads it back, since when the state was changed as
/// often as it may be, and which events set each other off.
type Rests = Vec<(i64, i64, bool, f64, Vec<bool>)>;
/// Per event the members, steps, shares, times and states of its occurrences; how many each member has; when members stopped;
/// whether a saved time changed their steps; the members at rest.
pub(crate) type AllFound = (Vec<(Whole, Whole, Real, Real, Real)>, Whole, Real, Py<PyArray1<bool>>, Rests);

/// The occurrences that were found, and what else a run with events reports.
pub(crate) fn found(py: Python<'_>, events: &Events) -> AllFound {
    let mut found = events.found.lock().unwrap_or_else(PoisonError::into_inner);
    let Found { occurrences, counts, stopped_at, other_steps, rests } = std::mem::take(&mut *found);
    let of_each = occurrences.into_iter().map(|each| {
        (
            each.member.into_pyarray(py).unbind(),
            each.step.into_pyarray(py).unbind(),
            each.share.into_pyarray(py).unbind(),
            each.t.into_pyarray(py).unbind(),
            each.states.into_pyarray(py).unbind(),
        )
    });
    let (counts, stopped_at) = (counts.into_pyarray(py).unbind(), stopped_at.into_pyarray(py).unbind());
    let of_rest = |rest: Rest| (rest.member, rest.event, rest.led_back, rest.often_since, rest.circle);
    (of_each.collect(), counts, stopped_at, other_steps.into_pyarray(py).unbind(), rests.into_iter().map(of_rest).collect())
}

/// Locates changes of sign of an event of `of_all` members: see `locate` of the core. Returns the shares, and the states.
#[pyfunction]
pub(crate) fn locate(
    py: Python<'_>,
    events: EventsOf<'_>,
    of_all: usize,
    e: usize,
    members: PyReadonlyArray1<'_, i64>,
    numbers: PyReadonlyArray2<'_, f64>,
    states: PyReadonlyArray2<'_, f64>,
) -> PyResult<(Real, Real)> {
    let events = events.of_core(of_all)?;
    let brackets = Brackets { members: members.as_slice()?, numbers: numbers.as_slice()?, states: states.as_slice()? };
    let (shares, states) = events::locate(&events, e, &brackets);
    Ok((shares.into_pyarray(py).unbind(), states.into_pyarray(py).unbind()))
}

//! Runs of adaptive steps that differ in their start alone: all else is prepared once.

use std::sync::Mutex;

use numpy::{PyArrayDyn, PyReadonlyArray2, PyReadwriteArrayDyn};
use pyo3::prelude::*;
use stepwell_core::{
    model::spec::Row,
    run::{
        adaptive::{self, AdaptiveRun},
        world::World,
    },
    stage::{Clock, Machine},
    step::pace::Pace,
    tape::real::Precision,
};

use crate::{
    PacingOf, PlanOf,
    model::{ModelSpec, core_error},
    prepared::read,
    world::machine,
};

/// A run of adaptive steps without its start.
#[pyclass(module = "stepwell._core", frozen)]
pub struct PreparedAdaptive {
    model: Py<ModelSpec>,
    kept: Mutex<Kept>,
    /// The shapes of both blocks of a start.
    shapes: [Vec<usize>; 2],
    /// Whether to check for amounts that became negative.
    has_amounts: bool,
    /// A quantity has changed if its change is more than this part of its size.
    least_change: f64,
    /// Runs with at least this many accepted steps are checked for stiffness, and so are left to the caller.
    many: f64,
}

/// The parts that are kept from run to run.
struct Kept {
    lanes: adaptive::Prepared,
    /// The world that computes the invariants of the true motion, if there are some, and its parameters.
    quantities: Option<(World, Py<ModelSpec>)>,
    input: Input,
    state: Vec<f64>,
    status: Vec<i64>,
    /// A run took long, so that all later ones are left to the caller.
    is_long: bool,
}

/// The input of a run.
struct Input {
    machine: Machine,
    at: Rows,
    jumps: Rows,
    paces: Rows,
    v: Rows,
    y: Rows,
    begins: bool,
    extends: bool,
    budget: i64,
    members: usize,
}

/// Rows of one number for all members, or of one for each.
struct Rows {
    numbers: Vec<f64>,
    width: usize,
}

impl Rows {
    fn of(array: &PyReadonlyArray2<'_, f64>) -> PyResult<Rows> {
        Ok(Rows { numbers: array.as_slice()?.to_vec(), width: array.as_array().ncols().max(1) })
    }

    fn zeros(rows: usize, width: usize) -> Rows {
        Rows { numbers: vec![0.0; rows * width], width: width.max(1) }
    }

    fn rows(&self) -> Vec<Row<'_>> {
        self.numbers.chunks_exact(self.width).map(Row).collect()
    }
}

impl Input {
    fn run<'a>(&'a self, model: stepwell_core::run::Model<'a>) -> AdaptiveRun<'a> {
        AdaptiveRun {
            model,
            machine: self.machine,
            at: self.at.rows(),
            jumps: self.jumps.rows(),
            paces: self.paces.rows(),
            begins: self.begins,
            extends: self.extends,
            is_part: false,
            budget: self.budget,
            every: 0,
            v: self.v.rows(),
            y: self.y.rows(),
            members: self.members,
            events: None,
        }
    }
}

/// A prepared run of members with these paces, from starts whose blocks have these shapes, none for one number. `quantities` is a
/// model that records what the true motion keeps. None if a run cannot be prepared.
#[pyfunction]
#[pyo3(signature = (model, plan, pacing, paces, shapes, numbers, members, *, quantities, has_amounts, least_change, many))]
#[allow(clippy::too_many_arguments, reason = "in Python they have names")]
pub(crate) fn prepared_adaptive(
    py: Python<'_>,
    model: Bound<'_, ModelSpec>,
    plan: PlanOf,
    pacing: PacingOf<'_>,
    paces: PyReadonlyArray2<'_, f64>,
    shapes: [Vec<usize>; 2],
    numbers: [usize; 2],
    members: usize,
    quantities: Option<Bound<'_, ModelSpec>>,
    has_amounts: bool,
    least_change: f64,
    many: f64,
) -> PyResult<Option<PreparedAdaptive>> {
    let spec = model.get();
    if spec.precision == Precision::Single || plan.progress.is_some() {
        return Ok(None);
    }
    let quantities = match quantities {
        None => None,
        Some(of) => {
            let (rows, tables) = (of.get().rows(py)?, of.get().tables(py)?);
            let model = of.get().model(of.get().started(0), &rows, &tables)?;
            let world = World::new(&model, Clock { t0: 0.0, h: 1.0 }, machine()?, members, 0).map_err(core_error)?;
            drop(model);
            drop((rows, tables));
            Some((world, of.unbind()))
        }
    };
    let input = Input {
        machine: machine()?,
        at: Rows::of(&pacing.at)?,
        jumps: Rows::of(&pacing.jumps)?,
        paces: Rows::of(&paces)?,
        v: Rows::zeros(numbers[0], members),
        y: Rows::zeros(numbers[1], members),
        begins: pacing.begins,
        extends: pacing.extends,
        budget: pacing.budget,
        members,
    };
    let (rows, tables) = (spec.rows(py)?, spec.tables(py)?);
    let run = input.run(spec.model(spec.attempts(), &rows, &tables)?);
    let Some(lanes) = adaptive::Prepared::new(&run).map_err(core_error)? else { return Ok(None) };
    drop(run);
    let state = vec![0.0; (numbers[0] + numbers[1]) * members];
    let kept = Kept { lanes, quantities, input, state, status: vec![0; members], is_long: false };
    Ok(Some(PreparedAdaptive { model: model.unbind(), kept: Mutex::new(kept), shapes, has_amounts, least_change, many }))
}

#[pymethods]
impl PreparedAdaptive {
    /// Makes the run from this start and fills the states at the times of the pacing, those at the end and the paces there.
    /// Returns 0 if nothing was made, since the start is not of floats of these shapes, or a member did not come to its end, or
    /// it takes long, or another thread makes the run just now; 2 if it is certain that nothing can be said of it; 1 otherwise.
    /// `parameters` are others of the same shapes, for this run.
    #[pyo3(signature = (v, y, saved_v, saved_y, last_v, last_y, paces, parameters=None))]
    #[allow(clippy::too_many_arguments, reason = "in Python they have names")]
    fn run(
        &self,
        py: Python<'_>,
        v: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
        mut saved_v: PyReadwriteArrayDyn<'_, f64>,
        mut saved_y: PyReadwriteArrayDyn<'_, f64>,
        mut last_v: PyReadwriteArrayDyn<'_, f64>,
        mut last_y: PyReadwriteArrayDyn<'_, f64>,
        mut paces: PyReadwriteArrayDyn<'_, f64>,
        parameters: Option<Vec<Bound<'_, PyArrayDyn<f64>>>>,
    ) -> PyResult<u8> {
        let Ok(mut kept) = self.kept.try_lock() else { return Ok(0) };
        let Kept { lanes, quantities, input, state, status, is_long } = &mut *kept;
        if *is_long || !read(v, &self.shapes[0], &mut input.v.numbers) || !read(y, &self.shapes[1], &mut input.y.numbers) {
            return Ok(0);
        }
        let model = self.model.bind(py).get();
        let (rows, tables) = (model.rows(py)?, model.tables(py)?);
        let others = match &parameters {
            None => None,
            Some(parameters) => match model.others(py, parameters)? {
                None => return Ok(0),
                others => others,
            },
        };
        let spec = others.as_ref().map_or_else(|| model.spec(&rows, &tables), |others| model.with(others, &tables))?;
        if others.is_some() && !lanes.renew(&spec) {
            return Ok(0);
        }
        let run = input.run(model.of(model.attempts(), spec));
        let (saved_v, saved_y, paces) = (saved_v.as_slice_mut()?, saved_y.as_slice_mut()?, paces.as_slice_mut()?);
        let to_fill = adaptive::Arrays {
            saved_v: &mut *saved_v,
            saved_y: &mut *saved_y,
            state: &mut *state,
            paces: &mut *paces,
            status: &mut *status,
            attempt_log: &mut [],
            steps: [&mut [], &mut [], &mut []],
            accepted_steps: &mut [],
            waypoints: &mut [],
        };
        let is_made = lanes.run(&run, to_fill).map_err(core_error)?;
        let accepted = paces.chunks_exact(input.members).nth(Pace::<f64>::ACCEPTED);
        *is_long = !is_made || accepted.is_none_or(|accepted| accepted.iter().any(|accepted| *accepted >= self.many));
        if *is_long || status.iter().any(|status| *status != 0) {
            return Ok(0);
        }
        let (end_v, end_y) = state.split_at(input.v.numbers.len());
        last_v.as_slice_mut()?.copy_from_slice(end_v);
        last_y.as_slice_mut()?.copy_from_slice(end_y);
        if self.has_amounts && end_y.iter().any(|amount| *amount < 0.0) {
            return Ok(1);
        }
        let last = |saved: &[f64], length: usize| saved.len() - length;
        if let (Some((world, of)), Some(parameters)) = (quantities.as_mut(), &parameters) {
            let of = of.bind(py).get();
            let Some(others) = of.others(py, parameters)? else { return Ok(1) };
            let tables = of.tables(py)?;
            world.renew(&of.with(&others, &tables)?);
        }
        let is_kept = quantities.as_mut().is_none_or(|(quantities, _)| {
            let first = quantities.recorded(&input.v.numbers, &input.y.numbers);
            let end = [&saved_v[last(saved_v, end_v.len())..], &saved_y[last(saved_y, end_y.len())..]];
            let change = |(first, last): (&f64, &f64)| (last - first).abs() <= self.least_change * first.abs().max(last.abs());
            first.iter().zip(&quantities.recorded(end[0], end[1])).all(change)
        });
        Ok(if is_kept { 2 } else { 1 })
    }
}

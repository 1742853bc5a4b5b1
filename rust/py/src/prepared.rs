//! Runs that differ in their start alone: all else is prepared once.

use std::sync::Mutex;

use numpy::{Element, PyArrayDyn, PyArrayMethods, PyReadwriteArrayDyn, PyUntypedArrayMethods};
use pyo3::{prelude::*, types::PyFloat};
use stepwell_core::{
    run::{
        fixed::{MIN_NUMBER_STEPS_FOR_THREADS, Steppable},
        world::{RunSteps, World},
    },
    stage::Clock,
    tape::real::{Precision, Real},
};

use crate::{
    PlanOf, all,
    model::{ModelSpec, core_error},
    world::machine,
};

/// A run is prepared up to this many steps of numbers: without threads it is as fast, and it takes some milliseconds.
const MOST_NUMBER_STEPS: f64 = MIN_NUMBER_STEPS_FOR_THREADS;
/// The most steps of a prepared run, in intervals between two checks for Ctrl-C of a longer run.
const MOST_CHECKS: i64 = 4;
/// From this many steps of numbers on other threads of Python go on meanwhile: releasing the GIL takes longer than a shorter run.
const FEW_NUMBER_STEPS: f64 = 1e4;
/// How much longer than the start of the shortest member all numbers at the end may be in all, squared, so that no member has
/// grown as `runs/findings/growth.py` means it, with room for the rounding of sums.
const TAME: f64 = 1e11;
/// Squares below this are too small to be compared.
const LEAST_SQUARE: f64 = 1e-270;

/// A run of fixed steps without all that does not depend on the start.
#[pyclass(module = "stepwell._core", frozen)]
pub struct Prepared {
    model: Py<ModelSpec>,
    run: Mutex<Kinds>,
    steps: RunSteps,
    /// The shapes of both blocks of a start.
    shapes: [Vec<usize>; 2],
    is_short: bool,
}

enum Kinds {
    Double(Run<f64>),
    Single(Run<f32>),
}

struct Run<T> {
    world: World<T>,
    v: Vec<T>,
    y: Vec<T>,
}

/// A prepared run of `members` members, from starts whose blocks have these shapes, none for one number; None if it takes so long
/// that preparation does not matter.
#[pyfunction]
pub(crate) fn prepared(
    py: Python<'_>,
    model: Bound<'_, ModelSpec>,
    plan: PlanOf,
    members: usize,
    shapes: [Vec<usize>; 2],
) -> PyResult<Option<Prepared>> {
    let spec = model.get();
    let (rows, tables) = (spec.rows(py)?, spec.tables(py)?);
    let precision = spec.precision;
    let stepped = spec.model(spec.started(plan.choice), &rows, &tables)?;
    let clock = Clock { t0: plan.t0, h: plan.dt };
    let steps = RunSteps { first: plan.first, steps: plan.steps, every: plan.every };
    let is_short;
    macro_rules! of {
        ($kind:ident) => {{
            let world = World::new(&stepped, clock, machine()?, members, plan.first).map_err(core_error)?;
            let sizes = world.sizes();
            let work = (sizes.0 + sizes.1) as f64 * plan.steps as f64;
            let most_steps = world.steps_between_checks().map_or(0, |steps| MOST_CHECKS * steps);
            if work >= MOST_NUMBER_STEPS || plan.steps > most_steps {
                return Ok(None);
            }
            is_short = work < FEW_NUMBER_STEPS;
            Kinds::$kind(Run { world, v: vec![0.0; sizes.0], y: vec![0.0; sizes.1] })
        }};
    }
    let run = match precision {
        Precision::Double => of!(Double),
        Precision::Single => of!(Single),
    };
    drop(stepped);
    Ok(Some(Prepared { model: model.unbind(), run: Mutex::new(run), steps, shapes, is_short }))
}

#[pymethods]
impl Prepared {
    /// Makes the run from this start and fills the saved states and what the method carries. Returns 0 if nothing was made, since
    /// the start is not of floats of these shapes, or a number was not finite, or another thread makes the run just now; 2 if it
    /// is certain that no member has grown much; 1 otherwise. `parameters` are others of the same shapes, for this run and those
    /// to come.
    #[pyo3(signature = (v, y, saved_v, saved_y, carry, parameters=None))]
    #[allow(clippy::too_many_arguments, reason = "in Python they have names")]
    fn run(
        &self,
        py: Python<'_>,
        v: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
        saved_v: &Bound<'_, PyAny>,
        saved_y: &Bound<'_, PyAny>,
        carry: Option<&Bound<'_, PyAny>>,
        parameters: Option<Vec<Bound<'_, PyArrayDyn<f64>>>>,
    ) -> PyResult<u8> {
        let Ok(mut run) = self.run.try_lock() else { return Ok(0) };
        if let Some(parameters) = parameters {
            let model = self.model.bind(py).get();
            let Some(others) = model.others(py, &parameters)? else { return Ok(0) };
            let tables = model.tables(py)?;
            let spec = model.with(&others, &tables)?;
            match &mut *run {
                Kinds::Double(run) => run.world.renew(&spec),
                Kinds::Single(run) => run.world.renew(&spec),
            }
        }
        match &mut *run {
            Kinds::Double(run) => self.with(py, run, [v, y], saved_v.extract()?, saved_y.extract()?, carry),
            Kinds::Single(run) => self.with(py, run, [v, y], saved_v.extract()?, saved_y.extract()?, carry),
        }
    }
}

impl Prepared {
    fn with<T: Steppable + Element>(
        &self,
        py: Python<'_>,
        run: &mut Run<T>,
        start: [&Bound<'_, PyAny>; 2],
        mut saved_v: PyReadwriteArrayDyn<'_, T>,
        mut saved_y: PyReadwriteArrayDyn<'_, T>,
        carry: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u8> {
        let Run { world, v, y } = run;
        if !read(start[0], &self.shapes[0], v) || !read(start[1], &self.shapes[1], y) {
            return Ok(0);
        }
        let (saved_v, saved_y) = (saved_v.as_slice_mut()?, saved_y.as_slice_mut()?);
        let mut make = || world.run(self.steps, [v, y], saved_v, saved_y);
        let Some(held) = (if self.is_short { make() } else { py.detach(make) }) else { return Ok(0) };
        if let Some(carry) = carry {
            let mut carry: PyReadwriteArrayDyn<'_, T> = carry.extract()?;
            carry.as_slice_mut()?.copy_from_slice(&held);
        }
        let members = world.members();
        let last = |saved: &[T], length: usize| squares(&saved[saved.len() - length..]);
        let after = last(saved_v, v.len()) + last(saved_y, y.len());
        let before = shortest(v, y, members);
        Ok(if before > LEAST_SQUARE && after <= TAME * before { 2 } else { 1 })
    }
}

/// Reads a block into `to`: one number for all, or an array of this shape, of floats of 64 or 32 bits. Returns false if it has
/// another shape or type, or is not finite.
pub(crate) fn read<T: Real>(block: &Bound<'_, PyAny>, shape: &[usize], to: &mut [T]) -> bool {
    if let Ok(number) = block.cast_exact::<PyFloat>() {
        if !shape.is_empty() {
            return false;
        }
        to.fill(T::of(number.value()));
    } else if let Ok(array) = block.cast::<PyArrayDyn<f64>>() {
        if !take(array, shape, to, T::of) {
            return false;
        }
    } else if let Ok(array) = block.cast::<PyArrayDyn<f32>>() {
        if !take(array, shape, to, |number| T::of(f64::from(number))) {
            return false;
        }
    } else {
        return to.is_empty() && block.is_none();
    }
    all(to, |x| x.is_below(T::INFINITY))
}

/// Reads an array into `to`. Returns false if it has another shape.
fn take<F: Element + Copy, T: Real>(
    array: &Bound<'_, PyArrayDyn<F>>,
    shape: &[usize],
    to: &mut [T],
    of: impl Fn(F) -> T,
) -> bool {
    let Ok(array) = array.try_readonly() else { return false };
    let Ok(numbers) = array.as_slice() else { return false };
    if array.shape() != shape || !array.data().is_aligned() {
        return false;
    }
    match numbers {
        [number] => to.fill(of(*number)),
        _ => to.iter_mut().zip(numbers).for_each(|(to, number)| *to = of(*number)),
    }
    true
}

/// Numbers that are added side by side, as vectors.
const SIDE_BY_SIDE: usize = 32;

/// The sum of the squares of some numbers, in any order.
fn squares<T: Real>(numbers: &[T]) -> f64 {
    let (chunks, rest) = numbers.as_chunks::<SIDE_BY_SIDE>();
    let mut sums = [0.0; SIDE_BY_SIDE];
    let mut add = |chunk: &[T]| sums.iter_mut().zip(chunk).for_each(|(sum, x)| *sum += x.wide() * x.wide());
    chunks.iter().for_each(|chunk| add(chunk));
    add(rest);
    sums.iter().fold(0.0, |sum, x| sum + x)
}

/// The least of the squared lengths of all members; one at rest counts as one unit long.
fn shortest<T: Real>(v: &[T], y: &[T], members: usize) -> f64 {
    let mut least = f64::INFINITY;
    for first in (0..members).step_by(SIDE_BY_SIDE) {
        let some = first..members.min(first + SIDE_BY_SIDE);
        let rows = || [v, y].into_iter().flat_map(|block| block.chunks_exact(members).map(|row| &row[some.clone()]));
        let mut sums = [0.0; SIDE_BY_SIDE];
        rows().for_each(|row| sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += x.wide() * x.wide()));
        for (i, square) in sums[..some.len()].iter().enumerate() {
            let rests = *square == 0.0 && rows().all(|row| row[i].wide() == 0.0);
            least = least.min(if rests { 1.0 } else { *square });
        }
    }
    least
}

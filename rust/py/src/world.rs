//! The real-time loop over the user's own arrays.

use std::sync::{
    Arc, Mutex, TryLockError,
    atomic::{AtomicI64, Ordering::Relaxed},
};

use numpy::{Element, IntoPyArray, PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArray1};
use pyo3::{
    buffer::{Element as PyElement, PyBuffer},
    prelude::*,
    types::PyInt,
};
use stepwell_core::{
    error::Error,
    isa::Level,
    model::spec::{Row, Signature, Spec, Table},
    run::{fixed::Steppable, world},
    stage::{Clock, Machine},
    tape::real::Precision,
};

use crate::{
    events::{AllFound, EventsOf, found},
    interruptible, listen,
    model::{ModelSpec, argument_error, by_row, core_error, error_of, in_use},
};

/// How the arrays are reached.
enum Arrays<T: Of> {
    /// A few numbers are copied in and out, which takes a third of the time of borrowing the arrays for writing.
    Few { buffers: (PyBuffer<T>, PyBuffer<T>), copies: (Vec<T>, Vec<T>) },
    /// Many are stepped where they are.
    Many { v: Py<PyArrayDyn<T>>, y: Py<PyArrayDyn<T>> },
}

impl<T: Of> Arrays<T> {
    /// Does something with them.
    fn with<R>(&mut self, py: Python<'_>, act: impl FnOnce(&mut [T], &mut [T]) -> PyResult<R>) -> PyResult<R> {
        match self {
            Arrays::Few { buffers, copies: (v, y) } => {
                buffers.0.copy_to_slice(py, v)?;
                buffers.1.copy_to_slice(py, y)?;
                let result = act(v, y);
                buffers.0.copy_from_slice(py, v)?;
                buffers.1.copy_from_slice(py, y)?;
                result
            }
            Arrays::Many { v, y } => {
                let (mut v, mut y) = (v.bind(py).try_readwrite().map_err(in_use)?, y.bind(py).try_readwrite().map_err(in_use)?);
                act(v.as_slice_mut()?, y.as_slice_mut()?)
            }
        }
    }
}

/// The array of the force, which the caller changes.
enum ForceArray<T: Of> {
    /// A few numbers are copied.
    Few { buffer: PyBuffer<T>, copy: Vec<T> },
    /// Many are read where they are.
    Many(Py<PyArray1<T>>),
}

impl<T: Of> ForceArray<T> {
    fn new(py: Python<'_>, array: Py<PyArray1<T>>) -> PyResult<ForceArray<T>> {
        let numbers = array.bind(py).len()?;
        if numbers > COPIED_NUMBERS {
            return Ok(ForceArray::Many(array));
        }
        Ok(ForceArray::Few { buffer: PyBuffer::get(array.bind(py))?, copy: vec![T::default(); numbers] })
    }

    /// Gives the world the force in the array.
    fn read(&mut self, py: Python<'_>, world: &mut world::World<T>) -> PyResult<()> {
        match self {
            ForceArray::Few { buffer, copy } => {
                buffer.copy_to_slice(py, copy)?;
                world.set_force(copy);
            }
            ForceArray::Many(array) => world.set_force(array.bind(py).try_readonly().map_err(in_use)?.as_slice()?),
        }
        Ok(())
    }
}

/// An array of a parameter, which the caller changes.
struct LiveArray {
    name: String,
    array: Py<PyArray1<f64>>,
    /// Its numbers now, and as they were read last.
    now: Vec<f64>,
    last: Vec<f64>,
    /// The number of its first row among those of all parameters, and how long its rows are.
    place: usize,
    width: usize,
    /// The bounds of its numbers: above the first, at most the second.
    bounds: (f64, f64),
}

/// The parameters of a world that change between steps.
struct Live {
    signature: Arc<Signature>,
    rows: Vec<Vec<f64>>,
    tables: Vec<(f64, f64, Vec<Vec<f64>>)>,
    arrays: Vec<LiveArray>,
    /// Whether rows are not yet those of the world, since an array behind them was refused.
    waits: bool,
}

impl Live {
    /// The parameters behind these arrays: a name, the array, the rows that it is, and the bounds of its numbers.
    fn new(py: Python<'_>, model: &ModelSpec, arrays: Vec<WatchedArray>) -> PyResult<Live> {
        let copied = |rows: Vec<Row<'_>>| rows.iter().map(|row| row.0.to_vec()).collect::<Vec<_>>();
        let (mut rows, mut tables, mut live) = (Vec::new(), Vec::new(), Vec::new());
        for array in &model.rows(py)? {
            rows.extend(copied(by_row(array)?));
        }
        for (start, interval, samples) in &model.tables(py)? {
            tables.push((*start, *interval, copied(by_row(samples)?)));
        }
        for (name, array, row, least, most) in arrays {
            let last = array.bind(py).try_readonly().map_err(in_use)?.as_slice()?.to_vec();
            let rows_of_it = model.signature.count(&row);
            let Some(place) = model.signature.place(&row).filter(|_| rows_of_it > 0) else {
                return Err(argument_error(format!("{name}: there is no such row")));
            };
            let width = last.len() / rows_of_it;
            live.push(LiveArray { name, array, now: last.clone(), last, place, width, bounds: (least, most) });
        }
        Ok(Live { signature: Arc::clone(&model.signature), rows, tables, arrays: live, waits: false })
    }

    /// Gives the world the numbers in the arrays, if they have changed.
    fn read<T: Of>(&mut self, py: Python<'_>, world: &mut world::World<T>, changes: &AtomicI64) -> PyResult<()> {
        let Live { rows, arrays, waits, .. } = self;
        for LiveArray { name, array, now, last, place, width, bounds } in arrays {
            let array = array.bind(py);
            if last.len() <= ONE_BY_ONE {
                // To borrow an array takes longer than to read some numbers of it.
                now.iter_mut().enumerate().for_each(|(i, now)| *now = array.get_owned([i]).unwrap_or(f64::NAN));
            } else {
                now.copy_from_slice(array.try_readonly().map_err(in_use)?.as_slice()?);
            }
            if now.iter().zip(&*last).all(|(now, last)| now.to_bits() == last.to_bits()) {
                continue;
            }
            let (least, most) = *bounds;
            if let Some(wrong) = now.iter().find(|number| !(**number > least && **number <= most)) {
                let bounds = match least {
                    0.0 => " above zero",
                    least if least.is_finite() => " of zero or more",
                    _ => "",
                };
                return Err(argument_error(format!(
                    "world.parameters[{name:?}]: expected finite numbers{bounds}, got {wrong}; no step was made"
                )));
            }
            last.copy_from_slice(now);
            for (row, numbers) in rows[*place..].iter_mut().zip(last.chunks_exact(*width)) {
                row.copy_from_slice(numbers);
            }
            *waits = true;
        }
        if std::mem::take(&mut self.waits) {
            changes.fetch_add(1, Relaxed);
            world.renew(&Spec {
                signature: Arc::clone(&self.signature),
                rows: borrowed(&self.rows),
                tables: self.tables.iter().map(|(start, interval, samples)| table(*start, *interval, samples)).collect(),
            });
        }
        Ok(())
    }
}

fn borrowed(rows: &[Vec<f64>]) -> Vec<Row<'_>> {
    rows.iter().map(|row| Row(row)).collect()
}

fn table(start: f64, interval: f64, samples: &[Vec<f64>]) -> Table<'_> {
    Table { samples: borrowed(samples), start, interval }
}

/// A name, its array, the parameter whose rows it has, and the bounds of its numbers: above the first, at most the second.
type WatchedArray = (String, Py<PyArray1<f64>>, String, f64, f64);

/// Arrays of parameters of up to this many numbers are read number by number.
const ONE_BY_ONE: usize = 16;
/// Arrays of up to this many numbers are copied.
const COPIED_NUMBERS: usize = 256;
/// Other threads of Python go on meanwhile, unless a call is shorter than this part of the time between two checks: releasing the
/// GIL would take longer than the call.
const CALL_IS_SHORT: i64 = 64;
/// Larger arrays are checked once in this many steps for whether they are finite.
const STEPS_PER_CHECK: i64 = 8;
/// Steps above this are no longer exact as floating-point numbers.
const LAST_STEP: i64 = 1 << 53;

/// The numbers in the arrays of a world.
trait Of: Steppable + Element + PyElement {}
impl<T: Steppable + Element + PyElement> Of for T {}

/// A loop over arrays of float64 or of float32.
enum Loops {
    Double(Loop<f64>),
    Single(Loop<f32>),
}

/// A prepared loop. It holds both arrays.
#[pyclass(module = "stepwell._core", frozen)]
pub struct World {
    loop_: Mutex<Loops>,
    clock: Clock,
    /// The step number, for other threads to read while it is being stepped.
    step: AtomicI64,
    /// How often parameters or members were set.
    changes: AtomicI64,
}

struct Loop<T: Of> {
    world: world::World<T>,
    arrays: Arrays<T>,
    force: Option<ForceArray<T>>,
    live: Option<Live>,
    /// Steps since it was last checked whether the state is finite.
    unchecked: i64,
    /// The event search of its members between calls.
    between: world::Between,
}

impl<T: Of> Loop<T> {
    /// A loop over these arrays.
    fn new(
        py: Python<'_>,
        mut world: world::World<T>,
        v: Py<PyArrayDyn<T>>,
        y: Py<PyArrayDyn<T>>,
        carry: Option<PyReadonlyArray1<T>>,
        force: Option<Py<PyArray1<T>>>,
    ) -> PyResult<Loop<T>> {
        let sizes = world.sizes();
        let (mut v_now, mut y_now) = (v.bind(py).try_readwrite().map_err(in_use)?, y.bind(py).try_readwrite().map_err(in_use)?);
        let (v_now, y_now) = (v_now.as_slice_mut()?, y_now.as_slice_mut()?);
        if (v_now.len(), y_now.len()) != sizes {
            return Err(argument_error("v and y must be of the system's shape".to_owned()));
        }
        if let Some(carry) = carry {
            world.carry_on(carry.as_slice()?, v_now, y_now);
        }
        let force = force.map(|array| ForceArray::new(py, array)).transpose()?;
        let arrays = if sizes.0.max(sizes.1) <= COPIED_NUMBERS {
            let buffers = (PyBuffer::get(v.bind(py))?, PyBuffer::get(y.bind(py))?);
            Arrays::Few { buffers, copies: (vec![T::default(); sizes.0], vec![T::default(); sizes.1]) }
        } else {
            Arrays::Many { v, y }
        };
        Ok(Loop { world, arrays, force, live: None, unchecked: 0, between: Default::default() })
    }

    /// `n` steps; long calls let other threads run and check for Ctrl-C. Whether a number of the state is not finite then.
    fn advance(&mut self, py: Python<'_>, mut n: i64, at: &AtomicI64, changes: &AtomicI64) -> PyResult<bool> {
        let Loop { world, arrays, force, live, unchecked, .. } = self;
        // To check many numbers takes a part of the time of a step.
        *unchecked += if matches!(arrays, Arrays::Few { .. }) { STEPS_PER_CHECK } else { n };
        let checks = *unchecked >= STEPS_PER_CHECK;
        if checks {
            *unchecked = 0;
        }
        if let Some(live) = live {
            live.read(py, world, changes)?;
        }
        if let Some(force) = force {
            force.read(py, world)?;
        }
        arrays.with(py, |v, y| {
            let Some(steps_between_checks) = world.steps_between_checks() else {
                let result = interruptible(py, None, |monitor| world.step_in_background(n, v, y, monitor));
                at.store(world.step_number(), Relaxed);
                return result.map(|()| checks && !world::are_finite(v, y));
            };
            while n > steps_between_checks {
                py.detach(|| world.step(steps_between_checks, v, y));
                n -= steps_between_checks;
                at.store(world.step_number(), Relaxed);
                listen(py)?;
            }
            if n > steps_between_checks / CALL_IS_SHORT {
                py.detach(|| world.step(n, v, y));
            } else {
                world.step(n, v, y);
            }
            at.store(world.step_number(), Relaxed);
            Ok(checks && !world::are_finite(v, y))
        })
    }
}

impl Loop<f64> {
    /// `n` steps with events.
    fn advance_and_look(
        &mut self,
        py: Python<'_>,
        n: i64,
        events: &EventsOf<'_>,
        (at, changes): (&AtomicI64, &AtomicI64),
    ) -> PyResult<(bool, AllFound)> {
        let Loop { world, arrays, force, live, between, .. } = self;
        if let Some(live) = live {
            live.read(py, world, changes)?;
        }
        if let Some(force) = force {
            force.read(py, world)?;
        }
        let events = events.of_core(world.members())?;
        let is_long = n > world.steps_between_checks().unwrap_or(0) / CALL_IS_SHORT;
        let bad = arrays.with(py, |v, y| {
            if is_long {
                interruptible(py, None, |monitor| {
                    let is_made = world.step_and_look(n, [&mut *v, &mut *y], &events, between, &mut || monitor(0.0));
                    if is_made { Ok(()) } else { Err(Error::Interrupted) }
                })?;
            } else {
                world.step_and_look(n, [&mut *v, &mut *y], &events, between, &mut || true);
            }
            Ok(!world::are_finite(v, y))
        });
        at.store(world.step_number(), Relaxed);
        Ok((bad?, found(py, &events)))
    }
}

/// The output of a step of episodes: observations by members, rewards, and whether members ended and were cut off.
struct Made<'a> {
    seen: &'a mut [f32],
    rewards: &'a mut [f64],
    truths: &'a mut [bool],
}

impl<T: Of> Loop<T> {
    /// One step, after which only the first rows of y go on.
    fn play(&mut self, py: Python<'_>, [kept, read]: [usize; 2], made: Made<'_>, changes: &AtomicI64) -> PyResult<()> {
        let Loop { world, arrays, force, live, .. } = self;
        if let Some(live) = live {
            live.read(py, world, changes)?;
        }
        if let Some(force) = force {
            force.read(py, world)?;
        }
        let Made { seen, rewards, truths } = made;
        let (members, numbers) = (rewards.len(), seen.len() / rewards.len().max(1));
        let fits = kept <= read && world.sizes() == (0, (read + MADE + numbers) * members) && truths.len() == 2 * members;
        if !fits {
            return Err(argument_error("rows, observations and rewards must be of one number of members".to_owned()));
        }
        let (ended, cut) = truths.split_at_mut(members);
        arrays.with(py, |_, y| {
            world.play([kept, read], y, |behind, first, count, lanes| {
                let row = |i: usize| &behind[i * lanes..][..count];
                let flag = |to: &mut bool, number: &T| *to = number.wide() != 0.0;
                rewards[first..][..count].iter_mut().zip(row(0)).for_each(|(to, number)| *to = number.wide());
                ended[first..][..count].iter_mut().zip(row(1)).for_each(|(to, number)| flag(to, number));
                cut[first..][..count].iter_mut().zip(row(2)).for_each(|(to, number)| flag(to, number));
                let seen = &mut seen[first * numbers..][..count * numbers];
                let behind = &behind[MADE * lanes..];
                match numbers {
                    1 => by_member::<T, 1>(seen, behind, lanes),
                    2 => by_member::<T, 2>(seen, behind, lanes),
                    3 => by_member::<T, 3>(seen, behind, lanes),
                    4 => by_member::<T, 4>(seen, behind, lanes),
                    6 => by_member::<T, 6>(seen, behind, lanes),
                    _ => {
                        for (i, row) in behind.chunks_exact(lanes).take(numbers).enumerate() {
                            let own = seen.iter_mut().skip(i).step_by(numbers);
                            own.zip(row).for_each(|(to, number)| *to = number.wide() as f32);
                        }
                    }
                }
            });
            Ok(())
        })
    }
}

/// The rows before what is seen: the reward and two truths.
const MADE: usize = 3;

/// Rows of N numbers, by member: where N is known, each member is written at once.
fn by_member<T: Of, const N: usize>(seen: &mut [f32], rows: &[T], lanes: usize) {
    let members = seen.as_chunks_mut::<N>().0;
    let rows: [&[T]; N] = std::array::from_fn(|i| &rows[i * lanes..][..members.len()]);
    for (m, member) in members.iter_mut().enumerate() {
        *member = std::array::from_fn(|i| rows[i][m].wide() as f32);
    }
}

/// The attributes of a plan that are read: see `Plan` in `runs/engine/plan.py`.
#[derive(FromPyObject)]
struct WorldPlan {
    t0: f64,
    dt: f64,
    choice: usize,
    first: i64,
    members: usize,
}

#[pymethods]
impl World {
    #[new]
    #[pyo3(signature = (model, plan, v, y, carry = None, force = None))]
    fn new(
        py: Python<'_>,
        model: &ModelSpec,
        plan: WorldPlan,
        v: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
        carry: Option<&Bound<'_, PyAny>>,
        force: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let WorldPlan { t0, dt, choice, first, members } = plan;
        let (clock, machine) = (Clock { t0, h: dt }, machine()?);
        let rows = model.rows(py)?;
        let tables = model.tables(py)?;
        let precision = model.precision;
        let model = model.model(model.started(choice), &rows, &tables)?;
        macro_rules! over {
            ($kind:ident) => {{
                let world = world::World::new(&model, clock, machine, members, first).map_err(core_error)?;
                let carry = carry.map(|carry| carry.extract()).transpose()?;
                let force = force.map(|force| force.extract()).transpose()?;
                Loops::$kind(Loop::new(py, world, v.extract()?, y.extract()?, carry, force)?)
            }};
        }
        let made = match precision {
            Precision::Double => over!(Double),
            Precision::Single => over!(Single),
        };
        Ok(World { loop_: Mutex::new(made), clock, step: AtomicI64::new(first), changes: AtomicI64::new(0) })
    }

    /// `n` steps, in place. Whether a number of the state is not finite then, if that was checked.
    #[pyo3(signature = (n = None), text_signature = "($self, n=1)")]
    fn step(&self, py: Python<'_>, n: Option<&Bound<'_, PyAny>>) -> PyResult<bool> {
        let most = LAST_STEP - self.step.load(Relaxed);
        let n = match n {
            None if most >= 1 => 1,
            Some(n) if n.is_exact_instance_of::<PyInt>() && n.extract().is_ok_and(|n: i64| (0..=most).contains(&n)) => {
                n.extract()?
            }
            // What is no such number: Python says what is wrong with it, or what whole number it is.
            other => {
                let n = other.map_or_else(|| 1.into_pyobject(py).map(Bound::into_any), |n| Ok(n.clone()))?;
                py.import("stepwell.base.checks")?.getattr("count")?.call1(("n", n, 0, most))?.extract()?
            }
        };
        self.alone(|of| match of {
            Loops::Double(of) => of.advance(py, n, &self.step, &self.changes),
            Loops::Single(of) => of.advance(py, n, &self.step, &self.changes),
        })
    }

    /// `n` steps with events, in place. Whether a number of the state is not finite then, and what was found.
    fn step_and_look(&self, py: Python<'_>, n: i64, events: EventsOf<'_>) -> PyResult<(bool, AllFound)> {
        self.alone(|of| match of {
            Loops::Double(of) => of.advance_and_look(py, n, &events, (&self.step, &self.changes)),
            Loops::Single(_) => Err(argument_error("events of float32 are looked for by Python".to_owned())),
        })
    }

    /// One step of episodes: the first rows of y go on, as many as the first number says, and those up to the second are read
    /// only. The rows behind these are a reward, two truths and what is seen, which are written to the arrays instead.
    fn play(
        &self,
        py: Python<'_>,
        rows: [usize; 2],
        seen: &Bound<'_, PyArray2<f32>>,
        rewards: &Bound<'_, PyArray1<f64>>,
        truths: &Bound<'_, PyArray2<bool>>,
    ) -> PyResult<()> {
        let (mut seen, mut rewards) = (seen.try_readwrite().map_err(in_use)?, rewards.try_readwrite().map_err(in_use)?);
        let mut truths = truths.try_readwrite().map_err(in_use)?;
        let made = Made { seen: seen.as_slice_mut()?, rewards: rewards.as_slice_mut()?, truths: truths.as_slice_mut()? };
        self.alone(|loops| match loops {
            Loops::Double(own) => own.play(py, rows, made, &self.changes),
            Loops::Single(own) => own.play(py, rows, made, &self.changes),
        })?;
        self.step.fetch_add(1, Relaxed);
        Ok(())
    }

    /// Goes on with other parameters from the state that is in the arrays. Arrays of parameters are not read any more.
    fn take(&self, py: Python<'_>, model: &ModelSpec, plan: WorldPlan) -> PyResult<()> {
        let machine = machine()?;
        let (rows, tables) = (model.rows(py)?, model.tables(py)?);
        let model = model.model(model.started(plan.choice), &rows, &tables)?;
        let step = self.step.load(Relaxed);
        self.alone(|loops| {
            macro_rules! over {
                ($own:ident) => {{
                    $own.world = world::World::new(&model, self.clock, machine, plan.members, step).map_err(core_error)?;
                    $own.live = None;
                }};
            }
            match loops {
                Loops::Double(own) => over!(own),
                Loops::Single(own) => over!(own),
            }
            self.changes.fetch_add(1, Relaxed);
            Ok(())
        })
    }

    /// Reads these arrays of parameters before each call of `step`, in place of those before. The rest is as in the model.
    fn watch(&self, py: Python<'_>, model: &ModelSpec, arrays: Vec<WatchedArray>) -> PyResult<()> {
        let live = Live::new(py, model, arrays)?;
        self.alone(|loops| {
            match loops {
                Loops::Double(own) => own.live = Some(live),
                Loops::Single(own) => own.live = Some(live),
            }
            Ok(())
        })
    }

    /// Reads the arrays of parameters now.
    fn read(&self, py: Python<'_>) -> PyResult<()> {
        fn of<T: Of>(py: Python<'_>, Loop { world, live, .. }: &mut Loop<T>, changes: &AtomicI64) -> PyResult<()> {
            live.as_mut().map_or(Ok(()), |live| live.read(py, world, changes))
        }
        self.alone(|loops| match loops {
            Loops::Double(own) => of(py, own, &self.changes),
            Loops::Single(own) => of(py, own, &self.changes),
        })
    }

    /// Starts these members again from their state in the arrays; all others go on with this carry, by rows.
    fn restart(&self, py: Python<'_>, members: Vec<usize>, carry: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        fn of<T: Of>(py: Python<'_>, own: &mut Loop<T>, members: &[usize], carry: &Bound<'_, PyAny>) -> PyResult<()> {
            let Loop { world, arrays, .. } = own;
            let mut carry = carry.extract::<PyReadonlyArray1<'_, T>>()?.as_slice()?.to_vec();
            arrays.with(py, |v, y| {
                world.restart(members, &mut carry, v, y);
                Ok(())
            })
        }
        self.changes.fetch_add(1, Relaxed);
        let Some(carry) = carry else { return Ok(()) };
        self.alone(|loops| match loops {
            Loops::Double(own) => of(py, own, &members, carry),
            Loops::Single(own) => of(py, own, &members, carry),
        })
    }

    /// How often parameters or members were set.
    #[getter]
    fn changes(&self) -> i64 {
        self.changes.load(Relaxed)
    }

    /// The carry, by rows; None if the next step begins with v itself.
    fn carry<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        fn of<'py, T: Of>(py: Python<'py>, Loop { world, arrays, .. }: &mut Loop<T>) -> PyResult<Option<Bound<'py, PyAny>>> {
            let carry = arrays.with(py, |v, y| Ok(world.carry(v, y)))?;
            Ok(carry.map(|carry| carry.into_pyarray(py).into_any()))
        }
        self.alone(|loops| match loops {
            Loops::Double(own) => of(py, own),
            Loops::Single(own) => of(py, own),
        })
    }

    /// Goes on with this carry, by rows, which belongs to what is in the arrays now.
    fn carry_on(&self, py: Python<'_>, carry: &Bound<'_, PyAny>) -> PyResult<()> {
        fn of<T: Of>(py: Python<'_>, Loop { world, arrays, .. }: &mut Loop<T>, carry: &Bound<'_, PyAny>) -> PyResult<()> {
            let carry: PyReadonlyArray1<'_, T> = carry.extract()?;
            arrays.with(py, |v, y| {
                world.carry_on(carry.as_slice()?, v, y);
                Ok(())
            })
        }
        self.alone(|loops| match loops {
            Loops::Double(own) => of(py, own, carry),
            Loops::Single(own) => of(py, own, carry),
        })
    }

    /// The memory of a sampled controller, by rows.
    fn memory<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.alone(|loops| {
            Ok(match loops {
                Loops::Double(own) => own.world.memory().into_pyarray(py).into_any(),
                Loops::Single(own) => own.world.memory().into_pyarray(py).into_any(),
            })
        })
    }

    /// Sets the memory of a sampled controller, by rows.
    fn remember(&self, memory: &Bound<'_, PyAny>) -> PyResult<()> {
        fn of<T: Of>(own: &mut Loop<T>, memory: &Bound<'_, PyAny>) -> PyResult<()> {
            own.world.remember(memory.extract::<PyReadonlyArray1<'_, T>>()?.as_slice()?);
            Ok(())
        }
        self.alone(|loops| match loops {
            Loops::Double(own) => of(own, memory),
            Loops::Single(own) => of(own, memory),
        })
    }

    /// The time at which the world stands.
    #[getter]
    fn t(&self) -> f64 {
        self.clock.at(self.step.load(Relaxed))
    }

    /// The number of the step at which the world stands.
    #[getter]
    fn step_number(&self) -> i64 {
        self.step.load(Relaxed)
    }
}

/// The instruction set and threads of the loops of worlds.
pub(crate) fn machine() -> PyResult<Machine> {
    Ok(Machine { level: Level::choose().map_err(|unknown| core_error(unknown.into()))?, threads: 1 })
}

impl World {
    /// Does something unless another thread is stepping the world. Waiting could deadlock: that thread may be waiting for the
    /// GIL.
    fn alone<R>(&self, act: impl FnOnce(&mut Loops) -> PyResult<R>) -> PyResult<R> {
        match self.loop_.try_lock() {
            Ok(mut of) => act(&mut of),
            Err(TryLockError::WouldBlock) => {
                Err(error_of("BusyError", "the world is being stepped by another thread; one at a time may do that".to_owned()))
            }
            // After a panic within a step the slots are not valid any more.
            Err(TryLockError::Poisoned(_)) => {
                Err(error_of("BusyError", "a step of this world broke off; make a new one".to_owned()))
            }
        }
    }
}

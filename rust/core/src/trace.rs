//! Traces a system and a method to the tapes of a run, split by how often their values change.

use std::{
    collections::HashMap,
    hash::Hash,
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
        atomic::{AtomicUsize, Ordering::Relaxed},
    },
};

use crate::{
    contact,
    contact::Contacts,
    controls,
    error::Error,
    large::{Facts, MAX_TAPE_OPERATIONS, group::Courses, tapes::Rated},
    method::Record,
    number::{Number, Symbol, record},
    pace::{Acceptance, Attempted, Backward, Pace, Scales, Stretched, attempt},
    program::{Program, Terms},
    real::{Precision, Real},
    run::stage::Stage,
    series_pace,
    spec::{Given, Parameters},
    system::{Block, Kind, Shape, System},
    systems::{
        equations::{Equations, next_state},
        linear::products,
    },
    tape::{Counts, Id, Op, Tape, fuse::fuse, split::split_with_times},
    watch, window,
};

/// The kind of step.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum How {
    /// A method, by its name, started in its `choice`-th way.
    Method {
        /// The method's name.
        name: String,
        /// Which of its ways to start.
        choice: usize,
    },
    /// Attempts at adaptive steps by a method.
    Attempts {
        /// The method's name.
        name: String,
        /// The order of its series, if it is one; 0 for that of a step of fixed length.
        order: u32,
        /// What a step must satisfy.
        acceptance: Acceptance,
        /// Whether the time of the run is that of the system, negated.
        backward: bool,
    },
    /// A step that is given as operations.
    Step(Arc<Equations>),
    /// The transition-matrix form (Appendix B): s ← P·s + Σ Q·u, with the inputs at these nodes, by the bits of each.
    Matrix {
        /// Times of the inputs, as fractions of a step, by their bits.
        nodes: Vec<u64>,
    },
}

/// The key of a tape.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Scene {
    /// What is given.
    pub given: Arc<Given>,
    /// What makes the step.
    pub how: How,
    /// Quantities that are recorded beside states.
    pub record: Vec<String>,
    /// Whether steps are computed with fused multiply-adds: see [`fuse`]. Recorded quantities are not.
    pub fused: bool,
    /// The numbers that steps are computed with.
    pub precision: Precision,
}

/// The tapes of a scene.
pub struct Tapes<T: Real = f64> {
    /// One step, or one attempt, of the whole state. Attempts by a series return its coefficients behind the state.
    pub step: Stage<T>,
    /// The same attempt by coefficients that are known, behind the state: saved states, and a held step when it is taken. Not where
    /// operations are fused, for the attempt may fuse what made the coefficients.
    pub by_terms: Option<Stage<T>>,
    /// Of attempts: the pace behind the state, as it is at the start: see [`Pace::begun`]. Its operations are never fused.
    pub begin: Option<Stage<T>>,
    /// Turns velocities into what the method carries.
    pub start: Option<Stage<T>>,
    /// Turns what the method carries into velocities.
    pub finish: Option<Stage<T>>,
    /// A step that also returns the velocities before it, after the next state, for a run that saves all of them; None if the state has
    /// them already.
    pub shown: Option<Stage<T>>,
    /// The recorded numbers, behind v and y.
    pub record: Option<Stage<T>>,
    /// Operations of a step before equal ones were merged, but for those that a method does to blocks.
    pub written: Counts,
    /// To how many evaluations of the rates a step with a series is equal, by the operations; 0 without one.
    pub series_evaluations: usize,
}

/// The properties and tapes of a scene. Expensive ones are found on first use.
pub struct Traced {
    scene: Scene,
    /// How large the blocks are.
    pub shape: Shape,
    /// How many numbers of the state stand behind v and y: a sum over the steps, the tally, if the system has one; what is watched.
    pub tally: usize,
    /// How many numbers are recorded.
    pub recorded: usize,
    /// Whether the method has a carry instead of v between steps.
    pub carries: bool,
    /// Whether steps are made by a series, which is one tape however long.
    pub series: bool,
    /// Approximate numbers of operations of the rates and of a step.
    pub operations: (usize, usize),
    tapes: OnceLock<Arc<Tapes>>,
    /// The same for numbers of 32 bits.
    singles: OnceLock<Arc<Tapes<f32>>>,
    /// By what is known of rates.
    courses: Mutex<Vec<(Facts, Arc<Courses>)>>,
}

/// A traced step, before it is cut: for tests, listings and comparisons.
#[derive(Clone, Debug)]
pub struct Steps {
    /// The tape.
    pub tape: Tape,
    /// The next state.
    pub next: Vec<Id>,
    /// How large the blocks are.
    pub shape: Shape,
    /// Whether a tally stands behind them.
    pub tally: bool,
    /// The coefficients of a series, of adaptive steps.
    pub terms: Vec<Id>,
}

/// The leaves of a tape: parameters, sampled inputs, the step.
pub(crate) fn parameters(given: &Given, h: Symbol) -> Parameters<'_, Symbol> {
    let numbers = (0..given.parameters() as u32).map(|i| Symbol::new(Op::Param(i))).collect();
    Parameters { given, h, numbers, sample: window::sample }
}

/// The parameter that is each member's own time of step 0, where they have some: the clock's is then 0.
pub const BEGINS: &str = "time.begins";

/// The time of a step.
pub(crate) fn time(given: &Given) -> Symbol {
    let clock = Symbol::new(Op::Time);
    match given.place(BEGINS) {
        Some(row) => Symbol::new(Op::Param(row as u32)) + clock,
        None => clock,
    }
}

/// Numbers of the state.
pub(crate) fn block(first: usize, count: usize) -> Block<Symbol> {
    Block::from_fn(count, |i, _| Symbol::new(Op::State((first + i) as u32)))
}

/// The system of a scene, scaled to the step h, under its control if it has one.
fn system(kind: &Kind, p: &Parameters<Symbol>, tally: Symbol) -> Box<dyn System<Symbol>> {
    controls::wrap(p, contact::wrap(p, (kind.make)(p)), tally)
}

/// The kind of system that is given.
pub(crate) fn kind(given: &Given) -> Result<&'static Kind, Error> {
    let known = || crate::systems::KINDS.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", ");
    crate::system::kind(&given.system).ok_or_else(|| Error::UnknownSystem { name: given.system.clone(), known: known() })
}

/// The record of a method.
pub(crate) fn method(name: &str) -> Result<&'static Record, Error> {
    let known = || crate::steppers::RECORDS.iter().map(|r| r.name).collect::<Vec<_>>().join(", ");
    crate::method::record(name).ok_or_else(|| Error::UnknownMethod { name: name.to_owned(), known: known() })
}

/// The size of the blocks of a scene, or an error if its parameters are wrong or the method cannot step it.
pub fn shape(given: &Given, how: &How) -> Result<Shape, Error> {
    match how {
        How::Matrix { .. } => {
            let (n, v) = (given.whole("n"), given.whole("n_v").min(given.whole("n")));
            Ok(Shape { v, y: n - v })
        }
        How::Step(step) => step.fit(given),
        How::Method { name, .. } | How::Attempts { name, .. } => kind(given)?.fit(given, method(name)?),
    }
}

/// Numbers of a recorded quantity.
fn quantity(given: &Given, name: &str) -> Result<usize, Error> {
    let known = (kind(given)?.quantities)(given);
    let found = known.iter().find(|(known, _)| *known == name);
    found
        .map(|(_, numbers)| *numbers)
        .ok_or_else(|| Error::Options { system: given.system.clone(), options: format!("record {name}") })
}

/// How many numbers are recorded in all.
pub fn recorded(given: &Given, names: &[String]) -> Result<usize, Error> {
    names.iter().try_fold(0, |sum, name| Ok(sum + quantity(given, name)?))
}

/// The number of a parameter that no system has: the most attempts of a member.
pub const BUDGET: u32 = u32::MAX / 4;

/// Traces one step of a scene onto a tape that may hold something already.
pub fn trace_step(tape: Tape, given: &Given, how: &How) -> Result<Steps, Error> {
    let shape = shape(given, how)?;
    match how {
        How::Matrix { nodes } => {
            let (tape, next) = record(tape, || matrix(given, shape, nodes));
            Ok(Steps { tape, next, shape, tally: false, terms: Vec::new() })
        }
        How::Step(step) => {
            let (tape, next) = record(tape, || {
                let p = parameters(given, Symbol::new(Op::Step));
                let (v, y) = (block(0, shape.v), block(shape.v, shape.y));
                ids([&next_state(step, &p, time(given), &v, &y)])
            });
            Ok(Steps { tape, next, shape, tally: false, terms: Vec::new() })
        }
        How::Method { name, choice } => {
            let (kind, method) = (kind(given)?, method(name)?);
            let carries = method.carry.is_some();
            let seen = || window::of_step(time(given), Symbol::new(Op::Step), carries);
            let (tape, (next, tally)) = record(tape, || window::over(given, seen, || step(kind, given, shape, method, *choice)));
            Ok(Steps { tape, next, shape, tally, terms: Vec::new() })
        }
        How::Attempts { name, order, acceptance, backward } => {
            let (kind, method) = (kind(given)?, method(name)?);
            let (Some(program), Some(estimate)) = (method.attempt(), &method.estimate) else { return Err(Error::NoEstimate) };
            if contact::is_given(given) {
                return Err(given.unknown("contact_0"));
            }
            let scene = AttemptsOf { kind, given, shape, acceptance, backward: *backward };
            let (tape, (next, terms)) = record(tape, || match series_order(&program, *order) {
                Some(order) => scene.series(order),
                None => (scene.attempts(&program, estimate.order), Vec::new()),
            });
            Ok(Steps { tape, next, shape, tally: false, terms })
        }
    }
}

/// The order of the series of attempts, if the method has one: the one that was asked for, or that of steps of fixed length.
fn series_order(program: &Program, asked: u32) -> Option<u32> {
    match program.series_order() {
        0 => None,
        own if asked == 0 => Some(own),
        _ => Some(asked),
    }
}

/// The values of blocks.
pub(crate) fn ids<'a>(blocks: impl IntoIterator<Item = &'a Block<Symbol>>) -> Vec<Id> {
    blocks.into_iter().flat_map(|block| block.iter().map(|symbol| symbol.0)).collect()
}

fn step(kind: &Kind, given: &Given, shape: Shape, method: &Record, choice: usize) -> (Vec<Id>, bool) {
    let (h, t) = (Symbol::new(Op::Step), time(given));
    let (v0, y0) = (block(0, shape.v), block(shape.v, shape.y));
    let p = parameters(given, h);
    let s = system(kind, &p, Symbol::new(Op::State((shape.v + shape.y) as u32)));
    let mut made = method.program().run(s.as_ref(), t, h, &v0, &y0).into_iter();
    let (new_v, new_y) = (made.next().unwrap_or_else(|| v0.clone()), made.next().unwrap_or_else(|| y0.clone()));
    let (mut v, mut y) = s.project(s.bring_to_rest(t, (&v0, &y0), new_v), new_y);
    if let Some(contacts) = Contacts::new(&p) {
        let carry = contact::carry(method, choice);
        [v, y] = contacts.after(carry.as_ref(), s.as_ref(), t, [&v0, &y0], [v, y]);
    }
    let mut next = ids([&v, &y]);
    let tally = s.tally();
    next.extend(tally.map(|tally| tally.0));
    let first = next.len();
    next.extend(watch::next(kind, &p, method, choice, t, [&v0, &y0], first));
    (next, tally.is_some())
}

/// What attempts at adaptive steps are traced of.
struct AttemptsOf<'a> {
    kind: &'a Kind,
    given: &'a Given,
    shape: Shape,
    acceptance: &'a Acceptance,
    backward: bool,
}

impl AttemptsOf<'_> {
    /// The system, scaled to a step.
    fn scaled(&self, h: Symbol) -> Box<dyn System<Symbol>> {
        if self.backward {
            return Box::new(Backward((self.kind.make)(&parameters(self.given, -h))));
        }
        (self.kind.make)(&parameters(self.given, h))
    }

    /// The system scaled to a step of 1, under its projection if there is one.
    fn projected(&self) -> Box<dyn System<Symbol>> {
        controls::wrap(&parameters(self.given, Symbol::of(1.0)), self.scaled(Symbol::of(1.0)), Symbol::of(0.0))
    }

    fn state(&self) -> (Block<Symbol>, Block<Symbol>) {
        (block(0, self.shape.v), block(self.shape.v, self.shape.y))
    }

    /// The pace as a part of the state, behind v and y, and the sizes behind it.
    fn pace(&self) -> (Pace<Symbol>, Scales<Symbol>) {
        let first = self.shape.v + self.shape.y;
        let pace = Pace::of(std::array::from_fn(|i| Symbol::new(Op::State((first + i) as u32))));
        let numbers = block(first + Pace::<Symbol>::NUMBERS, self.acceptance.numbers(self.shape.v, self.shape.y));
        (pace, Scales::of(numbers.as_slice(), self.acceptance.own))
    }

    /// The next state: v and y, the pace, and the sizes.
    fn next(&self, pace: &Pace<Symbol>, longest: &[Symbol], v: &Block<Symbol>, y: &Block<Symbol>) -> Vec<Id> {
        let own = self.pace().1.own;
        let mut next = ids([v, y]);
        next.extend(pace.numbers().iter().chain(longest).chain(&own).map(|symbol| symbol.0));
        next
    }

    fn attempts(&self, program: &Program, order: u32) -> Vec<Id> {
        let (given, (v, y), (pace, scales)) = (self.given, self.state(), self.pace());
        let rates = |step: Symbol| -> Box<dyn System<Symbol>> {
            if given.equations.is_some() {
                return self.scaled(step); // the push of their control depends on the step
            }
            let stretched = Box::new(Stretched { s: self.scaled(Symbol::of(1.0)), h: step });
            if controls::pushes(given) { controls::wrap(&parameters(given, step), stretched, Symbol::of(0.0)) } else { stretched }
        };
        let projected = if controls::pushes(given) { self.scaled(Symbol::of(1.0)) } else { self.projected() };
        let system = Attempted { rates: &rates, projected: projected.as_ref() };
        let budget = Symbol::new(Op::Param(BUDGET));
        let (pace, longest, v, y) = attempt(program, &system, order, self.acceptance, (pace, &scales), budget, &v, &y);
        self.next(&pace, &longest, &v, &y)
    }

    /// Steps by a series of that order, and its coefficients.
    fn series(&self, order: u32) -> (Vec<Id>, Vec<Id>) {
        let (v, y) = self.state();
        let (terms, branches) = series_pace::terms(order, self.scaled(Symbol::of(1.0)).as_ref(), &self.pace().0, &v, &y);
        let numbers = ids(terms.iter().flat_map(|(v, y)| [v, y]));
        (self.attempt_by((&terms, &branches), Some(self.scaled(Symbol::of(1.0)).as_ref())), numbers)
    }

    /// One attempt by coefficients of a series.
    fn attempt_by(&self, terms: series_pace::Known<Symbol>, rates: Option<&dyn System<Symbol>>) -> Vec<Id> {
        let ((v, y), (pace, scales)) = (self.state(), self.pace());
        let budget = Symbol::new(Op::Param(BUDGET));
        let projected = self.projected();
        let (pace, longest, v, y) =
            series_pace::attempt(terms, rates, projected.as_ref(), self.acceptance, (pace, &scales), budget, &v, &y);
        self.next(&pace, &longest, &v, &y)
    }

    /// Where a member stands at the start, without control.
    fn begin(&self, series: bool) -> Vec<Id> {
        let (v, y) = self.state();
        let (pace, longest) = self.pace().0.begun(self.scaled(Symbol::of(1.0)).as_ref(), self.acceptance, series, &v, &y);
        self.next(&pace, &longest, &v, &y)
    }
}

/// Traces where a member stands at the start, without control, onto a tape that may hold something already.
fn trace_begin(tape: Tape, given: &Given, how: &How) -> Result<(Tape, Vec<Id>), Error> {
    let How::Attempts { name, acceptance, backward, .. } = how else { return Err(Error::NoEstimate) };
    let kind = kind(given)?;
    let scene = AttemptsOf { kind, given, shape: (kind.shape)(given)?, acceptance, backward: *backward };
    let series = method(name)?.program().series_order() > 0;
    Ok(record(tape, || scene.begin(series)))
}

/// Traces an attempt by coefficients that stand behind the rest of the state, where they stay.
fn trace_by_terms(tape: Tape, given: &Given, how: &How, shape: Shape, numbers: usize) -> Result<(Tape, Vec<Id>), Error> {
    let How::Attempts { acceptance, backward, .. } = how else { return Err(Error::NoEstimate) };
    let scene = AttemptsOf { kind: kind(given)?, given, shape, acceptance, backward: *backward };
    Ok(record(tape, || {
        let state = shape.v + shape.y;
        let first = state + Pace::<Symbol>::NUMBERS + acceptance.numbers(shape.v, shape.y);
        let of = |k: usize| (block(first + k * state, shape.v), block(first + k * state + shape.v, shape.y));
        let terms: Terms<Symbol> = (0..numbers / state).map(of).collect();
        let mut next = scene.attempt_by((&terms, &[]), None);
        next.extend(block(first, numbers).iter().map(|symbol| symbol.0));
        next
    }))
}

/// s ← P·s + Σ Q·u; the sums run over s, then over the nodes and their inputs.
fn matrix(given: &Given, shape: Shape, nodes: &[u64]) -> Vec<Id> {
    let (h, t) = (Symbol::new(Op::Step), time(given));
    let p = parameters(given, h);
    let n = shape.v + shape.y;
    let mut columns: Vec<Symbol> = block(0, n).iter().copied().collect();
    let inputs: Vec<_> = (0..given.whole("inputs")).filter_map(|i| p.signal(&format!("inputs[{i}]"))).collect();
    window::over(
        given,
        || window::of_step(t, h, given.whole("carries") > 0),
        || {
            for node in nodes {
                let at = t + Symbol::of(f64::from_bits(*node)) * h;
                columns.extend(inputs.iter().map(|input| input.at(at)));
            }
        },
    );
    let (of_state, of_inputs) = (p.numbers("p"), p.numbers("q"));
    // P by rows; Q by columns, nodes and inputs, each with a number for every row.
    let entry = |i: usize, j: usize| if j < n { of_state[i * n + j] } else { of_inputs[(j - n) * n + i] };
    let made = products(n, columns.len(), |i, j| entry(i, j) * columns[j]);
    made.into_iter().map(|symbol| symbol.0).collect()
}

/// A system with surfaces and the force from outside: what a method's start and finish see.
pub(crate) fn around(kind: &Kind, p: &Parameters<Symbol>) -> Box<dyn System<Symbol>> {
    controls::force::wrap(p, contact::wrap(p, (kind.make)(p)))
}

/// Traces a program that changes the block v alone.
fn trace_slot(tape: Tape, given: &Given, program: &Program) -> Result<(Tape, Vec<Id>), Error> {
    let kind = kind(given)?;
    let shape = (kind.shape)(given)?;
    Ok(record(tape, || {
        let (h, t) = (Symbol::new(Op::Step), time(given));
        let (v, y) = (block(0, shape.v), block(shape.v, shape.y));
        let p = parameters(given, h);
        let made = || program.run(around(kind, &p).as_ref(), t, h, &v, &y).into_iter().next();
        ids([&window::over(given, || window::of_slot(t, h), made).unwrap_or_else(|| v.clone()), &y])
    }))
}

/// Traces the recorded quantities of a state onto a tape: a number behind v and y for each.
pub fn trace_record(tape: Tape, given: &Given, names: &[String]) -> Result<(Tape, Vec<Id>), Error> {
    let kind = kind(given)?;
    let shape = (kind.shape)(given)?;
    recorded(given, names)?;
    Ok(record(tape, || {
        let (v, y) = (block(0, shape.v), block(shape.v, shape.y));
        let s = (kind.make)(&parameters(given, Symbol::new(Op::Step)));
        let mut next = ids([&v, &y]);
        for name in names {
            next.extend(s.record(name, &v, &y).into_iter().flatten().map(|symbol| symbol.0));
        }
        next
    }))
}

/// Traces a part of a scene by its name, for comparisons: "step", "attempt", "begin", "start" and "finish" with the number of a way to start
/// behind them, or "record" with a quantity behind it.
pub fn trace(tape: Tape, given: &Given, how: &How, what: &str) -> Result<(Tape, Vec<Id>), Error> {
    let (what, which) = what.split_once(' ').unwrap_or((what, ""));
    let unknown = || Error::Options { system: given.system.clone(), options: format!("trace {what} {which}") };
    let name = match how {
        How::Method { name, .. } | How::Attempts { name, .. } => name.as_str(),
        How::Step(_) | How::Matrix { .. } => "",
    };
    let choice = which.parse().unwrap_or(0);
    match what {
        "step" => trace_step(tape, given, &started(how, choice)).map(|steps| (steps.tape, steps.next)),
        "attempt" if matches!(how, How::Attempts { .. }) => trace_step(tape, given, how).map(|steps| (steps.tape, steps.next)),
        "begin" => trace_begin(tape, given, how),
        "start" => trace_slot(tape, given, &method(name)?.start(choice).ok_or_else(unknown)?),
        "finish" => trace_slot(tape, given, &method(name)?.finish(choice).ok_or_else(unknown)?),
        "record" => trace_record(tape, given, &[which.to_owned()]),
        _ => Err(unknown()),
    }
}

/// The same method, started in its `choice`-th way.
fn started(how: &How, choice: usize) -> How {
    match how {
        How::Method { name, choice: before } => How::Method { name: name.clone(), choice: choice.max(*before) },
        other => other.clone(),
    }
}

/// Cuts a tape.
pub(crate) fn cut<T: Real>(given: &Given, (tape, next): &(Tape, Vec<Id>)) -> Stage<T> {
    let of_times = |table: u32| given.tables.get(table as usize).is_some_and(|(name, _)| name.ends_with(".times"));
    let shared = |i: u32| i == BUDGET || given.is_common(i);
    Stage::new(split_with_times(tape, next, &shared, &|table| given.is_common_table(table), &of_times))
}

/// Approximate numbers of operations of the rates of a scene and of a step.
fn operations(given: &Given, how: &How, shape: Shape) -> Result<(usize, usize), Error> {
    Ok(match how {
        How::Matrix { nodes } => {
            let n = shape.v + shape.y;
            let products = n * (n + given.whole("inputs") * nodes.len());
            (2 * products, 2 * products)
        }
        How::Step(step) => (step.operations(), step.operations()),
        How::Method { name, .. } | How::Attempts { name, .. } => {
            let rates = (kind(given)?.operations)(given);
            let method = method(name)?;
            let attempt = if matches!(how, How::Attempts { .. }) { method.attempt() } else { None };
            // Potentials take as long as forces, and are found at the end of a step, too, where a projection asks for them.
            let controls = if controls::is_given(given) { 2 } else { 1 };
            let contacts = contact::operations(given, shape);
            let program = attempt.unwrap_or_else(|| method.program());
            // The coefficient k of a product is a sum of k + 1 products.
            let order = match how {
                How::Attempts { order, .. } if *order > 0 && program.series_order() > 0 => *order as usize,
                _ => program.series_order() as usize,
            };
            let evaluations = if order > 0 { order * (order + 1) / 2 } else { program.evaluations() };
            (controls * rates, controls * rates * evaluations + contacts)
        }
    })
}

/// Whether steps are made by a series of the solution.
fn has_series(how: &How) -> Result<bool, Error> {
    Ok(match how {
        How::Method { name, .. } | How::Attempts { name, .. } => method(name)?.program().series_order() > 0,
        How::Step(_) | How::Matrix { .. } => false,
    })
}

/// The most operations, approximately, of a step that is one tape in any case: by a series, one that is given, or one of members that have
/// times of their own. It takes some ten nanoseconds a byte to compile.
const MAX_LONG_TAPE_OPERATIONS: usize = 100_000;

impl Scene {
    /// What is known of it, or was found before.
    pub fn traced(&self) -> Result<Arc<Traced>, Error> {
        static CACHE: OnceLock<Generation<Scene, Traced>> = OnceLock::new();
        Cache::find(CACHE.get_or_init(Generation::default).now(), self, || {
            let shape = shape(&self.given, &self.how)?;
            let operations = operations(&self.given, &self.how, shape)?;
            let series = has_series(&self.how)?;
            if series && operations.1 > MAX_LONG_TAPE_OPERATIONS {
                return Err(Error::TooLongForSeries { operations: operations.1, most: MAX_LONG_TAPE_OPERATIONS });
            }
            if self.fused && !series && operations.1 > MAX_TAPE_OPERATIONS {
                return Err(Error::TooLongToFuse { operations: operations.1, most: MAX_TAPE_OPERATIONS });
            }
            let own_times = self.given.count(BEGINS) > 0;
            if own_times && operations.1 > MAX_LONG_TAPE_OPERATIONS {
                return Err(Error::TooLongForTimes { operations: operations.1, most: MAX_LONG_TAPE_OPERATIONS });
            }
            if self.precision == Precision::Single {
                self.fits_single(operations.1)?;
            }
            let (mut tally, mut carries) = (0, false);
            if let How::Method { name, .. } = &self.how {
                watch::check(&self.given, shape)?;
                tally = usize::from(controls::is_given(&self.given)) + watch::numbers(&self.given);
                carries = method(name)?.carry.is_some();
            }
            if let How::Attempts { name, .. } = &self.how {
                controls::only_fixed(&self.given)?;
                method(name)?.estimate.as_ref().ok_or(Error::NoEstimate)?;
            }
            let traced = Traced {
                shape,
                tally,
                carries,
                series,
                recorded: recorded(&self.given, &self.record)?,
                operations,
                tapes: OnceLock::new(),
                singles: OnceLock::new(),
                courses: Mutex::default(),
                scene: self.clone(),
            };
            let is_one = series || own_times || matches!(self.how, How::Step(_));
            let most = if is_one { MAX_LONG_TAPE_OPERATIONS } else { 4 * MAX_TAPE_OPERATIONS };
            Ok((traced, operations.1.min(most)))
        })
    }
}

/// Operations of a step from which on it may take so long that Ctrl-C must be answered within it.
const LONG_STEP_OPERATIONS: usize = 1 << 24;

impl Traced {
    /// Whether a step of so many members may take long.
    pub fn is_long(&self, members: usize) -> bool {
        self.operations.1.saturating_mul(members) >= LONG_STEP_OPERATIONS
    }

    /// How many steps of so many members have that many operations; one or more.
    pub fn steps_of(&self, members: usize, operations: usize) -> i64 {
        (operations / self.operations.1.saturating_mul(members).max(1)).max(1) as i64
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The tapes of all that a run needs.
    pub fn tapes(&self) -> Result<Arc<Tapes>, Error> {
        self.tapes_of()
    }

    /// The same, for numbers of the scene's precision.
    pub fn tapes_of<T: Traceable>(&self) -> Result<Arc<Tapes<T>>, Error> {
        let known = T::known(self);
        if let Some(tapes) = known.get() {
            return Ok(Arc::clone(tapes));
        }
        let tapes = Arc::new(self.scene.trace()?);
        Ok(Arc::clone(known.get_or_init(|| tapes)))
    }

    /// The rates as tapes of their own.
    pub fn rated(&self) -> Result<Arc<Rated>, Error> {
        let Scene { given, record, .. } = &self.scene;
        Cache::find(rated(), &(given.clone(), record.clone()), || {
            let rated = Rated::new(given, record)?;
            let size = rated.size();
            Ok((rated, size))
        })
    }

    /// Whether these tapes are there already.
    pub fn is_rated(&self) -> bool {
        let Scene { given, record, .. } = &self.scene;
        rated().lock().unwrap_or_else(PoisonError::into_inner).known.contains_key(&(given.clone(), record.clone()))
    }

    /// How the method uses rates of which these facts are known.
    pub fn courses(&self, facts: Facts) -> Result<Arc<Courses>, Error> {
        let mut known = self.courses.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, courses)) = known.iter().find(|(of, _)| *of == facts) {
            return Ok(Arc::clone(courses));
        }
        let courses = Arc::new(Courses::new(&self.scene.how, facts, self.shape)?);
        known.push((facts, Arc::clone(&courses)));
        Ok(courses)
    }
}

/// Numbers whose tapes are kept.
pub trait Traceable: Real {
    /// Where.
    fn known(traced: &Traced) -> &OnceLock<Arc<Tapes<Self>>>;
}

impl Traceable for f64 {
    fn known(traced: &Traced) -> &OnceLock<Arc<Tapes<f64>>> {
        &traced.tapes
    }
}

impl Traceable for f32 {
    fn known(traced: &Traced) -> &OnceLock<Arc<Tapes<f32>>> {
        &traced.singles
    }
}

impl Scene {
    /// An error if a step of so many operations cannot be computed with numbers of 32 bits.
    fn fits_single(&self, operations: usize) -> Result<(), Error> {
        if operations > MAX_TAPE_OPERATIONS {
            return Err(Error::TooLongForSingle { operations, most: MAX_TAPE_OPERATIONS });
        }
        let of = match (&self.how, self.given.tables.first()) {
            (How::Attempts { .. }, _) => "adaptive steps",
            (How::Matrix { .. }, _) => "the matrix form",
            (_, Some(_)) => "sampled inputs",
            _ if self.given.watched.is_some() => "events",
            _ if has_series(&self.how)? => "the series of a solution",
            _ => return Ok(()),
        };
        Err(Error::NotSingle { of })
    }

    /// Traces all that a run needs, anew.
    pub fn trace<T: Real>(&self) -> Result<Tapes<T>, Error> {
        debug_assert!(T::PRECISION == self.precision, "the tapes of a scene have its precision");
        let new = || Tape::new(T::PRECISION);
        let steps = trace_step(new(), &self.given, &self.how)?;
        let fused = |tape: Tape, next: Vec<Id>| if self.fused { fuse(&tape, &next) } else { (tape, next) };
        let (mut start, mut finish) = (None, None);
        if let How::Method { name, choice } = &self.how {
            let method = method(name)?;
            for (slot, program) in [(&mut start, method.start(*choice)), (&mut finish, method.finish(*choice))] {
                if let Some(program) = program {
                    let (tape, next) = trace_slot(new(), &self.given, &program)?;
                    *slot = Some(fused(tape, next));
                }
            }
        }
        let begin = match &self.how {
            How::Attempts { .. } => Some(cut(&self.given, &trace_begin(new(), &self.given, &self.how)?)),
            _ => None,
        };
        let mut quantities = None;
        if !self.record.is_empty() {
            quantities = Some(cut(&self.given, &trace_record(new(), &self.given, &self.record)?));
        }
        let written = steps.tape.written(steps.next.iter().copied());
        let series_evaluations = steps.tape.series_evaluations();
        let (mut next, mut by_terms) = (steps.next, None);
        if !steps.terms.is_empty() && !self.fused {
            by_terms = Some(cut(&self.given, &trace_by_terms(new(), &self.given, &self.how, steps.shape, steps.terms.len())?));
            next.extend(steps.terms);
        }
        let step = fused(steps.tape, next);
        let shown = finish.as_ref().map(|(tape, velocities): &(Tape, Vec<Id>)| {
            let (mut both, mut next) = step.clone();
            let place = both.take_over(tape);
            next.extend(velocities[..steps.shape.v].iter().map(|id| place[*id as usize]));
            (both, next)
        });
        let [start, finish, shown] = [start, finish, shown].map(|made| made.map(|made| cut(&self.given, &made)));
        let step = cut(&self.given, &step);
        Ok(Tapes { step, by_terms, begin, start, finish, shown, record: quantities, written, series_evaluations })
    }
}

/// The most operations of all tapes in a cache: about 50 bytes each on the tape, and at most as much again, for each interleaved vector,
/// as machine code. When a new entry would exceed it, the cache is emptied first.
const MAX_CACHED_OPERATIONS: usize = 200_000;

/// The cache of rates, by the system and its recorded quantities; all methods share it.
fn rated() -> &'static Mutex<RatedCache> {
    static CACHE: OnceLock<Generation<RatedKey, Rated>> = OnceLock::new();
    CACHE.get_or_init(Generation::default).now()
}

/// The system, and its recorded quantities.
type RatedKey = (Arc<Given>, Vec<String>);
type RatedCache = Cache<RatedKey, Rated>;

/// How often this process, or one that it descends from, began with new caches.
static GENERATION: AtomicUsize = AtomicUsize::new(0);

/// Begins with new caches. For a forked child of a process in which other threads were at work: what they had locked, or were compiling just
/// then, is never released, and the child would wait for it for ever.
pub fn forget() {
    GENERATION.fetch_add(1, Relaxed);
}

/// A cache, and those of later generations. The former ones stay as they are: what they hold may be locked.
struct Generation<K, V> {
    cache: Mutex<Cache<K, V>>,
    next: OnceLock<Box<Generation<K, V>>>,
}

impl<K, V> Default for Generation<K, V> {
    fn default() -> Self {
        Generation { cache: Mutex::default(), next: OnceLock::new() }
    }
}

impl<K, V> Generation<K, V> {
    /// The cache of now.
    fn now(&self) -> &Mutex<Cache<K, V>> {
        let of = (0..GENERATION.load(Relaxed)).fold(self, |of, _| of.next.get_or_init(Box::default));
        &of.cache
    }
}

struct Cache<K, V> {
    known: HashMap<K, Arc<V>>,
    operations: usize,
}

impl<K, V> Default for Cache<K, V> {
    fn default() -> Self {
        Cache { known: HashMap::new(), operations: 0 }
    }
}

impl<K: Clone + Eq + Hash, V> Cache<K, V> {
    /// The value of a key. If it is missing, `make` makes it and returns it with its number of operations.
    fn find(cache: &Mutex<Self>, key: &K, make: impl FnOnce() -> Result<(V, usize), Error>) -> Result<Arc<V>, Error> {
        // A thread that panicked while it held the lock has left the map intact: entries are made outside the lock.
        let lock = || cache.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = lock().known.get(key) {
            return Ok(Arc::clone(known));
        }
        let (made, size) = make()?;
        let made = Arc::new(made);
        let mut cache = lock();
        if cache.operations + size > MAX_CACHED_OPERATIONS {
            *cache = Cache::default();
        }
        cache.operations += size;
        cache.known.insert(key.clone(), Arc::clone(&made));
        Ok(made)
    }
}

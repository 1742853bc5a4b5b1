//! Groups: members stepped together, by a tape or, large ones, by their kernels.

use std::sync::Arc;

use super::{
    aligned::Aligned,
    stage::{Clock, Force, Kit, Numbers, PreparedStage, Stage},
    workers::Stop,
};
use crate::{
    error::Error,
    isa::Level,
    real::Real,
    spec::Spec,
    system::Shape,
    trace::{Tapes, Traceable, Traced},
};

/// Members stepped together.
///
/// `v` and `y` are rows of [`Group::lanes`] numbers, one row per number of a member's block. The `v` slot holds what the
/// method carries between steps: the velocity, unless its record names another carry.
pub trait Group<T: Real = f64>: Send + Sync {
    /// How many members it steps together.
    fn lanes(&self) -> usize;

    /// Takes the parameters of the members from `first`; lanes past the `count`-th repeat the last member.
    fn prepare(&mut self, spec: &Spec, first: usize, count: usize);

    /// Takes the force from outside for the members from `first`, for the steps to come.
    fn set_force(&mut self, _force: &Force<T>, _first: usize, _count: usize) {}

    /// Compiles now instead of after some interpreted steps: for real-time loops.
    fn compile_now(&mut self) {}

    /// Sets the flag at which a step that may take long stops early.
    fn set_stop_flag(&mut self, _stop: &Stop) {}

    /// Both slots.
    fn slots(&self) -> (&[T], &[T]);

    /// Both slots, to write.
    fn slots_mut(&mut self) -> (&mut [T], &mut [T]);

    /// Turns velocities in the `v` slot into what the method carries, at step `k`.
    fn start(&mut self, k: i64);

    /// `n` steps from step `k`.
    fn advance(&mut self, k: i64, n: i64);

    /// How many steps of these members, which were prepared before, one call of [`Group::advance_on_trail`] makes; 0 if that is not faster
    /// than step by step.
    fn trail(&mut self, _spec: &Spec, _first: usize, _count: usize) -> usize {
        0
    }

    /// Makes that many steps from step `k`, a multiple of their number. Returns the velocities before each step, then the coordinates
    /// before each step.
    fn advance_on_trail(&mut self, _k: i64) -> &[T] {
        &[]
    }

    /// Turns what the method carries into velocities, at step `k`: the inverse of `start`.
    fn finish(&mut self, k: i64);

    /// How many numbers of a member it records.
    fn recorded(&self) -> usize;

    /// Records the present state, whose v slot is finished: rows of lanes.
    fn record(&mut self, rows: &mut [T]);

    /// The sums over the steps, such as the work of a control, and what is watched: rows of lanes, or nothing.
    fn tally(&self) -> &[T];

    /// The same sums, to write.
    fn tally_mut(&mut self) -> &mut [T];
}

/// A stage outside the steps (start, finish or record), over a state of its own.
struct SideStage<T: Real> {
    prepared: PreparedStage<T>,
    /// The state, followed by the results of the stage.
    state: Vec<T>,
}

impl<T: Real> SideStage<T> {
    fn new(stage: &Stage<T>, spec: &Spec, level: Level, lanes: usize, clock: &Clock) -> SideStage<T> {
        let prepared = PreparedStage::with(stage, stage.kit_of(level, lanes), spec, clock, f64::INFINITY);
        SideStage { prepared, state: vec![T::default(); stage.split.body.next.len() * lanes] }
    }

    /// Runs the stage once over a state, and returns that with the results.
    fn run(&mut self, stage: &Stage<T>, clock: &Clock, k: i64, from: &[T]) -> &[T] {
        let shared = from.len().min(self.state.len());
        self.state[..shared].copy_from_slice(&from[..shared]);
        self.prepared.advance(stage, clock, k, 1, &mut self.state);
        &self.state
    }
}

/// Members of a system whose whole step is one tape.
pub struct Lanes<T: Real = f64> {
    tapes: Arc<Tapes<T>>,
    shape: Shape,
    recorded: usize,
    level: Level,
    clock: Clock,
    step: PreparedStage<T>,
    /// A step that also returns the velocities, for a run that saves all of them.
    shown: Option<PreparedStage<T>>,
    start: Option<SideStage<T>>,
    finish: Option<SideStage<T>>,
    record: Option<SideStage<T>>,
    state: Aligned<T>,
}

impl<T: Traceable> Lanes<T> {
    /// For a run of so many members.
    pub fn new(traced: &Traced, spec: &Spec, level: Level, members: usize, clock: &Clock) -> Result<Lanes<T>, Error> {
        let tapes = traced.tapes_of::<T>()?;
        Lanes::with(traced, tapes.step.kit(level, members), spec, level, clock)
    }

    fn with(traced: &Traced, kit: Arc<Kit<T>>, spec: &Spec, level: Level, clock: &Clock) -> Result<Lanes<T>, Error> {
        let tapes = traced.tapes_of::<T>()?;
        let step = PreparedStage::with(&tapes.step, kit, spec, clock, f64::INFINITY);
        let lanes = step.lanes();
        let numbers = traced.shape.v + traced.shape.y + traced.tally;
        let side = |stage: &Option<Stage<T>>| stage.as_ref().map(|stage| SideStage::new(stage, spec, level, lanes, clock));
        Ok(Lanes {
            state: Aligned::new(numbers * lanes),
            level,
            clock: *clock,
            start: side(&tapes.start),
            finish: side(&tapes.finish),
            record: side(&tapes.record),
            shown: None,
            step,
            tapes,
            shape: traced.shape,
            recorded: traced.recorded,
        })
    }

    /// The stages outside the steps.
    fn side_stages(&mut self) -> impl Iterator<Item = (&mut SideStage<T>, &Stage<T>)> {
        let Lanes { tapes, start, finish, record, .. } = self;
        let all = [(start, &tapes.start), (finish, &tapes.finish), (record, &tapes.record)];
        all.into_iter().filter_map(|(side, stage)| Some((side.as_mut()?, stage.as_ref()?)))
    }

    /// Numbers of both slots.
    fn sizes(&self) -> (usize, usize) {
        let lanes = self.step.lanes();
        (self.shape.v * lanes, self.shape.y * lanes)
    }
}

impl<T: Traceable> Group<T> for Lanes<T> {
    fn lanes(&self) -> usize {
        self.step.lanes()
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        self.step.prepare(&self.tapes.step, spec, first, count);
        for (side, stage) in self.side_stages() {
            side.prepared.prepare(stage, spec, first, count);
        }
        self.tally_mut().fill(T::default());
    }

    fn set_force(&mut self, force: &Force<T>, first: usize, count: usize) {
        self.step.set_force(&self.tapes.step, force, first, count);
        for (side, stage) in self.side_stages() {
            side.prepared.set_force(stage, force, first, count);
        }
    }

    fn compile_now(&mut self) {
        self.step.compile_now();
        self.side_stages().for_each(|(side, _)| side.prepared.compile_now());
    }

    fn slots(&self) -> (&[T], &[T]) {
        let (v, y) = self.sizes();
        self.state[..v + y].split_at(v)
    }

    fn slots_mut(&mut self) -> (&mut [T], &mut [T]) {
        let (v, y) = self.sizes();
        self.state[..v + y].split_at_mut(v)
    }

    fn start(&mut self, k: i64) {
        let v = self.sizes().0;
        if let (Some(side), Some(stage)) = (&mut self.start, &self.tapes.start) {
            let made = side.run(stage, &self.clock, k, &self.state);
            self.state[..v].copy_from_slice(&made[..v]);
        }
    }

    fn advance(&mut self, k: i64, n: i64) {
        self.step.advance(&self.tapes.step, &self.clock, k, n as usize, &mut self.state);
    }

    fn trail(&mut self, spec: &Spec, first: usize, count: usize) -> usize {
        let numbers = Numbers { state: self.state.len() / self.lanes(), v: self.shape.v, y: self.shape.y };
        let (level, lanes, clock) = (self.level, self.lanes(), &self.clock);
        let Some(stage) = &self.tapes.shown else { return self.step.trail(&self.tapes.step, level, numbers) };
        let make = || PreparedStage::with(stage, stage.kit_of(level, lanes), spec, clock, f64::INFINITY);
        let shown = self.shown.get_or_insert_with(make);
        let steps = shown.trail(stage, level, numbers);
        if steps > 0 {
            shown.prepare(stage, spec, first, count);
        }
        steps
    }

    fn advance_on_trail(&mut self, k: i64) -> &[T] {
        match (&mut self.shown, &self.tapes.shown) {
            (Some(shown), Some(stage)) => shown.advance_on_trail(stage, &self.clock, k, &mut self.state),
            _ => self.step.advance_on_trail(&self.tapes.step, &self.clock, k, &mut self.state),
        }
    }

    fn finish(&mut self, k: i64) {
        let v = self.sizes().0;
        if let (Some(side), Some(stage)) = (&mut self.finish, &self.tapes.finish) {
            let made = side.run(stage, &self.clock, k, &self.state);
            self.state[..v].copy_from_slice(&made[..v]);
        }
    }

    fn recorded(&self) -> usize {
        self.recorded
    }

    fn record(&mut self, rows: &mut [T]) {
        let (v, y) = self.sizes();
        if let (Some(side), Some(stage)) = (&mut self.record, &self.tapes.record) {
            let made = side.run(stage, &self.clock, 0, &self.state[..v + y]);
            rows.copy_from_slice(&made[v + y..]);
        }
    }

    fn tally(&self) -> &[T] {
        let (v, y) = self.sizes();
        &self.state[v + y..]
    }

    fn tally_mut(&mut self) -> &mut [T] {
        let (v, y) = self.sizes();
        &mut self.state[v + y..]
    }
}

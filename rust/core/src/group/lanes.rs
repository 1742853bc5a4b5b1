//! Members with steps of one length, in lanes side by side.

use std::sync::Arc;

use super::Group;
use crate::{
    aligned::Aligned,
    error::Error,
    isa::Level,
    model::{spec::Spec, system::Shape},
    stage::{Clock, CompiledStage, Force, Numbers, PreparedStage, Stage},
    step::tapes::{Tapes, Traceable, Traced},
    tape::real::Real,
};

/// A stage outside the steps (start, finish or record), over a state of its own.
struct SideStage<T: Real> {
    prepared: PreparedStage<T>,
    /// The state, followed by the results of the stage.
    state: Vec<T>,
}

impl<T: Real> SideStage<T> {
    fn new(stage: &Stage<T>, spec: &Spec, level: Level, lanes: usize, clock: &Clock) -> SideStage<T> {
        let prepared = PreparedStage::with(stage, stage.compiled_for_lanes(level, lanes), spec, clock, f64::INFINITY);
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
    /// Numbers of a member that the method keeps behind both slots.
    kept: usize,
    /// How many of these a sampled controller remembers.
    memory: usize,
    recorded: usize,
    level: Level,
    clock: Clock,
    step: PreparedStage<T>,
    /// A step that also returns the velocities, for a run that saves all of them.
    step_with_velocities: Option<PreparedStage<T>>,
    start: Option<SideStage<T>>,
    finish: Option<SideStage<T>>,
    record: Option<SideStage<T>>,
    state: Aligned<T>,
}

impl<T: Traceable> Lanes<T> {
    /// A group for `members` members.
    pub fn new(traced: &Traced, spec: &Spec, level: Level, members: usize, clock: &Clock) -> Result<Lanes<T>, Error> {
        let tapes = traced.tapes_of::<T>()?;
        Lanes::with(traced, tapes.step.compiled(level, members), spec, level, clock)
    }

    fn with(
        traced: &Traced,
        compiled: Arc<CompiledStage<T>>,
        spec: &Spec,
        level: Level,
        clock: &Clock,
    ) -> Result<Lanes<T>, Error> {
        let tapes = traced.tapes_of::<T>()?;
        let step = PreparedStage::with(&tapes.step, compiled, spec, clock, f64::INFINITY);
        let lanes = step.lanes();
        let numbers = traced.shape.v + traced.shape.y + traced.kept + traced.tally;
        let side = |stage: &Option<Stage<T>>| stage.as_ref().map(|stage| SideStage::new(stage, spec, level, lanes, clock));
        Ok(Lanes {
            state: Aligned::new(numbers * lanes),
            level,
            clock: *clock,
            start: side(&tapes.start),
            finish: side(&tapes.finish),
            record: side(&tapes.record),
            step_with_velocities: None,
            step,
            tapes,
            shape: traced.shape,
            kept: traced.kept,
            memory: traced.memory,
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

    /// Numbers before the tally.
    fn before_tally(&self) -> usize {
        (self.shape.v + self.shape.y + self.kept) * self.step.lanes()
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
        let (v, y) = self.sizes();
        let (slots, tally) = (v + y, self.before_tally());
        if let (Some(side), Some(stage)) = (&mut self.start, &self.tapes.start) {
            let made = side.run(stage, &self.clock, k, &self.state);
            self.state[..v].copy_from_slice(&made[..v]);
            self.state[slots..tally].copy_from_slice(&made[slots..tally]);
        }
    }

    fn advance(&mut self, k: i64, n: i64) {
        self.step.advance(&self.tapes.step, &self.clock, k, n as usize, &mut self.state);
    }

    fn unrolled(&mut self, spec: &Spec, first: usize, count: usize) -> usize {
        let numbers = Numbers { state: self.state.len() / self.lanes(), v: self.shape.v, y: self.shape.y };
        let (level, lanes, clock) = (self.level, self.lanes(), &self.clock);
        let Some(stage) = &self.tapes.step_with_velocities else { return self.step.unrolled(&self.tapes.step, level, numbers) };
        let make = || PreparedStage::with(stage, stage.compiled_for_lanes(level, lanes), spec, clock, f64::INFINITY);
        let step_with_velocities = self.step_with_velocities.get_or_insert_with(make);
        let steps = step_with_velocities.unrolled(stage, level, numbers);
        if steps > 0 {
            step_with_velocities.prepare(stage, spec, first, count);
        }
        steps
    }

    fn advance_unrolled(&mut self, k: i64) -> &[T] {
        match (&mut self.step_with_velocities, &self.tapes.step_with_velocities) {
            (Some(step_with_velocities), Some(stage)) => {
                step_with_velocities.advance_unrolled(stage, &self.clock, k, &mut self.state)
            }
            _ => self.step.advance_unrolled(&self.tapes.step, &self.clock, k, &mut self.state),
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
        let ((v, y), memory, end) = (self.sizes(), self.memory * self.lanes(), self.before_tally());
        if let (Some(side), Some(stage)) = (&mut self.record, &self.tapes.record) {
            side.state[v + y..v + y + memory].copy_from_slice(&self.state[end - memory..end]);
            let made = side.run(stage, &self.clock, 0, &self.state[..v + y]);
            rows.copy_from_slice(&made[v + y + memory..]);
        }
    }

    fn tally(&self) -> &[T] {
        &self.state[self.before_tally()..]
    }

    fn tally_mut(&mut self) -> &mut [T] {
        let before = self.before_tally();
        &mut self.state[before..]
    }

    fn kept(&self) -> Vec<&[T]> {
        let (v, y) = self.sizes();
        if self.kept == 0 { Vec::new() } else { vec![&self.state[v + y..self.before_tally()]] }
    }

    fn kept_mut(&mut self) -> Vec<&mut [T]> {
        let ((v, y), tally) = (self.sizes(), self.before_tally());
        if self.kept == 0 { Vec::new() } else { vec![&mut self.state[v + y..tally]] }
    }
}

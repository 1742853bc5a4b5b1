//! Groups: a handful of members stepped together, whatever they are made of.

use std::sync::Arc;

use super::{
    aligned::Aligned,
    stage::{Clock, Kit, Loaded, Stage},
};
use crate::{
    error::Error,
    isa::Level,
    spec::Spec,
    system::Shape,
    trace::{Tapes, Traced},
};

/// A handful of members stepped together.
///
/// `v` and `y` are rows of [`Group::lanes`] numbers, one row per number of a member's block. The `v` slot holds what the
/// method carries between steps, which is the velocity for all but the methods that say otherwise in their record.
pub trait Group: Send + Sync {
    /// How many members it steps together.
    fn lanes(&self) -> usize;

    /// Takes the parameters of the members from `first`; lanes past the `count`-th repeat the last member.
    fn prepare(&mut self, spec: &Spec, first: usize, count: usize);

    /// Makes now what would be made when it pays: for a loop that cannot wait.
    fn settle(&mut self) {}

    /// Both slots.
    fn slots(&self) -> (&[f64], &[f64]);

    /// Both slots, to write.
    fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]);

    /// Turns velocities in the `v` slot into what the method carries, at step `k`.
    fn start(&mut self, k: i64);

    /// `n` steps from step `k`.
    fn advance(&mut self, k: i64, n: i64);

    /// Turns what the method carries into velocities, at step `k`: the inverse of `start`.
    fn finish(&mut self, k: i64);

    /// How many numbers of a member it records.
    fn recorded(&self) -> usize;

    /// Records the present state, whose v slot is finished: rows of lanes.
    fn record(&mut self, rows: &mut [f64]);

    /// What the system adds up over the steps, a row of lanes or nothing.
    fn tally(&self) -> &[f64];

    /// What the system adds up, to write.
    fn tally_mut(&mut self) -> &mut [f64];
}

/// A stage that is run once in a while, over a state of its own.
struct Aside {
    loaded: Loaded,
    /// The state, with what the stage makes behind it.
    state: Vec<f64>,
}

impl Aside {
    fn new(stage: &Stage, spec: &Spec, level: Level, lanes: usize, clock: &Clock) -> Aside {
        let loaded = Loaded::with(stage, stage.kit_of(level, lanes), spec, clock, f64::INFINITY);
        Aside { loaded, state: vec![0.0; stage.split.body.next.len() * lanes] }
    }

    /// Runs the stage once over a state, and gives what it makes of it.
    fn run(&mut self, stage: &Stage, clock: &Clock, k: i64, from: &[f64]) -> &[f64] {
        let shared = from.len().min(self.state.len());
        self.state[..shared].copy_from_slice(&from[..shared]);
        self.loaded.advance(stage, clock, k, 1, &mut self.state);
        &self.state
    }
}

/// Members of a system whose whole step is one tape.
pub struct Lanes {
    tapes: Arc<Tapes>,
    shape: Shape,
    recorded: usize,
    clock: Clock,
    step: Loaded,
    start: Option<Aside>,
    finish: Option<Aside>,
    record: Option<Aside>,
    state: Aligned,
}

impl Lanes {
    /// For a run of so many members.
    pub fn new(traced: &Traced, spec: &Spec, level: Level, members: usize, clock: &Clock) -> Result<Lanes, Error> {
        let tapes = traced.tapes()?;
        Lanes::with(traced, tapes.step.kit(level, members), spec, level, clock)
    }

    fn with(traced: &Traced, kit: Arc<Kit>, spec: &Spec, level: Level, clock: &Clock) -> Result<Lanes, Error> {
        let tapes = traced.tapes()?;
        let step = Loaded::with(&tapes.step, kit, spec, clock, f64::INFINITY);
        let lanes = step.lanes();
        let numbers = traced.shape.v + traced.shape.y + usize::from(traced.tally);
        let aside = |stage: &Option<Stage>| stage.as_ref().map(|stage| Aside::new(stage, spec, level, lanes, clock));
        Ok(Lanes {
            state: Aligned::new(numbers * lanes),
            clock: *clock,
            start: aside(&tapes.start),
            finish: aside(&tapes.finish),
            record: aside(&tapes.record),
            step,
            tapes,
            shape: traced.shape,
            recorded: traced.recorded,
        })
    }

    /// The stages that are run once in a while.
    fn asides(&mut self) -> impl Iterator<Item = (&mut Aside, &Stage)> {
        let Lanes { tapes, start, finish, record, .. } = self;
        let all = [(start, &tapes.start), (finish, &tapes.finish), (record, &tapes.record)];
        all.into_iter().filter_map(|(aside, stage)| Some((aside.as_mut()?, stage.as_ref()?)))
    }

    /// Numbers of both slots.
    fn sizes(&self) -> (usize, usize) {
        let lanes = self.step.lanes();
        (self.shape.v * lanes, self.shape.y * lanes)
    }
}

impl Group for Lanes {
    fn lanes(&self) -> usize {
        self.step.lanes()
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        self.step.prepare(&self.tapes.step, spec, first, count);
        for (aside, stage) in self.asides() {
            aside.loaded.prepare(stage, spec, first, count);
        }
        self.tally_mut().fill(0.0);
    }

    fn settle(&mut self) {
        self.step.settle();
        self.asides().for_each(|(aside, _)| aside.loaded.settle());
    }

    fn slots(&self) -> (&[f64], &[f64]) {
        let (v, y) = self.sizes();
        self.state[..v + y].split_at(v)
    }

    fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        let (v, y) = self.sizes();
        self.state[..v + y].split_at_mut(v)
    }

    fn start(&mut self, k: i64) {
        let v = self.sizes().0;
        if let (Some(aside), Some(stage)) = (&mut self.start, &self.tapes.start) {
            let made = aside.run(stage, &self.clock, k, &self.state);
            self.state[..v].copy_from_slice(&made[..v]);
        }
    }

    fn advance(&mut self, k: i64, n: i64) {
        self.step.advance(&self.tapes.step, &self.clock, k, n as usize, &mut self.state);
    }

    fn finish(&mut self, k: i64) {
        let v = self.sizes().0;
        if let (Some(aside), Some(stage)) = (&mut self.finish, &self.tapes.finish) {
            let made = aside.run(stage, &self.clock, k, &self.state);
            self.state[..v].copy_from_slice(&made[..v]);
        }
    }

    fn recorded(&self) -> usize {
        self.recorded
    }

    fn record(&mut self, rows: &mut [f64]) {
        let (v, y) = self.sizes();
        if let (Some(aside), Some(stage)) = (&mut self.record, &self.tapes.record) {
            let made = aside.run(stage, &self.clock, 0, &self.state[..v + y]);
            rows.copy_from_slice(&made[v + y..]);
        }
    }

    fn tally(&self) -> &[f64] {
        let (v, y) = self.sizes();
        &self.state[v + y..]
    }

    fn tally_mut(&mut self) -> &mut [f64] {
        let (v, y) = self.sizes();
        &mut self.state[v + y..]
    }
}

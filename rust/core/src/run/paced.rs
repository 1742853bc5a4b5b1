//! Members that go at a pace of their own each.

use std::sync::Arc;

use super::{
    aligned::Aligned,
    stage::{Clock, Loaded},
};
use crate::{isa::Level, kernel::runner::Width, pace::Pace, spec::Spec, trace::Traced};

/// A handful of members, each with a time and a step of its own, scaled to a step of 1.
pub trait Paced: Send {
    /// How many members there are.
    fn lanes(&self) -> usize;

    /// Takes the parameters of a member into one lane.
    fn prepare_lane(&mut self, spec: &Spec, lane: usize, member: usize);

    /// Puts a state, v and y, into a lane.
    fn sit(&mut self, lane: usize, state: &[f64]);

    /// The state of a lane.
    fn state(&self, lane: usize) -> Vec<f64>;

    /// Where a lane stands.
    fn pace(&self, lane: usize) -> Pace<f64>;

    /// Says where a lane stands.
    fn set_pace(&mut self, lane: usize, pace: Pace<f64>);

    /// So many attempts of every lane that runs.
    fn attempt(&mut self, attempts: usize);
}

/// Members of a system whose whole attempt is one tape.
pub struct PacedLanes {
    traced: Arc<Traced>,
    step: Loaded,
    /// Rows of v, of y and of the paces.
    state: Aligned,
}

/// Every lane has its own time, so no step has one.
const NO_CLOCK: Clock = Clock { t0: 0.0, h: 1.0 };

impl PacedLanes {
    /// For tiles of so many lanes as the width says.
    pub fn new(traced: Arc<Traced>, spec: &Spec, level: Level, width: Width, budget: f64) -> PacedLanes {
        let step = Loaded::new(&traced.step, spec, level, width, &NO_CLOCK, budget);
        let numbers = traced.shape.v + traced.shape.y + Pace::<f64>::NUMBERS;
        PacedLanes { state: Aligned::new(numbers * step.lanes()), step, traced }
    }

    fn numbers(&self) -> usize {
        self.traced.shape.v + self.traced.shape.y
    }
}

impl Paced for PacedLanes {
    fn lanes(&self) -> usize {
        self.step.lanes()
    }

    fn prepare_lane(&mut self, spec: &Spec, lane: usize, member: usize) {
        self.step.prepare_lane(&self.traced.step, spec, lane, member);
    }

    fn sit(&mut self, lane: usize, state: &[f64]) {
        let lanes = self.step.lanes();
        for (row, number) in self.state.chunks_exact_mut(lanes).zip(state) {
            row[lane] = *number;
        }
    }

    fn state(&self, lane: usize) -> Vec<f64> {
        let lanes = self.step.lanes();
        self.state.chunks_exact(lanes).take(self.numbers()).map(|row| row[lane]).collect()
    }

    fn pace(&self, lane: usize) -> Pace<f64> {
        let (lanes, before) = (self.step.lanes(), self.numbers());
        Pace::of(std::array::from_fn(|i| self.state[(before + i) * lanes + lane]))
    }

    fn set_pace(&mut self, lane: usize, pace: Pace<f64>) {
        let (lanes, before) = (self.step.lanes(), self.numbers());
        for (i, number) in pace.numbers().into_iter().enumerate() {
            self.state[(before + i) * lanes + lane] = number;
        }
    }

    fn attempt(&mut self, attempts: usize) {
        self.step.advance(&self.traced.step, &NO_CLOCK, 0, attempts, &mut self.state);
    }
}

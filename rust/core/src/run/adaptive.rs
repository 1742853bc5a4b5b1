//! Members with adaptive steps, each with a time and a step of its own.

use std::sync::Arc;

use super::{
    aligned::Aligned,
    stage::{Clock, PreparedStage},
    workers::Stop,
};
use crate::{
    error::Error,
    isa::Level,
    pace::Pace,
    spec::Spec,
    trace::{Tapes, Traced},
};

/// A batch of members with adaptive steps; their rates are scaled to a step of 1.
pub trait AdaptiveBatch: Send {
    /// How many members there are.
    fn lanes(&self) -> usize;

    /// Takes the parameters of a member into one lane.
    fn prepare_lane(&mut self, spec: &Spec, lane: usize, member: usize);

    /// Puts a state, v and y, into a lane.
    fn set_state(&mut self, lane: usize, state: &[f64]);

    /// The state of a lane.
    fn state(&self, lane: usize) -> Vec<f64>;

    /// The step-size control of a lane.
    fn pace(&self, lane: usize) -> Pace<f64>;

    /// Sets the step-size control of a lane.
    fn set_pace(&mut self, lane: usize, pace: Pace<f64>);

    /// So many attempts of every lane that runs.
    fn attempt(&mut self, attempts: usize);

    /// Whether the coefficients of a series are known after an attempt, so that [`AdaptiveBatch::attempt_by_terms`] needs no others.
    fn has_terms(&self) -> bool {
        false
    }

    /// Writes whether each lane has a step of the run to try.
    fn find_running(&self, budget: f64, runs: &mut [bool]) {
        runs.iter_mut().enumerate().for_each(|(lane, runs)| *runs = self.pace(lane).runs(budget));
    }

    /// One attempt of one lane, at the start of a step whose coefficients are known.
    fn attempt_by_terms(&mut self, _spec: &Spec, _lane: usize, _member: usize) {}

    /// Sets the flag at which an attempt that may take long stops early.
    fn set_stop_flag(&mut self, _stop: &Stop) {}
}

/// Members of a system whose whole attempt is one tape.
pub struct AdaptiveLanes {
    tapes: Arc<Tapes>,
    /// Numbers of v and y.
    numbers: usize,
    step: PreparedStage,
    /// Rows of v, of y, of the paces and, of a series, of its coefficients.
    state: Aligned,
    by_terms: Option<ByTerms>,
}

/// What makes an attempt of one lane by coefficients that are known.
struct ByTerms {
    step: PreparedStage,
    /// The member whose parameters it has.
    member: Option<usize>,
    /// The numbers of the lane.
    numbers: Aligned,
}

/// Every lane has its own time, so no step has one.
pub(crate) const NO_CLOCK: Clock = Clock { t0: 0.0, h: 1.0 };

impl AdaptiveLanes {
    /// For a run of so many members.
    pub fn new(traced: &Traced, spec: &Spec, level: Level, members: usize, budget: f64) -> Result<AdaptiveLanes, Error> {
        let tapes = traced.tapes()?;
        let step = PreparedStage::new(&tapes.step, spec, level, members, &NO_CLOCK, budget);
        let numbers = traced.shape.v + traced.shape.y;
        let all = tapes.step.split.body.next.len();
        let by_terms = tapes.by_terms.as_ref().map(|stage| ByTerms {
            step: PreparedStage::new(stage, spec, level, 1, &NO_CLOCK, budget),
            member: None,
            numbers: Aligned::new(all),
        });
        let state = Aligned::new(all * step.lanes());
        Ok(AdaptiveLanes { state, step, numbers, by_terms, tapes })
    }
}

impl AdaptiveBatch for AdaptiveLanes {
    fn lanes(&self) -> usize {
        self.step.lanes()
    }

    fn prepare_lane(&mut self, spec: &Spec, lane: usize, member: usize) {
        self.step.prepare_lane(&self.tapes.step, spec, lane, member);
    }

    fn set_state(&mut self, lane: usize, state: &[f64]) {
        let lanes = self.step.lanes();
        for (row, number) in self.state.chunks_exact_mut(lanes).zip(state) {
            row[lane] = *number;
        }
    }

    fn state(&self, lane: usize) -> Vec<f64> {
        let lanes = self.step.lanes();
        self.state.chunks_exact(lanes).take(self.numbers).map(|row| row[lane]).collect()
    }

    fn pace(&self, lane: usize) -> Pace<f64> {
        let (lanes, before) = (self.step.lanes(), self.numbers);
        Pace::of(std::array::from_fn(|i| self.state[(before + i) * lanes + lane]))
    }

    fn set_pace(&mut self, lane: usize, pace: Pace<f64>) {
        let (lanes, before) = (self.step.lanes(), self.numbers);
        for (i, number) in pace.numbers().into_iter().enumerate() {
            self.state[(before + i) * lanes + lane] = number;
        }
    }

    fn attempt(&mut self, attempts: usize) {
        self.step.advance(&self.tapes.step, &NO_CLOCK, 0, attempts, &mut self.state);
    }

    fn has_terms(&self) -> bool {
        self.by_terms.is_some()
    }

    fn find_running(&self, budget: f64, runs: &mut [bool]) {
        let lanes = self.step.lanes();
        Pace::find_running(|i| &self.state[(self.numbers + i) * lanes..][..lanes], budget, runs);
    }

    fn attempt_by_terms(&mut self, spec: &Spec, lane: usize, member: usize) {
        let (Some(stage), Some(by_terms)) = (&self.tapes.by_terms, &mut self.by_terms) else { return };
        let ByTerms { step, member: known, numbers } = by_terms;
        if *known != Some(member) {
            step.prepare_lane(stage, spec, 0, member);
            *known = Some(member);
        }
        let lanes = self.step.lanes();
        for (number, row) in numbers.iter_mut().zip(self.state.chunks_exact(lanes)) {
            *number = row[lane];
        }
        step.advance(stage, &NO_CLOCK, 0, 1, numbers);
        for (row, number) in self.state.chunks_exact_mut(lanes).zip(numbers.iter()).take(self.numbers + Pace::<f64>::NUMBERS) {
            row[lane] = *number;
        }
    }
}

//! Members with adaptive steps of float32: stages and states are float32; the time, the sizes of errors and the decision are
//! float64.
//!
//! In float32 the sum of a time and a step keeps too little of the step, and squares of sizes leave its range. What is float64 is
//! some dozens of operations an attempt, however large the system.

use std::sync::Arc;

use super::AdaptiveBatch;
use crate::{
    aligned::Aligned,
    error::Error,
    isa::Level,
    model::spec::{Spec, holds_at},
    stage::{Clock, PreparedStage},
    step::{
        attempts::TriedRows,
        key::StepKind,
        pace::Pace,
        tapes::{Tapes, Traced},
    },
};

/// Members of a system whose attempt is one tape, before the decision.
pub struct SingleLanes {
    tapes: Arc<Tapes<f32>>,
    rows: TriedRows,
    /// The first part of an attempt, and the second, over their rows.
    tried: PreparedStage<f32>,
    tried_rows: Aligned<f32>,
    judged: PreparedStage,
    judged_rows: Aligned,
    inputs: Vec<Input>,
    /// The sign of times of the run, which are negated where it goes back.
    sign: f64,
}

/// A sampled input: samples of each lane, or those that all have in common.
struct Input {
    start: f64,
    interval: f64,
    samples: Vec<f32>,
    /// How many lanes have samples of their own; 1 if all have the same.
    lanes: usize,
}

impl Input {
    /// The sample of a lane that holds at a time.
    fn at(&self, t: f64, lane: usize) -> f32 {
        let number = holds_at(t, self.start, self.interval, self.samples.len() / self.lanes);
        self.samples[number * self.lanes + if self.lanes > 1 { lane } else { 0 }]
    }
}

impl SingleLanes {
    /// A batch for `members` members.
    pub(crate) fn new(traced: &Traced, spec: &Spec, level: Level, members: usize, budget: f64) -> Result<SingleLanes, Error> {
        let tapes = traced.tapes_of::<f32>()?;
        let StepKind::Attempts { backward, .. } = &traced.key().how else { return Err(Error::NoEstimate) };
        let Some((stage, rows)) = &tapes.judged else { return Err(Error::NoEstimate) };
        let rows = *rows;
        let tried = PreparedStage::new(&tapes.step, spec, level, members, &Clock::NONE, budget);
        let lanes = tried.lanes();
        let judged = PreparedStage::with(stage, stage.compiled_for_lanes(level, lanes), spec, &Clock::NONE, budget);
        let input = |table: &crate::model::spec::Table| {
            let lanes = if table.samples.iter().all(|row| row.is_common()) { 1 } else { lanes };
            let samples = table.samples.iter().flat_map(|row| std::iter::repeat_n(row.at(0) as f32, lanes)).collect();
            Input { start: table.start, interval: table.interval, samples, lanes }
        };
        Ok(SingleLanes {
            inputs: spec.tables.iter().map(input).collect(),
            tried_rows: Aligned::new((rows.first_result() + rows.results) * lanes),
            judged_rows: Aligned::new((rows.judged + rows.results) * lanes),
            sign: if *backward { -1.0 } else { 1.0 },
            tried,
            judged,
            rows,
            tapes,
        })
    }

    /// The rows of one number of the pace and of those behind it.
    fn of_pace(&self, i: usize) -> &[f64] {
        let lanes = self.tried.lanes();
        &self.judged_rows[(self.rows.state + i) * lanes..][..lanes]
    }

    /// Tells the first part of an attempt where members stand.
    fn tell(&mut self) {
        let (lanes, state) = (self.tried.lanes(), self.rows.state);
        let places = Pace::of(std::array::from_fn(|i| i as f64));
        let (pace, tried) = (&self.judged_rows[state * lanes..], &mut self.tried_rows);
        for (to, from) in tried.iter_mut().zip(&self.judged_rows[..state * lanes]) {
            *to = *from as f32;
        }
        let row = |place: f64| &pace[place as usize * lanes..][..lanes];
        let (t, h, wall, extra) = (row(places.t), row(places.h), row(places.wall), row(places.extra));
        let (times, behind) = tried[state * lanes..].split_at_mut(lanes);
        let (steps, values) = behind.split_at_mut(lanes);
        for lane in 0..lanes {
            let (t, h, wall, extra) = (t[lane], h[lane], wall[lane], extra[lane]);
            // As `Pace::outlook` has it.
            let ends = wall < t + h;
            let step = if 0.0 < extra {
                extra
            } else if ends {
                wall - t
            } else {
                h
            };
            (times[lane], steps[lane]) = (t as f32, step as f32);
            // No step crosses the time of a sample, so that one holds all over it: that of its middle.
            let middle = self.sign * (t + 0.5 * step);
            for (input, values) in self.inputs.iter().zip(values.chunks_exact_mut(lanes)) {
                values[lane] = input.at(middle, lane);
            }
        }
    }
}

impl AdaptiveBatch for SingleLanes {
    fn lanes(&self) -> usize {
        self.tried.lanes()
    }

    fn prepare_lane(&mut self, spec: &Spec, lane: usize, member: usize) {
        self.tried.prepare_lane(&self.tapes.step, spec, lane, member);
        for (input, table) in self.inputs.iter_mut().zip(&spec.tables).filter(|(input, _)| input.lanes > 1) {
            for (samples, row) in input.samples.chunks_exact_mut(input.lanes).zip(&table.samples) {
                samples[lane] = row.at(member) as f32;
            }
        }
    }

    fn set_state(&mut self, lane: usize, state: &[f64]) {
        let lanes = self.tried.lanes();
        for (row, number) in self.judged_rows.chunks_exact_mut(lanes).zip(state) {
            row[lane] = *number;
        }
    }

    fn state(&self, lane: usize) -> Vec<f64> {
        self.judged_rows.chunks_exact(self.tried.lanes()).take(self.rows.state).map(|row| row[lane]).collect()
    }

    fn pace(&self, lane: usize) -> Pace<f64> {
        Pace::of(std::array::from_fn(|i| self.of_pace(i)[lane]))
    }

    fn row(&self, number: usize) -> Option<&[f64]> {
        self.judged_rows.chunks_exact(self.tried.lanes()).nth(number)
    }

    fn set_pace(&mut self, lane: usize, pace: Pace<f64>) {
        let (lanes, before) = (self.tried.lanes(), self.rows.state);
        for (i, number) in pace.numbers().into_iter().enumerate() {
            self.judged_rows[(before + i) * lanes + lane] = number;
        }
    }

    fn scales(&self, lane: usize) -> Vec<f64> {
        (Pace::<f64>::NUMBERS..self.rows.judged - self.rows.state).map(|i| self.of_pace(i)[lane]).collect()
    }

    fn set_scales(&mut self, lane: usize, numbers: &[f64]) {
        let (lanes, before) = (self.tried.lanes(), self.rows.state + Pace::<f64>::NUMBERS);
        for (i, number) in numbers.iter().enumerate() {
            self.judged_rows[(before + i) * lanes + lane] = *number;
        }
    }

    fn attempt(&mut self, attempts: usize) {
        let lanes = self.tried.lanes();
        let (first, behind) = (self.rows.first_result() * lanes, self.rows.judged * lanes);
        for _ in 0..attempts {
            self.tell();
            self.tried.advance(&self.tapes.step, &Clock::NONE, 0, 1, &mut self.tried_rows);
            for (to, from) in self.judged_rows[behind..].iter_mut().zip(&self.tried_rows[first..]) {
                *to = (*from).into();
            }
            if let Some((stage, _)) = &self.tapes.judged {
                self.judged.advance(stage, &Clock::NONE, 0, 1, &mut self.judged_rows);
            }
        }
    }

    fn find_running(&self, budget: f64, runs: &mut [bool]) {
        Pace::find_running(|i| self.of_pace(i), budget, runs);
    }

    fn steps_left(&self) -> f64 {
        Pace::steps_left(|i| self.of_pace(i))
    }
}

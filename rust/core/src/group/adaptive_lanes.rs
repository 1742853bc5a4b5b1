//! Members with adaptive steps, each in a lane with a time and a step of its own.

use std::sync::Arc;

use super::AdaptiveBatch;
use crate::{
    aligned::Aligned,
    error::Error,
    isa::{Level, Task, with_isa},
    model::spec::Spec,
    stage::{Clock, PreparedStage, Stage},
    step::{
        key::StepKind,
        pace::Pace,
        series_pace::{SIDE, share_of, sums},
        tapes::{Tapes, Traced},
    },
};

/// Members of a system whose whole attempt is one tape.
pub struct AdaptiveLanes {
    tapes: Arc<Tapes>,
    /// Numbers of v and y, and those that stand behind the pace.
    numbers: usize,
    scales: usize,
    /// How many coefficients of a series each number has.
    order: usize,
    /// Whether the last of these are what rounding left out of each number of the state.
    compensated: bool,
    step: PreparedStage,
    /// Rows of v, of y, of the paces, of the sizes and, of a series, of its coefficients.
    state: Aligned,
    /// At the start of a step within which states are wanted: rows of the state, of the time, of one over the unit of time of the
    /// coefficients, and of what rounding left out.
    starts: Vec<f64>,
    /// Stages that run one lane at a time, built on first use: for attempts by known coefficients, and for the controller's
    /// initial state.
    by_terms: Option<OneLane>,
    begin: Option<OneLane>,
    extension: Option<Extension>,
    level: Level,
    budget: f64,
}

/// A stage that is run for one lane alone.
struct OneLane {
    step: PreparedStage,
    /// The member whose parameters it has.
    member: Option<usize>,
    /// The numbers of the lane.
    numbers: Aligned,
}

impl OneLane {
    fn new(stage: &Stage, spec: &Spec, level: Level, budget: f64) -> OneLane {
        let numbers = Aligned::new(stage.split.body.next.len());
        OneLane { step: PreparedStage::new(stage, spec, level, 1, &Clock::NONE, budget), member: None, numbers }
    }

    /// Runs the stage with a member's parameters, and the numbers of one lane from rows of `lanes` lanes.
    fn run(&mut self, stage: &Stage, spec: &Spec, member: usize, rows: &[f64], (lane, lanes): (usize, usize)) -> &[f64] {
        if self.member != Some(member) {
            self.step.prepare_lane(stage, spec, 0, member);
            self.member = Some(member);
        }
        for (number, row) in self.numbers.iter_mut().zip(rows.chunks_exact(lanes)) {
            *number = row[lane];
        }
        self.step.advance(stage, &Clock::NONE, 0, 1, &mut self.numbers);
        &self.numbers
    }
}

/// The continuous extension of a step.
struct Extension {
    stage: Arc<Stage>,
    step: PreparedStage,
    /// At the start of a step within which states are wanted: the rows of all that a lane is; and behind them, once they are
    /// asked for, those of the coefficients, of the length of the step, and of whether it changes too much.
    rows: Aligned,
    is_known: bool,
}

impl Extension {
    fn find(&mut self) {
        if !self.is_known {
            self.step.advance(&self.stage, &Clock::NONE, 0, 1, &mut self.rows);
            self.is_known = true;
        }
    }
}

/// States of a lane within a step: see [`AdaptiveBatch::sum_terms`].
struct Sums<'a> {
    lanes: usize,
    lane: usize,
    /// How many coefficients each number has.
    order: usize,
    /// Rows of the state and of the time; and, where rounding is compensated, of what it left out.
    starts: &'a [f64],
    low: Option<&'a [f64]>,
    /// One over the unit of time of the coefficients.
    per_unit: f64,
    terms: &'a [f64],
    times: &'a [f64; SIDE],
    states: &'a mut [[f64; SIDE]],
}

impl Task for Sums<'_> {
    #[inline(always)]
    fn run(self) {
        let (lanes, n) = (self.lanes, self.states.len());
        let starts = &self.starts[self.lane..];
        let start = starts[n * lanes];
        let mut shares = [0.0; SIDE];
        for (share, time) in shares.iter_mut().zip(self.times) {
            *share = (time - start) * self.per_unit;
        }
        for (i, number) in self.states.iter_mut().enumerate() {
            let low = self.low.map_or(0.0, |low| low[i * lanes + self.lane]);
            let terms = &self.terms[i * lanes + self.lane..];
            *number = sums((starts[i * lanes], low), (terms, n * lanes), self.order, &shares);
        }
    }
}

impl AdaptiveLanes {
    /// A batch for `members` members. With an extension, states within a step are those of the extension.
    pub fn new(
        traced: &Traced,
        spec: &Spec,
        level: Level,
        members: usize,
        budget: f64,
        extends: bool,
    ) -> Result<AdaptiveLanes, Error> {
        let tapes = traced.tapes()?;
        let step = PreparedStage::new(&tapes.step, spec, level, members, &Clock::NONE, budget);
        let StepKind::Attempts { acceptance, .. } = &traced.key().how else { return Err(Error::NoEstimate) };
        let (numbers, scales) = (traced.shape.v + traced.shape.y, acceptance.numbers(traced.shape.v, traced.shape.y));
        let all = tapes.step.split.body.next.len();
        let state = Aligned::new(all * step.lanes());
        let compensated = acceptance.compensated;
        let order = (all - numbers - Pace::<f64>::NUMBERS - scales) / numbers.max(1);
        let extension = match extends {
            true => {
                let stage = traced.extension()?;
                let compiled = stage.compiled_for_lanes(level, step.lanes());
                let rows = Aligned::new(stage.split.body.next.len() * step.lanes());
                let step = PreparedStage::with(&stage, compiled, spec, &Clock::NONE, budget);
                Some(Extension { stage, step, rows, is_known: false })
            }
            false => None,
        };
        Ok(AdaptiveLanes {
            extension,
            state,
            starts: Vec::new(),
            step,
            numbers,
            scales,
            order,
            compensated,
            by_terms: None,
            begin: None,
            level,
            budget,
            tapes,
        })
    }
}

impl AdaptiveBatch for AdaptiveLanes {
    fn lanes(&self) -> usize {
        self.step.lanes()
    }

    fn prepare_lane(&mut self, spec: &Spec, lane: usize, member: usize) {
        self.step.prepare_lane(&self.tapes.step, spec, lane, member);
        if let Some(extension) = &mut self.extension {
            extension.step.prepare_lane(&extension.stage, spec, lane, member);
        }
    }

    fn renew(&mut self, spec: &Spec) -> bool {
        self.step.take_common(&self.tapes.step, spec);
        if let Some(extension) = &mut self.extension {
            extension.step.take_common(&extension.stage, spec);
        }
        for (one, stage) in [(&mut self.begin, &self.tapes.begin), (&mut self.by_terms, &self.tapes.by_terms)] {
            if let (Some(one), Some(stage)) = (one, stage) {
                one.step.take_common(stage, spec);
                one.member = None;
            }
        }
        true
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

    fn row(&self, number: usize) -> Option<&[f64]> {
        let lanes = self.step.lanes();
        self.state.get(number * lanes..(number + 1) * lanes)
    }

    fn row_mut(&mut self, number: usize) -> Option<&mut [f64]> {
        let lanes = self.step.lanes();
        self.state.get_mut(number * lanes..(number + 1) * lanes)
    }

    fn set_pace(&mut self, lane: usize, pace: Pace<f64>) {
        let (lanes, before) = (self.step.lanes(), self.numbers);
        for (i, number) in pace.numbers().into_iter().enumerate() {
            self.state[(before + i) * lanes + lane] = number;
        }
    }

    fn scales(&self, lane: usize) -> Vec<f64> {
        let (lanes, before) = (self.step.lanes(), self.numbers + Pace::<f64>::NUMBERS);
        (0..self.scales).map(|i| self.state[(before + i) * lanes + lane]).collect()
    }

    fn set_scales(&mut self, lane: usize, numbers: &[f64]) {
        let (lanes, before) = (self.step.lanes(), self.numbers + Pace::<f64>::NUMBERS);
        for (i, number) in numbers.iter().enumerate() {
            self.state[(before + i) * lanes + lane] = *number;
        }
    }

    fn begins(&self) -> bool {
        self.tapes.begin.is_some()
    }

    fn begin(&mut self, spec: &Spec, lane: usize, member: usize) {
        let Some(stage) = &self.tapes.begin else { return };
        let lanes = self.step.lanes();
        let one = self.begin.get_or_insert_with(|| OneLane::new(stage, spec, self.level, self.budget));
        let begun = one.run(stage, spec, member, &self.state, (lane, lanes));
        for (row, number) in self.state.chunks_exact_mut(lanes).zip(begun) {
            row[lane] = *number;
        }
    }

    fn attempt(&mut self, attempts: usize) {
        self.step.advance(&self.tapes.step, &Clock::NONE, 0, attempts, &mut self.state);
    }

    fn has_terms(&self) -> bool {
        self.tapes.by_terms.is_some()
    }

    fn is_series(&self) -> bool {
        self.tapes.is_series
    }

    fn find_running(&self, budget: f64, runs: &mut [bool]) {
        let lanes = self.step.lanes();
        Pace::find_running(|i| &self.state[(self.numbers + i) * lanes..][..lanes], budget, runs);
    }

    fn steps_left(&self) -> f64 {
        let lanes = self.step.lanes();
        Pace::steps_left(|i| &self.state[(self.numbers + i) * lanes..][..lanes])
    }

    fn has_sums(&self) -> bool {
        self.tapes.sums || self.extension.is_some()
    }

    fn keep_starts(&mut self) {
        let (lanes, n) = (self.step.lanes(), self.numbers);
        if let Some(extension) = &mut self.extension {
            extension.rows[..self.state.len()].copy_from_slice(&self.state);
            extension.is_known = false;
            return;
        }
        let first = (n + Pace::<f64>::NUMBERS + self.scales) * lanes;
        self.starts.clear();
        self.starts.extend_from_slice(&self.state[..(n + 1) * lanes]); // the time stands behind the state
        let before = &self.state[Pace::places(n).before * lanes..][..lanes];
        self.starts.extend(before.iter().map(|before| share_of(1.0, *before)));
        if self.compensated {
            self.starts.extend_from_slice(&self.state[first - n * lanes..first]);
        }
    }

    fn changes_within(&mut self, lane: usize) -> bool {
        let Some(extension) = &mut self.extension else { return false };
        extension.find();
        extension.rows[extension.rows.len() - self.step.lanes() + lane] > 0.0
    }

    fn restore(&mut self, lane: usize) {
        let (Some(extension), lanes) = (&self.extension, self.step.lanes()) else { return };
        for (row, kept) in self.state.chunks_exact_mut(lanes).zip(extension.rows.chunks_exact(lanes)) {
            row[lane] = kept[lane];
        }
    }

    fn sum_terms(&mut self, lane: usize, times: &[f64; SIDE], states: &mut [[f64; SIDE]]) {
        let (lanes, n) = (self.step.lanes(), self.numbers);
        let sums = if let Some(extension) = &mut self.extension {
            extension.find();
            let (starts, behind) = extension.rows.split_at(self.state.len());
            let (terms, step) = behind.split_at(behind.len() - 2 * lanes);
            let (order, per_unit) = (terms.len() / lanes / n.max(1), 1.0 / step[lane]);
            Sums { lanes, lane, order, starts, low: None, per_unit, terms, times, states }
        } else {
            let (terms, starts) = (&self.state[(n + Pace::<f64>::NUMBERS + self.scales) * lanes..], &self.starts);
            let low = self.compensated.then(|| &starts[(n + 2) * lanes..]);
            let per_unit = starts[(n + 1) * lanes + lane];
            Sums { lanes, lane, order: self.order, starts, low, per_unit, terms, times, states }
        };
        with_isa!(self.level.of_loops(), |isa| isa.run(sums));
    }

    fn attempt_alone(&mut self, spec: &Spec, lane: usize, member: usize) {
        let lanes = self.step.lanes();
        let Some(stage) = &self.tapes.by_terms else {
            let before = self.state.to_vec();
            self.attempt(1);
            for (row, before) in self.state.chunks_exact_mut(lanes).zip(before.chunks_exact(lanes)) {
                let made = row[lane];
                row.copy_from_slice(before);
                row[lane] = made;
            }
            return;
        };
        let one = self.by_terms.get_or_insert_with(|| OneLane::new(stage, spec, self.level, self.budget));
        let made = one.run(stage, spec, member, &self.state, (lane, lanes));
        for (row, number) in self.state.chunks_exact_mut(lanes).zip(made).take(self.numbers + Pace::<f64>::NUMBERS + self.scales)
        {
            row[lane] = *number;
        }
    }
}

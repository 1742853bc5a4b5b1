//! A large member with adaptive steps.

use std::sync::Arc;

use super::{
    blocks::{Blocks, Schedules},
    executor::Executor,
    rates::Rates,
    schedule::{V, Y},
};
use crate::{
    aligned::Aligned,
    error::Error,
    group::AdaptiveBatch,
    isa::Level,
    model::{around::controls, methods::method, spec::Spec},
    stage::{Clock, Stop},
    step::{
        key::StepKind,
        pace::{Acceptance, Made, Pace, Scales, changes_within, judge, reach},
        series_pace::{SIDE, sums},
        tapes::Traced,
    },
};

/// One member, whose rates are scaled to a step of 1.
pub struct LargeAdaptive {
    blocks: Blocks,
    executor: Executor,
    /// The order of the estimate.
    order: u32,
    acceptance: Acceptance,
    backward: bool,
    budget: f64,
    /// Whether a control pushes in the stages; its tally is then times the step.
    pushes: bool,
    pace: Pace<f64>,
    scales: Scales<f64>,
    extension: Option<Extension>,
}

/// The continuous extension of a step.
struct Extension {
    executor: Executor,
    /// v and y at the start of a step within which states are wanted, and rows for the coefficients.
    arena: Aligned,
    /// The step-size control there.
    pace: Pace<f64>,
    scales: Scales<f64>,
    /// The coefficients, power by power, once they are asked for.
    terms: Vec<f64>,
}

impl LargeAdaptive {
    /// A large member with rates and a method that estimates its error. `budget` is the most attempts of the member.
    pub fn new(
        schedules: Arc<Schedules>,
        rates: Box<dyn Rates>,
        traced: &Traced,
        level: Level,
        budget: f64,
        extends: bool,
    ) -> Result<LargeAdaptive, Error> {
        let StepKind::Attempts { name, acceptance, backward, .. } = &traced.key().how else { return Err(Error::NoEstimate) };
        let order = method(name)?.error_order.ok_or(Error::NoEstimate)?;
        let blocks = Blocks::new(schedules, rates, traced.shape);
        let executor = blocks.executor(&blocks.schedules.step, level, &Clock::NONE);
        let pushes = controls::pushes(&traced.key().signature);
        let (acceptance, backward) = (acceptance.clone(), *backward);
        let pace = Pace::of([0.0; Pace::<f64>::NUMBERS]);
        let extension = blocks.schedules.extension.as_ref().filter(|_| extends).map(|schedule| Extension {
            executor: blocks.executor(schedule, level, &Clock::NONE),
            arena: Aligned::new(schedule.rows * blocks.stride),
            pace: Pace::of([0.0; Pace::<f64>::NUMBERS]),
            scales: Scales::default(),
            terms: Vec::new(),
        });
        Ok(LargeAdaptive {
            extension,
            blocks,
            executor,
            order,
            acceptance,
            backward,
            budget,
            pushes,
            pace,
            scales: Scales::default(),
        })
    }
}

impl AdaptiveBatch for LargeAdaptive {
    fn lanes(&self) -> usize {
        1
    }

    fn prepare_lane(&mut self, spec: &Spec, _lane: usize, member: usize) {
        self.blocks.rates.prepare(spec, member, 1);
    }

    fn set_state(&mut self, _lane: usize, state: &[f64]) {
        let (v, y) = self.blocks.slots_mut();
        let (from_v, from_y) = state.split_at(v.len());
        v.copy_from_slice(from_v);
        y.copy_from_slice(from_y);
    }

    fn state(&self, _lane: usize) -> Vec<f64> {
        let (v, y) = self.blocks.slots();
        [v, y].concat()
    }

    fn pace(&self, _lane: usize) -> Pace<f64> {
        self.pace
    }

    fn set_pace(&mut self, _lane: usize, pace: Pace<f64>) {
        self.pace = pace;
    }

    fn scales(&self, _lane: usize) -> Vec<f64> {
        self.scales.numbers()
    }

    fn set_scales(&mut self, _lane: usize, numbers: &[f64]) {
        self.scales = Scales::of(numbers, &self.acceptance, 0); // no series has steps like these
    }

    fn set_stop_flag(&mut self, stop: &Stop) {
        self.executor.stop = Stop::clone(stop);
        if let Some(extension) = &mut self.extension {
            extension.executor.stop = Stop::clone(stop);
        }
        self.blocks.rates.set_stop_flag(stop);
    }

    fn has_sums(&self) -> bool {
        self.extension.is_some()
    }

    fn keep_starts(&mut self) {
        let Some(extension) = &mut self.extension else { return };
        (extension.pace, extension.scales) = (self.pace, self.scales.clone());
        extension.arena[..2 * self.blocks.stride].copy_from_slice(&self.blocks.arena[..2 * self.blocks.stride]);
        extension.terms.clear();
    }

    fn changes_within(&mut self, _lane: usize) -> bool {
        let mut ends = vec![[0.0; SIDE]; self.blocks.sizes.iter().sum::<usize>()];
        self.sum_at(&[1.0; SIDE], &mut ends);
        let Some(Extension { arena, pace, scales, .. }) = &self.extension else { return false };
        let ends: Vec<f64> = ends.into_iter().map(|[end, ..]| end).collect();
        let ([of_v, of_y], stride) = (self.blocks.sizes, self.blocks.stride);
        let old = self.acceptance.sizes(&arena[V * stride..][..of_v], &arena[Y * stride..][..of_y]);
        let new = self.acceptance.sizes(&ends[..of_v], &ends[of_v..]);
        changes_within(pace, scales, &old, &new)
    }

    fn restore(&mut self, _lane: usize) {
        let Some(extension) = &self.extension else { return };
        self.blocks.arena[..2 * self.blocks.stride].copy_from_slice(&extension.arena[..2 * self.blocks.stride]);
        (self.pace, self.scales) = (extension.pace, extension.scales.clone());
    }

    fn sum_terms(&mut self, _lane: usize, times: &[f64; SIDE], states: &mut [[f64; SIDE]]) {
        let Some(Extension { pace: Pace { t, h, wall, .. }, .. }) = &self.extension else { return };
        let per_unit = 1.0 / (reach(*t, *h, *wall) - *t);
        self.sum_at(&times.map(|time| (time - *t) * per_unit), states);
    }

    fn attempt(&mut self, attempts: usize) {
        let Blocks { schedules, rates, arena, sizes, stride } = &mut self.blocks;
        for _ in 0..attempts {
            let outlook = self.pace.outlook(self.budget);
            if !outlook.runs && !outlook.is_extra {
                break;
            }
            // Rates that run backward are those of a step of −1.
            let (t, step) = if self.backward { (-self.pace.t, -outlook.step) } else { (self.pace.t, outlook.step) };
            rates.set_step(step);
            rates.tally_mut().fill(0.0);
            self.executor.run(&schedules.step, rates.as_mut(), *sizes, t, step, arena);
            // Results come in pairs: of velocities, of coordinates.
            let block = |i: usize, row: usize| &arena[row * *stride..][..sizes[i % 2]];
            let blocks: Vec<&[f64]> = schedules.step.results.iter().enumerate().map(|(i, row)| block(i, *row)).collect();
            let made = Made::of(&self.acceptance, [block(0, V), block(1, Y)], &blocks);
            let counts = self.acceptance.counts(sizes[0], sizes[1]);
            let (next, scales, took) = judge(&self.pace, &self.scales, self.order, counts, &made, outlook);
            self.pace = next;
            self.scales = scales;
            if took {
                for ((home, made), numbers) in [V, Y].into_iter().zip(&schedules.step.results).zip(*sizes) {
                    arena.copy_within(made * *stride..made * *stride + numbers, home * *stride);
                }
                let (v, y) = arena.split_at_mut(*stride);
                rates.project(&mut v[..sizes[0]], &mut y[..sizes[1]]);
                if let (Some(done), false) = (rates.tally().first(), outlook.is_extra) {
                    self.pace.work += if self.pushes { *done / outlook.step } else { *done };
                }
            }
        }
    }
}

impl LargeAdaptive {
    /// The states at shares of the step that began at the start that was kept.
    fn sum_at(&mut self, shares: &[f64; SIDE], states: &mut [[f64; SIDE]]) {
        let (Blocks { schedules, rates, sizes, stride, .. }, Some(extension)) = (&mut self.blocks, &mut self.extension) else {
            return;
        };
        let Some(schedule) = &schedules.extension else { return };
        let Extension { executor, arena, pace: Pace { t, h, wall, .. }, terms, .. } = extension;
        if terms.is_empty() {
            let step = reach(*t, *h, *wall) - *t;
            let (t, step) = if self.backward { (-*t, -step) } else { (*t, step) };
            rates.set_step(step);
            rates.tally_mut().fill(0.0);
            executor.run(schedule, rates.as_mut(), *sizes, t, step, arena);
            for (i, row) in schedule.results.iter().enumerate() {
                terms.extend_from_slice(&arena[row * *stride..][..sizes[i % 2]]);
            }
        }
        let n = sizes[0] + sizes[1];
        for (i, number) in states.iter_mut().enumerate() {
            let start = if i < sizes[0] { arena[V * *stride + i] } else { arena[Y * *stride + i - sizes[0]] };
            *number = sums((start, 0.0), (&terms[i..], n), terms.len() / n, shares);
        }
    }
}

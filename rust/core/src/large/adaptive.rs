//! A large member with adaptive steps.

use std::sync::Arc;

use super::{
    Rates,
    course::{V, Y},
    executor::Executor,
    group::{Blocks, Courses},
};
use crate::{
    controls,
    error::Error,
    isa::Level,
    pace::{Pace, judge, length2},
    run::{
        adaptive::{AdaptiveBatch, NO_CLOCK},
        workers::Stop,
    },
    spec::Spec,
    trace::{How, Traced, method},
};

/// One member, whose rates are scaled to a step of 1.
pub struct LargeAdaptive {
    blocks: Blocks,
    executor: Executor,
    /// The order of the estimate.
    order: u32,
    budget: f64,
    /// Whether a control pushes in the stages; its tally is then times the step.
    pushes: bool,
    pace: Pace<f64>,
}

impl LargeAdaptive {
    /// Of rates by a method that estimates its error. `budget` is the most attempts of the member.
    pub fn new(
        courses: Arc<Courses>,
        rates: Box<dyn Rates>,
        traced: &Traced,
        level: Level,
        budget: f64,
    ) -> Result<LargeAdaptive, Error> {
        let How::Attempts { name, .. } = &traced.scene().how else { return Err(Error::NoEstimate) };
        let order = method(name)?.estimate.as_ref().ok_or(Error::NoEstimate)?.order;
        let blocks = Blocks::new(courses, rates, traced.shape);
        let executor = blocks.executor(&blocks.courses.step, level, &NO_CLOCK);
        let pushes = controls::pushes(&traced.scene().given);
        Ok(LargeAdaptive { blocks, executor, order, budget, pushes, pace: Pace::of([0.0; Pace::<f64>::NUMBERS]) })
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

    fn set_stop_flag(&mut self, stop: &Stop) {
        self.executor.stop = Stop::clone(stop);
        self.blocks.rates.set_stop_flag(stop);
    }

    fn attempt(&mut self, attempts: usize) {
        let Blocks { courses, rates, arena, sizes, stride } = &mut self.blocks;
        for _ in 0..attempts {
            let outlook = self.pace.outlook(self.budget);
            if !outlook.runs && !outlook.is_extra {
                break;
            }
            rates.set_step(outlook.step);
            rates.tally_mut().fill(0.0);
            self.executor.run(&courses.step, rates.as_mut(), *sizes, self.pace.t, outlook.step, arena);
            // Results come in pairs: of velocities, of coordinates.
            let length = |i: usize, row: usize| length2(&arena[row * *stride..][..sizes[i % 2]]);
            let made: Vec<f64> = courses.step.results.iter().enumerate().map(|(i, row)| length(i, *row)).collect();
            let (next, took) = judge(&self.pace, self.order, [length(0, V), length(1, Y)], &made, outlook);
            self.pace = next;
            if took {
                for ((home, made), numbers) in [V, Y].into_iter().zip(&courses.step.results).zip(*sizes) {
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

//! Executes a schedule: rates and passes over an arena.

use std::sync::atomic::Ordering::Relaxed;

use super::{
    rates::Rates,
    schedule::{Action, BlockSchedule, Rate},
};
use crate::{
    isa::Level,
    model::{program::square, spec::Spec},
    stage::{Clock, PreparedStage, Stop},
};

/// The passes of a schedule, ready for an arena.
pub(crate) struct Executor {
    /// For each action its kernel, if it is a pass.
    passes: Vec<Option<PreparedStage>>,
    stride: usize,
    /// When set, the remaining actions are skipped.
    pub stop: Stop,
}

const VECTOR: usize = 8;

/// The distance of rows of `numbers` numbers: their number, padded to whole vectors.
pub(crate) fn stride(numbers: usize) -> usize {
    // Four vectors can be interleaved if their number is a multiple of four. Short rows are padded less: they would be half
    // empty.
    const INTERLEAVED: usize = 4 * VECTOR;
    if numbers <= 8 * INTERLEAVED {
        return numbers.next_multiple_of(if numbers <= INTERLEAVED { VECTOR } else { 2 * VECTOR }).max(VECTOR);
    }
    let mut stride = numbers.next_multiple_of(INTERLEAVED);
    // A load waits for an earlier store whose address differs by a multiple of 4096 bytes: rows must not begin at the same place
    // of a page.
    const PAGE_NUMBERS: usize = 512;
    while numbers >= PAGE_NUMBERS
        && ((stride / INTERLEAVED).is_multiple_of(2)
            || stride % PAGE_NUMBERS < 2 * INTERLEAVED
            || stride % PAGE_NUMBERS > PAGE_NUMBERS - 2 * INTERLEAVED)
    {
        stride += INTERLEAVED;
    }
    stride
}

impl Executor {
    /// An executor for rows at this distance.
    pub(crate) fn new(schedule: &BlockSchedule, level: Level, stride: usize, clock: &Clock) -> Executor {
        let no_parameters = Spec::default();
        let pass = |action: &Action| match action {
            Action::Pass(stage) => {
                Some(PreparedStage::with(stage, stage.compiled_for_lanes(level, stride), &no_parameters, clock, f64::INFINITY))
            }
            Action::Ask { .. } | Action::Both { .. } | Action::Derive | Action::Solve(_) => None,
        };
        Executor { passes: schedule.actions.iter().map(pass).collect(), stride, stop: Stop::default() }
    }

    /// Executes a schedule at time t with the step h; for an attempt, h is its trial step.
    pub(crate) fn run(
        &mut self,
        schedule: &BlockSchedule,
        rates: &mut dyn Rates,
        sizes: [usize; 2],
        t: f64,
        h: f64,
        arena: &mut [f64],
    ) {
        let stride = self.stride;
        for (action, pass) in schedule.actions.iter().zip(&mut self.passes) {
            if self.stop.load(Relaxed) {
                return;
            }
            match (action, pass) {
                (Action::Pass(stage), Some(pass)) => pass.advance_at(stage, h, arena),
                (Action::Ask { rate, at, v, y, out }, _) => {
                    let (before, rest) = arena.split_at_mut(out * stride);
                    let (out_row, after) = rest.split_at_mut(stride);
                    let row = |row: usize, numbers: usize| {
                        let from = if row < *out { &before[row * stride..] } else { &after[(row - out - 1) * stride..] };
                        &from[..numbers]
                    };
                    let t = at.at(t, h);
                    match rate {
                        Rate::Dv => {
                            rates.dv(t, row(*v, sizes[0]), row(*y, sizes[1]), &mut out_row[..sizes[0].next_multiple_of(VECTOR)])
                        }
                        Rate::Dy => {
                            rates.dy(t, row(*v, sizes[0]), row(*y, sizes[1]), &mut out_row[..sizes[1].next_multiple_of(VECTOR)])
                        }
                        Rate::Velocity => rates.velocity(row(*y, sizes[1]), &mut out_row[..sizes[0]]),
                        Rate::SolutionV => out_row[..sizes[0]].copy_from_slice(rates.solution()[0]),
                        Rate::SolutionY => out_row[..sizes[1]].copy_from_slice(rates.solution()[1]),
                        Rate::ByTimeV => out_row[..sizes[0]].copy_from_slice(rates.by_time()[0]),
                        Rate::ByTimeY => out_row[..sizes[1]].copy_from_slice(rates.by_time()[1]),
                        Rate::SquareV | Rate::SquareY => {
                            let (numbers, lanes) = (sizes[usize::from(*rate == Rate::SquareY)], rates.lanes());
                            for lane in 0..lanes {
                                let of = |block, size| row(block, size).iter().skip(lane).step_by(lanes);
                                let sum = square(of(*v, sizes[0]).chain(of(*y, sizes[1])));
                                out_row[..numbers].iter_mut().skip(lane).step_by(lanes).for_each(|out| *out = sum);
                            }
                        }
                    }
                }
                (Action::Both { at, state: [v, y], out: [dv, dy] }, _) => {
                    let row = |row: &usize, numbers: usize| row * stride..row * stride + numbers;
                    let [of_v, of_y] = sizes.map(|numbers| numbers.next_multiple_of(VECTOR));
                    let rows = [row(v, sizes[0]), row(y, sizes[1]), row(dv, of_v), row(dy, of_y)];
                    // No two of them are the same row.
                    if let Ok([v, y, dv, dy]) = arena.get_disjoint_mut(rows) {
                        rates.both(at.at(t, h), v, y, [dv, dy]);
                    }
                }
                (Action::Derive, _) => {
                    let (v, y) = arena.split_at(stride);
                    rates.derive(t, h, &v[..sizes[0]], &y[..sizes[1]]);
                }
                (Action::Solve(right), _) => {
                    let [v, y] = [right[0], right[1]].map(|row| &arena[row * stride..]);
                    rates.solve([&v[..sizes[0]], &y[..sizes[1]]]);
                }
                (Action::Pass(_), None) => {} // there is a kernel for each pass
            }
        }
    }
}

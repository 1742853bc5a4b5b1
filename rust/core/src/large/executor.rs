//! Carries out a course: rates and passes over an arena.

use std::sync::atomic::Ordering::Relaxed;

use super::{
    Rates,
    course::{Act, Course, Rate},
};
use crate::{
    isa::Level,
    run::{
        crew::Stop,
        stage::{Clock, PreparedStage},
    },
    spec::Spec,
};

/// The passes of a course, ready for an arena.
pub struct Executor {
    /// Of each act its kernel, if it is a pass.
    passes: Vec<Option<PreparedStage>>,
    stride: usize,
    /// When set, what is left is not done.
    pub stop: Stop,
}

const VECTOR: usize = 8;

/// How long rows are, with what fills the last vectors.
pub fn stride(numbers: usize) -> usize {
    // Four vectors are interleaved if they can be, for which there must be a multiple of four. Short rows would be half air.
    const TEAM: usize = 4 * VECTOR;
    if numbers <= 8 * TEAM {
        return numbers.next_multiple_of(if numbers <= TEAM { VECTOR } else { 2 * VECTOR }).max(VECTOR);
    }
    let mut stride = numbers.next_multiple_of(TEAM);
    // A read of what is 4096 bytes from where was just written waits for it: rows must not begin at the same place of a page.
    const PAGE: usize = 512;
    while numbers >= PAGE && ((stride / TEAM).is_multiple_of(2) || stride % PAGE < 2 * TEAM || stride % PAGE > PAGE - 2 * TEAM) {
        stride += TEAM;
    }
    stride
}

impl Executor {
    /// For rows of so many numbers.
    pub fn new(course: &Course, level: Level, stride: usize, clock: &Clock) -> Executor {
        let nobody = Spec::default();
        let pass = |act: &Act| match act {
            Act::Pass(stage) => Some(PreparedStage::with(stage, stage.kit_of(level, stride), &nobody, clock, f64::INFINITY)),
            Act::Ask { .. } | Act::Both { .. } => None,
        };
        Executor { passes: course.acts.iter().map(pass).collect(), stride, stop: Stop::default() }
    }

    /// Carries it out at time t, with the step h. Attempts are that long, too.
    pub fn run(&mut self, course: &Course, rates: &mut dyn Rates, sizes: [usize; 2], t: f64, h: f64, arena: &mut [f64]) {
        let stride = self.stride;
        for (act, pass) in course.acts.iter().zip(&mut self.passes) {
            if self.stop.load(Relaxed) {
                return;
            }
            match (act, pass) {
                (Act::Pass(stage), Some(pass)) => pass.advance_at(stage, h, arena),
                (Act::Ask { rate, at, v, y, out }, _) => {
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
                    }
                }
                (Act::Both { at, state: [v, y], out: [dv, dy] }, _) => {
                    let row = |row: &usize, numbers: usize| row * stride..row * stride + numbers;
                    let [of_v, of_y] = sizes.map(|numbers| numbers.next_multiple_of(VECTOR));
                    let rows = [row(v, sizes[0]), row(y, sizes[1]), row(dv, of_v), row(dy, of_y)];
                    // No two of them are the same row.
                    if let Ok([v, y, dv, dy]) = arena.get_disjoint_mut(rows) {
                        rates.both(at.at(t, h), v, y, [dv, dy]);
                    }
                }
                (Act::Pass(_), None) => {} // there is a kernel for each pass
            }
        }
    }
}

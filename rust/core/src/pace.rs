//! Steps of chosen length: a member's own time and step, and the decision after each attempt.
//!
//! The increments of a step h are h times those of a step of 1. So a system is scaled once, to 1, and stretched to every step.

use crate::{
    number::Number,
    program::Program,
    system::{Block, System},
};

/// A new step is the old one times SAFETY·r^(−5/32)·p^(1/16), r being the error over the tolerance and p that of the step before
/// (PI control, Gustafsson 1988), held between LEAST and MOST; after a rejected step there is no p and no growth. Where the error
/// is estimated in a higher order than [`LOW`], it is SAFETY·r^(−3/32)·p^(1/32).
const SAFETY: f64 = 0.9;
const LEAST: f64 = 0.2;
const MOST: f64 = 5.0;
/// r² below this counts as this.
const TINY_SQUARE: f64 = 1e-10 * 1e-10;
/// The sixteenth root of the least p, 1e-4, and its thirty-second.
const CALM_ROOTS: [f64; 2] = [0.562_341_325_190_349_1, 0.749_894_209_332_455_8];
/// The highest order of an estimate that counts as low.
const LOW: u32 = 5;

/// Where a member stands, and how it goes on.
#[derive(Clone, Copy, Debug)]
pub struct Pace<N> {
    /// Its time.
    pub t: N,
    /// The step that it will try next.
    pub h: N,
    /// The time to reach, exactly.
    pub target: N,
    /// Tolerated error, relative to the length of a block.
    pub relative: N,
    /// Tolerated error beside the relative one.
    pub absolute: N,
    /// The sixteenth root of the last accepted error, or its thirty-second.
    pub before: N,
    /// How much the next step may grow.
    pub most: N,
    /// Accepted attempts.
    pub accepted: N,
    /// Rejected attempts.
    pub rejected: N,
    /// The square of the last error over the tolerance.
    pub error: N,
}

impl Pace<f64> {
    /// At the start, with a step to try first.
    pub fn new(t: f64, h: f64, relative: f64, absolute: f64) -> Self {
        Pace { t, h, target: t, relative, absolute, before: 1.0, most: MOST, accepted: 0.0, rejected: 0.0, error: 0.0 }
    }

    /// Whether there is anything to try: not at the target, not out of attempts, and the step still moves the time.
    pub fn runs(&self, budget: f64) -> bool {
        self.step_and_whether(budget).2
    }
}

impl<N: Number> Pace<N> {
    /// How many numbers it has.
    pub const NUMBERS: usize = 10;

    /// From its numbers.
    pub fn of(numbers: [N; 10]) -> Self {
        let [t, h, target, relative, absolute, before, most, accepted, rejected, error] = numbers;
        Pace { t, h, target, relative, absolute, before, most, accepted, rejected, error }
    }

    /// Its numbers.
    pub fn numbers(&self) -> [N; 10] {
        let Pace { t, h, target, relative, absolute, before, most, accepted, rejected, error } = *self;
        [t, h, target, relative, absolute, before, most, accepted, rejected, error]
    }

    /// The step to try, whether it ends at the target, and whether there is anything to try.
    fn step_and_whether(&self, budget: N) -> (N, N::Truth, N::Truth) {
        let rest = self.target - self.t;
        let last = rest.at_most(self.h);
        let step = N::choose(last, rest, self.h);
        let moves = self.t.below(self.t + step);
        (step, last, self.t.below(self.target) & moves & (self.accepted + self.rejected).below(budget))
    }
}

/// A system scaled to a step of 1, stretched to another.
struct Stretched<'a, N: Number> {
    s: &'a dyn System<N>,
    h: N,
}

impl<N: Number> System<N> for Stretched<'_, N> {
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.s.dv(t, v, y).map(|dv| self.h * dv)
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.s.dy(t, v, y).map(|dy| self.h * dy)
    }
}

/// One attempt at a step: the state goes on if its error is tolerated. `order` is that of the estimate.
pub fn attempt<N: Number>(
    program: &Program,
    s: &dyn System<N>,
    order: u32,
    pace: Pace<N>,
    budget: N,
    v: &Block<N>,
    y: &Block<N>,
) -> (Pace<N>, Block<N>, Block<N>) {
    let (step, last, runs) = pace.step_and_whether(budget);
    let made = program.run(&Stretched { s, h: step }, pace.t, step, v, y);
    let lengths: Vec<N> = made.iter().map(length2).collect();
    let (next, took) = judge(&pace, order, [length2(v), length2(y)], &lengths, (step, last, runs));
    let goes_on = |new: &Block<N>, old: &Block<N>| new.zip_map(old, |new, old| N::choose(took, new, old));
    (next, goes_on(&made[0], v), goes_on(&made[1], y))
}

/// What comes after an attempt, and whether the state goes on. Of both blocks: squares of the lengths of the old state and of what was made,
/// the new state and one or two estimates of its error.
pub fn judge<N: Number>(
    pace: &Pace<N>,
    order: u32,
    old: [N; 2],
    made: &[N],
    outlook: (N, N::Truth, N::Truth),
) -> (Pace<N>, N::Truth) {
    let error = Error { new: [made[0], made[1]], old, estimates: &made[2..] };
    pace.decided(order > LOW, error.over_tolerance(pace), outlook)
}

/// Squares of lengths of both blocks: of the state after the step and before it, and of one or two estimates of the error.
pub struct Error<'a, N> {
    /// Of the state after the step.
    pub new: [N; 2],
    /// Of the state before it.
    pub old: [N; 2],
    /// Of the estimates.
    pub estimates: &'a [N],
}

impl<N: Number> Error<'_, N> {
    /// The square of the error over what is tolerated.
    pub fn over_tolerance(&self, pace: &Pace<N>) -> N {
        let allowed = |old: N, new: N| {
            let length = pace.absolute + pace.relative * N::choose(new.below(old), old, new).sqrt();
            length * length
        };
        let tolerated = [allowed(self.old[0], self.new[0]), allowed(self.old[1], self.new[1])];
        let over = |estimate: &[N]| estimate[0] / tolerated[0] + estimate[1] / tolerated[1];
        let r2 = over(&self.estimates[..2]);
        if self.estimates.len() < 4 {
            return r2;
        }
        let corrected = (r2 * r2) / (r2 + N::of(0.01) * over(&self.estimates[2..]));
        N::choose(N::of(0.0).below(r2), corrected, r2)
    }
}

impl<N: Number> Pace<N> {
    /// What comes after an attempt with this error, and whether the state goes on. `high`: the estimate is of a high order.
    pub fn decided(&self, high: bool, r2: N, (step, last, runs): (N, N::Truth, N::Truth)) -> (Pace<N>, N::Truth) {
        let number = N::of;
        let good = r2.at_most(number(1.0)); // NaN is not
        let floored = N::choose(number(TINY_SQUARE).below(r2), r2, number(TINY_SQUARE));
        let r16 = floored.sqrt().sqrt().sqrt().sqrt(); // the eighth root of r
        let r32 = r16.sqrt();
        let r64 = r32.sqrt();
        let factor = number(SAFETY) / (if high { r32 } else { r16 } * r64);
        let factor = N::choose(good, factor * self.before, factor);
        let factor = N::choose(number(LEAST).below(factor), factor, number(LEAST));
        let ceiling = N::choose(good, self.most, number(1.0));
        let factor = N::choose(factor.below(ceiling), factor, ceiling);
        let factor = N::choose(r2.below(number(f64::INFINITY)), factor, number(LEAST));
        let grown = step * factor;
        // A step that was cut to end at the target says little: what was meant before it stands.
        let grown = N::choose(good & last & grown.below(self.h), self.h, grown);
        let took = runs & good;
        let reached = N::choose(last, self.target, self.t + step);
        let (root, calm) = if high { (r64, CALM_ROOTS[1]) } else { (r32, CALM_ROOTS[0]) };
        let root = N::choose(number(calm).below(root), root, number(calm));
        let count = |truth: N::Truth| N::choose(truth, number(1.0), number(0.0));
        let next = Pace {
            t: N::choose(took, reached, self.t),
            h: N::choose(runs, grown, self.h),
            before: N::choose(took, root, self.before),
            most: N::choose(runs, N::choose(good, number(MOST), number(1.0)), self.most),
            accepted: self.accepted + count(took),
            rejected: self.rejected + count(runs & !good),
            error: N::choose(runs, r2, self.error),
            ..*self
        };
        (next, took)
    }

    /// The step to try next, whether it ends at the target, and whether there is anything to try.
    pub fn outlook(&self, budget: N) -> (N, N::Truth, N::Truth) {
        self.step_and_whether(budget)
    }
}

/// The square of a block's length, number after number.
pub fn length2<'a, N: Number>(block: impl IntoIterator<Item = &'a N>) -> N {
    block.into_iter().fold(N::of(0.0), |total, number| total + *number * *number)
}

//! Steps of chosen length: a lane's own time and step, and the decision after each attempt.
//!
//! The increments of a step h are h times those of a step of 1. So a system is scaled once, to 1, and stretched to every step.
//! Everything here is written without a branch, so that a loop over lanes stays a vector loop.

use crate::{
    block::{Block, Work},
    stepper::Stepper,
    system::System,
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

/// Numbers of a pace.
pub const NUMBERS: usize = 10;

/// Where a lane stands, and how it goes on.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Its time.
    pub t: f64,
    /// The step that it will try next.
    pub h: f64,
    /// The time to reach, exactly.
    pub target: f64,
    /// Tolerated error, relative to the length of a block, and beside it.
    pub relative: f64,
    /// Tolerated error beside the relative one.
    pub absolute: f64,
    /// The sixteenth root of the last accepted error, or its thirty-second.
    pub before: f64,
    /// How much the next step may grow.
    pub most: f64,
    /// Accepted attempts.
    pub accepted: f64,
    /// Rejected attempts.
    pub rejected: f64,
    /// The square of the last error over the tolerance.
    pub error: f64,
}

impl Pace {
    /// At the start, with a step to try first.
    pub fn new(t: f64, h: f64, relative: f64, absolute: f64) -> Self {
        Pace { t, h, target: t, relative, absolute, before: 1.0, most: MOST, accepted: 0.0, rejected: 0.0, error: 0.0 }
    }

    /// From rows of lanes.
    #[inline(always)]
    pub fn load<const L: usize>(rows: &[[f64; L]; NUMBERS], l: usize) -> Self {
        let [t, h, target, relative, absolute, before, most, accepted, rejected, error] = rows;
        Pace {
            t: t[l],
            h: h[l],
            target: target[l],
            relative: relative[l],
            absolute: absolute[l],
            before: before[l],
            most: most[l],
            accepted: accepted[l],
            rejected: rejected[l],
            error: error[l],
        }
    }

    /// Its numbers, in the order of the rows.
    #[inline(always)]
    pub fn numbers(&self) -> [f64; NUMBERS] {
        let Pace { t, h, target, relative, absolute, before, most, accepted, rejected, error } = *self;
        [t, h, target, relative, absolute, before, most, accepted, rejected, error]
    }

    /// The step to try, and whether it ends at the target.
    #[inline(always)]
    fn step(&self) -> (f64, bool) {
        let rest = self.target - self.t;
        let last = self.h >= rest;
        (if last { rest } else { self.h }, last)
    }

    /// Whether there is anything to try: not at the target, not out of attempts, and the step still moves the time.
    #[inline(always)]
    pub fn runs(&self, budget: f64) -> bool {
        let (step, _) = self.step();
        (self.t < self.target) & (self.t + step > self.t) & (self.accepted + self.rejected < budget)
    }

    /// Takes in the error of an attempt; says whether the state goes on. `high`: the estimate is of a high order.
    #[inline(always)]
    fn decide(&mut self, high: bool, budget: f64, r2: f64) -> bool {
        let ((step, last), runs) = (self.step(), self.runs(budget));
        let good = r2 <= 1.0; // NaN is not
        let floored = if r2 > TINY_SQUARE { r2 } else { TINY_SQUARE };
        let r16 = floored.sqrt().sqrt().sqrt().sqrt(); // the eighth root of r
        let r32 = r16.sqrt();
        let r64 = r32.sqrt();
        let factor = SAFETY / (if high { r32 } else { r16 } * r64);
        let factor = if good { factor * self.before } else { factor };
        let factor = if factor > LEAST { factor } else { LEAST };
        let ceiling = if good { self.most } else { 1.0 };
        let factor = if factor < ceiling { factor } else { ceiling };
        let factor = if r2 < f64::INFINITY { factor } else { LEAST };
        let grown = step * factor;
        // A step that was cut to end at the target says little: what was meant before it stands.
        let grown = if good & last & (grown < self.h) { self.h } else { grown };
        let took = runs & good;
        let reached = if last { self.target } else { self.t + step };
        let (root, calm) = if high { (r64, CALM_ROOTS[1]) } else { (r32, CALM_ROOTS[0]) };
        let root = if root > calm { root } else { calm };
        self.t = if took { reached } else { self.t };
        self.h = if runs { grown } else { self.h };
        self.before = if took { root } else { self.before };
        self.most = if runs { ceiling_after(good) } else { self.most };
        self.accepted += if took { 1.0 } else { 0.0 };
        self.rejected += if runs & !good { 1.0 } else { 0.0 };
        self.error = if runs { r2 } else { self.error };
        took
    }
}

#[inline(always)]
fn ceiling_after(good: bool) -> f64 {
    if good { MOST } else { 1.0 }
}

/// A system scaled to a step of 1, stretched to another.
pub struct Stretched<S> {
    /// The system.
    pub system: S,
    h: f64,
}

impl<S> Stretched<S> {
    /// Of a step of 1.
    pub fn new(system: S) -> Self {
        Stretched { system, h: 1.0 }
    }
}

impl<S: System> System for Stretched<S> {
    type V = S::V;
    type Y = S::Y;

    #[inline(always)]
    fn dv(&mut self, t: f64, v: &Self::V, y: &Self::Y, out: &mut Self::V) {
        self.system.dv(t, v, y, out);
        for out in out.numbers_mut() {
            *out *= self.h;
        }
    }

    #[inline(always)]
    fn dy(&mut self, t: f64, v: &Self::V, y: &Self::Y, out: &mut Self::Y) {
        self.system.dy(t, v, y, out);
        for out in out.numbers_mut() {
            *out *= self.h;
        }
    }
}

/// Scratch of an attempt: the state that it would make, and that of the step.
pub struct Trial<S: System> {
    v: S::V,
    y: S::Y,
    work: Work<Stretched<S>>,
}

impl<S: System> Trial<S> {
    /// Scratch for blocks of these shapes.
    #[inline(always)]
    pub fn new(evaluations: u32, v: &S::V, y: &S::Y) -> Self {
        Trial { v: v.like(), y: y.like(), work: Work::new(evaluations, v, y) }
    }
}

/// One attempt at a step: the state goes on if its error is tolerated.
#[inline(always)]
pub fn attempt<S: System, St: Stepper>(
    pace: &mut Pace,
    budget: f64,
    s: &mut Stretched<S>,
    v: &mut S::V,
    y: &mut S::Y,
    trial: &mut Trial<S>,
) {
    let (step, _) = pace.step();
    s.h = step;
    trial.v.numbers_mut().copy_from_slice(v.numbers());
    trial.y.numbers_mut().copy_from_slice(y.numbers());
    St::step(s, pace.t, step, &mut trial.v, &mut trial.y, &mut trial.work);
    St::error(&mut trial.work);
    let allowed = (allowed(pace, v, &trial.v), allowed(pace, y, &trial.y));
    let mut r2 = length2(&trial.work.v) / allowed.0 + length2(&trial.work.y) / allowed.1;
    if const { St::CORRECTED } {
        St::coarse_error(&mut trial.work);
        let coarse = length2(&trial.work.v) / allowed.0 + length2(&trial.work.y) / allowed.1;
        r2 = if r2 > 0.0 { (r2 * r2) / (r2 + 0.01 * coarse) } else { r2 };
    }
    let high = const { matches!(St::RECORD.error_order, Some(order) if order > LOW) };
    let took = pace.decide(high, budget, r2);
    for (old, new) in v.numbers_mut().iter_mut().zip(trial.v.numbers()) {
        *old = if took { *new } else { *old };
    }
    for (old, new) in y.numbers_mut().iter_mut().zip(trial.y.numbers()) {
        *old = if took { *new } else { *old };
    }
}

/// The square of the length of an error that is tolerated in a block: relative to the longer of the old and the new one.
#[inline(always)]
fn allowed(pace: &Pace, old: &impl Block, new: &impl Block) -> f64 {
    let (a, b) = (length2(old), length2(new));
    let allowed = pace.absolute + pace.relative * (if a > b { a } else { b }).sqrt();
    allowed * allowed
}

/// The square of a block's length, number after number.
#[inline(always)]
fn length2(block: &impl Block) -> f64 {
    let mut total = 0.0;
    for number in block.numbers() {
        total += number * number;
    }
    total
}

//! Adaptive steps: a member's own time and step, and the decision after each attempt.
//!
//! The increments of a step h are h times those of a step of 1. So a system is scaled once, to 1, and stretched to every step.

use crate::{
    number::Number,
    program::Program,
    system::{Block, Energies, System},
};

/// A new step is the old one times SAFETY·r^(−5/32)·p^(1/16), r being the error over the tolerance and p that of the step before
/// (PI control, Gustafsson 1988), held between MIN_FACTOR and MAX_FACTOR; after a rejected step there is no p and no growth. Where
/// the error is estimated in a higher order than [`LOW`], it is SAFETY·r^(−3/32)·p^(1/32).
const SAFETY: f64 = 0.9;
const MIN_FACTOR: f64 = 0.2;
pub(crate) const MAX_FACTOR: f64 = 5.0;
/// r² below this counts as this.
const TINY_SQUARE: f64 = 1e-10 * 1e-10;
/// The sixteenth root of the least p, 1e-4, and its thirty-second.
const CALM_ROOTS: [f64; 2] = [0.562_341_325_190_349_1, 0.749_894_209_332_455_8];
/// The highest order of an estimate that counts as low.
const LOW: u32 = 5;

/// A change of y in a step that is smaller than this, relative to the largest length of y so far, is lost in rounding, with some margin. So
/// an error of v that moves y by less is tolerated, however small v is: near rest, where forces cancel, v is only rounding.
pub(crate) const ROUNDING: f64 = 1.0 / (1u64 << 40) as f64;

/// The first step is the fraction FIRST of the time in which the state changes at the start: rather too short than too long, since it
/// then grows by MAX_FACTOR a step. Where there is no such time it is BLIND, in units of time. It is at least MOVES times the time of the
/// start, 2¹² roundings.
const FIRST: f64 = 0.01;
const BLIND: f64 = 1e-6;
const MOVES: f64 = 1.0 / (1u64 << 40) as f64;

/// That part. A jump of a force is met by ever shorter steps until one errs by no more than the tolerance of such a length: so it must
/// be long beside the roundings of time, and short beside the motion that follows.
const PUSHED: f64 = 1.0 / 64.0;

/// The time of a member and the state of its step-size controller. Steps do not depend on the saved times: a step that passes the next
/// of them is held, not taken, until the states within it are saved. Each is computed by an extra step from the start of the held one.
#[derive(Clone, Copy, Debug)]
pub struct Pace<N> {
    /// Its time.
    pub t: N,
    /// The step that it will try next.
    pub h: N,
    /// The next output time.
    pub target: N,
    /// Above zero: the length of the extra step that comes next, to a saved time.
    pub extra: N,
    /// 1 if the next step is held: it was accepted, but passes the target.
    pub held: N,
    /// Tolerated error of a step, relative to the length of a block.
    pub relative: N,
    /// Tolerated error in addition to the relative one.
    pub absolute: N,
    /// 1 if errors are relative to the largest length of a block so far, 0 if they are relative to its present length.
    pub lasts: N,
    /// The squares of the largest lengths of v and y so far.
    pub longest: [N; 2],
    /// The time of the start.
    pub begin: N,
    /// The longest step while inputs change from sample to sample, so that none is skipped,
    pub interval: N,
    /// and the time until which they do.
    pub until: N,
    /// The sixteenth root of the last accepted error, or its thirty-second.
    pub before: N,
    /// How much the next step may grow.
    pub most: N,
    /// Accepted attempts.
    pub accepted: N,
    /// Rejected attempts.
    pub rejected: N,
    /// Steps for saved states: the extra ones, and those that were held and are made once more.
    pub extra_steps: N,
    /// The square of the last error over the tolerance.
    pub error: N,
    /// The energy that a control or projection added in accepted steps; for a control the sum over their evaluations.
    pub work: N,
}

/// The next attempt: the length of the step, whether it is an extra one, and whether there is a step of the run itself to try.
#[derive(Clone, Copy, Debug)]
pub struct Outlook<N: Number> {
    /// How long the step is.
    pub step: N,
    /// Whether it is an extra one.
    pub is_extra: N::Truth,
    /// Whether it is a step of the run: not at the target, not held, not out of attempts, and the time moves.
    pub runs: N::Truth,
}

impl Pace<f64> {
    /// Whether there is a step of the run to try.
    pub fn runs(&self, budget: f64) -> bool {
        self.outlook(budget).runs
    }

    /// The same of many members, from rows of their numbers: without moving what is not needed, for this is asked after every attempt.
    pub fn find_running<'a>(row: impl Fn(usize) -> &'a [f64], budget: f64, runs: &mut [bool]) {
        let places = Pace::of(std::array::from_fn(|i| i as f64));
        let row = |place: f64| row(place as usize);
        let (t, h, target, held) = (row(places.t), row(places.h), row(places.target), row(places.held));
        let (extra, accepted, rejected) = (row(places.extra), row(places.accepted), row(places.rejected));
        let times = t.iter().zip(h).zip(target);
        let counts = held.iter().zip(extra).zip(accepted.iter().zip(rejected));
        for (runs, (((t, h), target), ((held, extra), (accepted, rejected)))) in runs.iter_mut().zip(times.zip(counts)) {
            let moves = (*t < *target) & (*t < *t + *h);
            *runs = moves & (*accepted + *rejected < budget) & (*held <= 0.0) & (*extra <= 0.0);
        }
    }

    /// How many steps of the present length are left to the next output times, in the mean of those members that are not there.
    pub fn steps_left<'a>(row: impl Fn(usize) -> &'a [f64]) -> f64 {
        let places = Pace::of(std::array::from_fn(|i| i as f64));
        let [t, h, target] = [places.t, places.h, places.target].map(|place| row(place as usize));
        let left = t.iter().zip(h).zip(target).filter(|((t, _), target)| t < target).map(|((t, h), target)| (target - t) / h);
        let (count, sum) = left.fold((0.0, 0.0), |(n, sum), left| (n + 1.0, sum + left));
        if count > 0.0 { sum / count } else { 0.0 }
    }

    /// Whether the next output time is within the held step.
    pub fn holds(&self) -> bool {
        self.held > 0.0 && self.target < self.t + self.h
    }

    /// The same where nothing runs.
    #[must_use]
    pub fn idle(self) -> Self {
        Pace { target: self.t, extra: 0.0, held: 0.0, ..self }
    }
}

impl<N: Number> Pace<N> {
    /// How many numbers it has.
    pub const NUMBERS: usize = 20;
    /// Places of the time and of the step to try next among them.
    pub const PLACES: [usize; 2] = [0, 1];

    /// From its numbers.
    pub fn of(numbers: [N; 20]) -> Self {
        let [t, h, target, extra, held, relative, absolute, lasts, rest @ ..] = numbers;
        let [v, y, begin, interval, until, before, most, accepted, rejected, extra_steps, error, work] = rest;
        let longest = [v, y];
        Pace {
            t,
            h,
            target,
            extra,
            held,
            relative,
            absolute,
            lasts,
            longest,
            begin,
            interval,
            until,
            before,
            most,
            accepted,
            rejected,
            extra_steps,
            error,
            work,
        }
    }

    /// Its numbers.
    pub fn numbers(&self) -> [N; 20] {
        let Pace { t, h, target, extra, held, relative, absolute, lasts, longest: [v, y], .. } = *self;
        let Pace { begin, interval, until, before, most, accepted, rejected, extra_steps, error, work, .. } = *self;
        [
            t,
            h,
            target,
            extra,
            held,
            relative,
            absolute,
            lasts,
            v,
            y,
            begin,
            interval,
            until,
            before,
            most,
            accepted,
            rejected,
            extra_steps,
            error,
            work,
        ]
    }

    /// Where a member stands at the start. A step to try first that is 0 is chosen here: a share of the shortest time in which a block
    /// changes by its length. `s` is scaled to a step of 1; `series` says whether the method is one.
    #[must_use]
    pub fn begun(self, s: &dyn System<N>, series: bool, v: &Block<N>, y: &Block<N>) -> Self {
        let zero = N::of(0.0);
        let rates = [s.dv(self.t, v, y), s.dy(self.t, v, y)];
        let longest = [length2(v), length2(y)];
        let (of_v, of_y) = (longest[0].sqrt(), longest[1].sqrt());
        let [rate_v, rate_y] = [&rates[0], &rates[1]].map(|rate| length2(rate).sqrt());
        let (has_v, has_y) = (!v.is_empty(), !y.is_empty());
        let times =
            [has_v.then(|| of_v / rate_v), has_y.then(|| of_y / rate_y), (has_v && has_y).then(|| (of_y / rate_v).sqrt())];
        let shortest = times
            .into_iter()
            .flatten()
            .fold(N::of(f64::INFINITY), |least, time| N::choose(zero.below(time) & time.below(least), time, least));
        let share = N::choose(shortest.below(N::of(f64::INFINITY)), N::of(FIRST) * shortest, N::of(BLIND));
        let chosen = longer(share, N::of(MOVES) * longer(self.t, -self.t));
        let h = N::choose(zero.below(self.h), self.h, chosen);
        let h = N::choose(self.t.below(self.until) & self.interval.below(h), self.interval, h);
        Pace { h, longest, before: if series { h } else { self.before }, ..self }
    }

    /// What comes next.
    pub fn outlook(&self, budget: N) -> Outlook<N> {
        let zero = N::of(0.0);
        let is_extra = zero.below(self.extra);
        let moves = self.t.below(self.t + self.h);
        let left = (self.accepted + self.rejected).below(budget);
        let runs = self.t.below(self.target) & moves & left & self.held.at_most(zero) & !is_extra;
        Outlook { step: N::choose(is_extra, self.extra, self.h), is_extra, runs }
    }
}

/// A system scaled to a step of 1, stretched to another.
pub struct Stretched<N: Number> {
    /// The system.
    pub s: Box<dyn System<N>>,
    /// The step.
    pub h: N,
}

impl<N: Number> System<N> for Stretched<N> {
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.s.dv(t, v, y).map(|dv| self.h * dv)
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.s.dy(t, v, y).map(|dy| self.h * dy)
    }

    fn energies(&self, v: &Block<N>, y: &Block<N>) -> Option<Energies<N>> {
        let Energies { dv, kinetic, whole } = self.s.energies(v, y)?;
        Some(Energies { dv: dv.map(|dv| self.h * dv), kinetic: self.h * kinetic, whole: self.h * whole })
    }
}

/// How an attempt uses a system.
pub struct Attempted<'a, N: Number> {
    /// The rates for a step, under a control if there is one.
    pub rates: &'a dyn Fn(N) -> Box<dyn System<N>>,
    /// The system scaled to 1, under a projection if there is one.
    pub projected: &'a dyn System<N>,
}

/// One attempt at a step: the state goes on, projected, if its error is tolerated. `order` is that of the estimate. An extra step leaves
/// the pace as it is, and its state has to be put back.
pub fn attempt<N: Number>(
    program: &Program,
    system: &Attempted<N>,
    order: u32,
    pace: Pace<N>,
    budget: N,
    v: &Block<N>,
    y: &Block<N>,
) -> (Pace<N>, Block<N>, Block<N>) {
    let outlook = pace.outlook(budget);
    let s = (system.rates)(outlook.step);
    let mut made = program.run(s.as_ref(), pace.t, outlook.step, v, y);
    let lengths: Vec<N> = made.iter().map(length2).collect();
    let (next, took) = judge(&pace, order, [length2(v), length2(y)], &lengths, outlook);
    made.truncate(2);
    let (Some(new_y), Some(new_v)) = (made.pop(), made.pop()) else { return (next, v.clone(), y.clone()) };
    let (new_v, new_y) = system.projected.project(new_v, new_y);
    let pushed = s.tally().map(|tally| tally / outlook.step);
    let next = match pushed.or(system.projected.tally()) {
        Some(done) => Pace { work: N::choose(took & !outlook.is_extra, pace.work + done, pace.work), ..next },
        None => next,
    };
    let goes_on = |new: &Block<N>, old: &Block<N>| new.zip_map(old, |new, old| N::choose(took, new, old));
    (next, goes_on(&new_v, v), goes_on(&new_y, y))
}

/// What comes after an attempt, and whether the state goes on. Of both blocks: squares of the lengths of the old state and of what was made,
/// the new state and one or two estimates of its error.
pub fn judge<N: Number>(pace: &Pace<N>, order: u32, old: [N; 2], made: &[N], outlook: Outlook<N>) -> (Pace<N>, N::Truth) {
    let new = [made[0], made[1]];
    let r2 = over_tolerance(&made[2..], pace.tolerated(outlook.step, old, new));
    pace.decided(order > LOW, r2, new, outlook)
}

/// An error over what is tolerated. A block that is zero, as it has always been, tolerates no error and has none.
fn share<N: Number>(error: N, tolerated: N) -> N {
    let zero = N::of(0.0);
    N::choose(error.at_most(zero), zero, error / tolerated)
}

/// The larger of two lengths.
pub(crate) fn longer<N: Number>(a: N, b: N) -> N {
    N::choose(a.below(b), b, a)
}

/// The square of the error over what is tolerated, from squares of lengths of one or two estimates of both blocks.
fn over_tolerance<N: Number>(estimates: &[N], tolerated: [N; 2]) -> N {
    let zero = N::of(0.0);
    let over = |estimate: &[N]| share(estimate[0], tolerated[0]) + share(estimate[1], tolerated[1]);
    let r2 = over(&estimates[..2]);
    if estimates.len() < 4 {
        return r2;
    }
    let corrected = (r2 * r2) / (r2 + N::of(0.01) * over(&estimates[2..]));
    N::choose(zero.below(r2), corrected, r2)
}

impl<N: Number> Pace<N> {
    /// Squares of the errors that are tolerated in both blocks, from squares of their lengths before and after a step.
    fn tolerated(&self, step: N, old: [N; 2], new: [N; 2]) -> [N; 2] {
        let zero = N::of(0.0);
        // A block at zero so far on which a force sets in counts as long as that force would have made it in a part of the time since.
        let since = N::of(PUSHED) * ((self.t + step - self.begin) / step);
        let since2 = longer(N::of(1.0), since * since);
        let rested = (self.longest[0] + self.longest[1]).at_most(zero);
        let lasting = |i: usize| N::choose(rested, new[i] * since2, self.longest[i]);
        let lost = N::of(ROUNDING) / step;
        let lasting = [longer(lasting(0), self.longest[1] * (lost * lost)), lasting(1)];
        [0, 1].map(|i| {
            let counts = N::choose(zero.below(self.lasts), lasting[i], old[i]);
            let length = self.absolute + self.relative * longer(counts, new[i]).sqrt();
            length * length
        })
    }

    /// What comes after an attempt with this error, and whether the state goes on. `high`: the estimate is of a high order. `new`: squares
    /// of the lengths of the new blocks.
    fn decided(&self, high: bool, r2: N, new: [N; 2], outlook: Outlook<N>) -> (Pace<N>, N::Truth) {
        let number = N::of;
        let Outlook { step, is_extra, runs } = outlook;
        // Lengths whose squares overflow would tolerate any error, so they count as not finite.
        let r2 = N::choose((new[0] + new[1]).below(number(f64::INFINITY)), r2, number(f64::INFINITY));
        let good = r2.at_most(number(1.0)); // NaN is not
        let floored = N::choose(number(TINY_SQUARE).below(r2), r2, number(TINY_SQUARE));
        let r16 = floored.sqrt().sqrt().sqrt().sqrt(); // the eighth root of r
        let r32 = r16.sqrt();
        let r64 = r32.sqrt();
        let factor = number(SAFETY) / (if high { r32 } else { r16 } * r64);
        let factor = N::choose(good, factor * self.before, factor);
        let factor = N::choose(number(MIN_FACTOR).below(factor), factor, number(MIN_FACTOR));
        let ceiling = N::choose(good, self.most, number(1.0));
        let factor = N::choose(factor.below(ceiling), factor, ceiling);
        let factor = N::choose(r2.below(number(f64::INFINITY)), factor, number(MIN_FACTOR));
        let reached = self.t + step;
        let passes = self.target.below(reached);
        let (takes, holds, fails) = (runs & good & !passes, runs & good & passes, runs & !good);
        let decides = takes | fails;
        let (root, calm) = if high { (r64, CALM_ROOTS[1]) } else { (r32, CALM_ROOTS[0]) };
        let root = N::choose(number(calm).below(root), root, number(calm));
        let count = |truth: N::Truth| N::choose(truth, number(1.0), number(0.0));
        let longest = |i: usize| N::choose(takes & self.longest[i].below(new[i]), new[i], self.longest[i]);
        let t = N::choose(takes, reached, self.t);
        let grown = step * factor;
        let grown = N::choose(t.below(self.until) & self.interval.below(grown), self.interval, grown);
        let next = Pace {
            t,
            h: N::choose(decides, grown, self.h),
            extra: N::choose(is_extra, number(0.0), self.extra),
            held: N::choose(holds, number(1.0), self.held),
            longest: [longest(0), longest(1)],
            before: N::choose(takes, root, self.before),
            most: N::choose(decides, N::choose(good, number(MAX_FACTOR), number(1.0)), self.most),
            accepted: self.accepted + count(takes),
            rejected: self.rejected + count(fails),
            extra_steps: self.extra_steps + count(holds | is_extra),
            error: N::choose(decides, r2, self.error),
            ..*self
        };
        (next, takes | is_extra)
    }
}

/// The square of a block's length, number after number.
pub fn length2<'a, N: Number>(block: impl IntoIterator<Item = &'a N>) -> N {
    block.into_iter().fold(N::of(0.0), |total, number| total + *number * *number)
}

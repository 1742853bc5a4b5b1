//! Adaptive steps: an attempt of a member's own step, and the decision after it.
//!
//! The increments of a step h are h times those of a step of 1. So a system is scaled once, to 1, and stretched to every step.

use super::controller::{MIN_FACTOR, MOVES};
pub use super::{acceptance::Acceptance, controller::Pace};
pub(crate) use super::{
    acceptance::Scales,
    controller::{MAX_FACTOR, Outlook, length, reach},
    sizes::{largest, longer, total},
};
use crate::{
    model::{
        program::Program,
        system::{Block, Energies, System},
    },
    tape::{mass::Mass, number::Number},
};

/// A new step is the old one times SAFETY·r^(−5/32)·p^(1/16), r being the error over the tolerance and p that of the step before
/// (PI control, Gustafsson 1988), held between MIN_FACTOR and MAX_FACTOR; after a rejected step there is no p and no growth.
/// Where the error is estimated in a higher order than [`LOW`], it is SAFETY·r^(−3/32)·p^(1/32).
const SAFETY: f64 = 0.9;
/// r below this counts as this.
const TINY: f64 = 1e-10;
/// The sixteenth root of the least p, 1e-4, and its thirty-second.
const CALM_ROOTS: [f64; 2] = [0.562_341_325_190_349_1, 0.749_894_209_332_455_8];
/// The highest order of an estimate that counts as low.
const LOW: u32 = 5;

/// A size counts as no less than this part of the largest that the group has been: 2⁻⁵¹², half of the range of numbers. What
/// decays to nothing is followed until then.
pub(crate) const LEAST_PART: f64 = f64::from_bits((1023 - 512) << 52);
/// Rates that are differences of larger numbers are wrong by the rounding of these, of which the controller knows nothing, and
/// no step makes the error small beside a size that has become less than that. So the error of a group is rounding
/// - where a shorter step fails, too, with an error that did not fall by the power 3/2 of the length (that of smooth rates falls
///   by 3 and more), while the group changes by less than SLOW times the fourth root of the tolerance, so that it is no motion;
///   or by PUSHES times its size and more, for a force that sets in where next to nothing is left looks alike. Where it is no
///   such push it is at most ROUNDINGS times what is lost in the largest size so far: beside a pole errors do not fall either.
///   Not so with algebraic equations: what they are off by after a step is an error of the next one, however short;
/// - where a group stands, its error being UNLIKE times its change, though that is HOLDS_DOWN of what is tolerated or more (but
///   not more than is tolerated or known: at the limit of stability a deviation stands, too, and would grow with what is known of
///   it);
/// - where it is no more than ALIKE times what is known of it.
///
/// From then on ROUNDED times such an error in the same time is tolerated, up to the tolerance of the largest size so far. That
/// fades by FADES a step.
const SLOW: f64 = 0.75;
const PUSHES: f64 = 1024.0;
const UNLIKE: f64 = 8.0;
const HOLDS_DOWN: f64 = 0.125;
const ALIKE: f64 = 4.0;
const ROUNDED: f64 = 4.0;
const FADES: f64 = 15.0 / 16.0;
const ROUNDINGS: f64 = 2.0;
/// A change of y in a step that is smaller than this, relative to the largest size of y so far, is lost in rounding, with some
/// margin. So an error of v that moves y by less is tolerated, however small v is: near rest, where forces cancel, v is only
/// rounding.
pub(crate) const ROUNDING: f64 = 1.0 / (1u64 << 40) as f64;
/// The rounding for states of float32, whose roundings are 2²⁹ times as large.
pub(crate) const SINGLE_ROUNDING: f64 = 1.0 / (1u64 << 11) as f64;
/// A component that has been zero so far counts as this part of the largest in its block. A cascade or a wave reaches one
/// component after the other, each at first with a power of the time that is beyond the order of the method: relative to itself
/// its first step would always be all wrong, however short.
pub(crate) const ONSET: f64 = 1.0 / (1u64 << 40) as f64;

/// The first step is the fraction FIRST of the time in which the state changes, at the start and at two times ahead: rather too
/// short than too long, since it then grows by MAX_FACTOR a step. It is at least MOVES times the time of the start, 2¹²
/// roundings. After a jump it is MIN_FACTOR times the step before.
const FIRST: f64 = 0.01;

/// A jump of a force is met by ever shorter steps until one errs by no more than the tolerance of the length that the push would
/// have made in this part of the time since the start: it must be long beside the roundings of time, and short beside the motion
/// that follows.
pub(crate) const PUSHED: f64 = 1.0 / 64.0;
/// A step in which nothing moves and no stage saw a rate has an estimate of zero that says nothing. The next step is then no
/// longer than QUIET times the time since the start, or than this one.
const QUIET: f64 = 1.0 / 32.0;
/// The most by which a coarse estimate e₃ may exceed a finer one, times √e₃, e₃ relative to the size: a constant of smooth
/// motions.
const SMOOTH: f64 = 32.0;
/// Rates that differ within a step by more than WILD of the size while the finer estimate is more than CHANCE times less: a pole
/// within the step, of which the method happens to be exact.
const WILD: f64 = 0.5;
const CHANCE: f64 = 1024.0;
/// See `reference/adaptive/pace.py`.
const CHANGES: f64 = 32.0;
/// The error over the tolerance that a step counts as which makes a component negative that has to stay positive.
const OUTSIDE: f64 = 16.0;

impl<N: Number> Pace<N> {
    /// Where a member stands at the start, and the sizes of its groups. A step to try first that is below zero is chosen here: a
    /// share of the shortest time in which a group changes by its size. `s` is scaled to a step of 1; `series` says whether the
    /// method is one.
    #[must_use]
    pub(crate) fn begun(
        self,
        s: &dyn System<N>,
        acceptance: &Acceptance,
        series: bool,
        v: &Block<N>,
        y: &Block<N>,
    ) -> (Self, Vec<N>) {
        let zero = N::of(0.0);
        let rates_at = |t: N, v: &Block<N>, y: &Block<N>| {
            let dy = s.dy(t, v, y);
            [s.dv(t, v, y), s.mass().map_or_else(|| dy.clone(), |mass| mass.rates(dy.clone()))]
        };
        let rates = rates_at(self.t, v, y);
        let longest = acceptance.sizes(v.as_slice(), y.as_slice());
        let counts = acceptance.counts(v.len(), y.len());
        let shortest = |rates: &[Block<N>; 2]| {
            let rates = acceptance.sizes(rates[0].as_slice(), rates[1].as_slice());
            let mut times: Vec<N> = longest.iter().zip(&rates).map(|(length, rate)| *length / *rate).collect();
            if counts[0] > 0 && counts[1] > 0 {
                let lengths = paired(&longest[counts[0]..], counts[0]);
                times.extend(lengths.into_iter().zip(&rates).map(|(length, rate)| (length / *rate).sqrt()));
            }
            let shorter = |least: N, time: N| N::choose(zero.below(time) & time.below(least), time, least);
            times.into_iter().fold(N::of(f64::INFINITY), shorter)
        };
        let least = N::of(MOVES) * longer(self.t, -self.t);
        let time = shortest(&rates);
        // Where no component changes by its size, the times of whole blocks count, whatever the units of their components.
        let changes = acceptance.sizes(rates[0].as_slice(), rates[1].as_slice());
        let of_block = |least: N, block: std::ops::Range<usize>| {
            let time = total(&longest[block.clone()]) / total(&changes[block.clone()]);
            let shorter = N::choose(zero.below(time) & time.below(least), time, least);
            if block.is_empty() { least } else { shorter }
        };
        let blocks = [0..counts[0], counts[0]..counts[0] + counts[1]].into_iter().fold(N::of(f64::INFINITY), of_block);
        let time = N::choose(time.below(N::of(f64::INFINITY)), time, blocks);
        let chosen = longer(N::choose(time.below(N::of(f64::INFINITY)), N::of(FIRST) * time, -self.h), least);
        let mut h = chosen;
        for part in [0.5, 1.0] {
            let ahead = N::of(part) * chosen;
            let t = self.t + ahead;
            let [v, y] = [(v, &rates[0]), (y, &rates[1])].map(|(block, rate)| block.zip_map(rate, |x, rate| x + ahead * rate));
            let time = N::of(FIRST) * shortest(&rates_at(t, &v, &y));
            h = N::choose(time.below(h), time, h);
        }
        let h = self.shortened(N::choose(zero.below(self.h), self.h, longer(h, least)), self.t);
        (Pace { h, before: if series { h } else { self.before }, ..self }, longest)
    }
}

/// For each group of v the size of its y; the largest, if y has another number of groups.
fn paired<N: Number>(of_y: &[N], number: usize) -> Vec<N> {
    if of_y.len() == number { of_y.to_vec() } else { vec![largest(of_y); number] }
}

/// A system scaled to a step of 1, stretched to another.
pub(crate) struct Stretched<N: Number> {
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

    fn mass(&self) -> Option<&Mass> {
        self.s.mass()
    }

    fn energies(&self, v: &Block<N>, y: &Block<N>) -> Option<Energies<N>> {
        let Energies { dv, kinetic, whole } = self.s.energies(v, y)?;
        Some(Energies { dv: dv.map(|dv| self.h * dv), kinetic: self.h * kinetic, whole: self.h * whole })
    }
}

/// How an attempt uses a system.
pub(crate) struct Attempted<'a, N: Number> {
    /// The rates for a step, under a control if there is one.
    pub rates: &'a dyn Fn(N) -> Box<dyn System<N>>,
    /// The system scaled to 1, under a projection if there is one.
    pub projected: &'a dyn System<N>,
}

/// The result of an attempt: sizes of groups only, no squares.
#[derive(Debug)]
pub(crate) struct Made<N> {
    /// Before the step.
    pub old: Vec<N>,
    /// After it.
    pub new: Vec<N>,
    /// Of their difference.
    pub moved: Vec<N>,
    /// Of one or two estimates of the error.
    pub errors: Vec<Vec<N>>,
    /// The numbers that have to stay positive.
    pub positive: Vec<N>,
    /// See [`ROUNDING`].
    pub rounding: f64,
    /// Whether there may be algebraic equations.
    pub has_mass: bool,
}

impl<N: Number> Made<N> {
    /// From the state before, and behind the state after it the estimates, both blocks of each in turn.
    pub(crate) fn of(acceptance: &Acceptance, old: [&[N]; 2], blocks: &[&[N]]) -> Self {
        let sizes = |pair: &[&[N]]| acceptance.sizes(pair[0], pair[1]);
        let mut pairs = blocks.chunks_exact(2);
        let after = pairs.next().unwrap_or(&[&[], &[]]);
        let differences = |[old, new]: [&[N]; 2]| new.iter().zip(old).map(|(new, old)| *new - *old).collect::<Vec<N>>();
        let [v, y] = [0, 1].map(|i| differences([old[i], after[i]]));
        let component = |place: u32| after.iter().copied().flatten().nth(place as usize).copied();
        Made {
            old: sizes(&old),
            new: sizes(after),
            moved: acceptance.sizes(&v, &y),
            errors: pairs.map(sizes).collect(),
            positive: acceptance.positive.iter().filter_map(|place| component(*place)).collect(),
            rounding: ROUNDING,
            has_mass: false,
        }
    }
}

/// One attempt at a step: the state goes on, projected, if its error is tolerated. `order` is that of the estimate. An extra step
/// that is accepted leaves the pace as it is, and its state has to be put back.
#[allow(clippy::too_many_arguments, reason = "all that an attempt depends on")]
pub(crate) fn attempt<N: Number>(
    program: &Program,
    system: &Attempted<N>,
    order: u32,
    acceptance: &Acceptance,
    (pace, scales): (Pace<N>, &Scales<N>),
    budget: N,
    v: &Block<N>,
    y: &Block<N>,
) -> (Pace<N>, Scales<N>, Block<N>, Block<N>) {
    let outlook = pace.outlook(budget);
    let s = (system.rates)(outlook.step);
    let mut made = program.run(s.as_ref(), pace.t, outlook.step, v, y);
    let blocks: Vec<&[N]> = made.iter().map(Block::as_slice).collect();
    let sizes = Made::of(acceptance, [v.as_slice(), y.as_slice()], &blocks);
    let sizes = Made { has_mass: s.mass().is_some(), ..sizes };
    let (next, scales, took) = judge(&pace, scales, order, acceptance.counts(v.len(), y.len()), &sizes, outlook);
    made.truncate(2);
    let (Some(new_y), Some(new_v)) = (made.pop(), made.pop()) else { return (next, scales, v.clone(), y.clone()) };
    let (new_v, new_y) = system.projected.project(new_v, new_y);
    let pushed = s.tally().map(|tally| tally / outlook.step);
    let next = match pushed.or(system.projected.tally()) {
        Some(done) => Pace { work: N::choose(took & !outlook.is_extra, pace.work + done, pace.work), ..next },
        None => next,
    };
    (next, scales, taken(took, &new_v, v), taken(took, &new_y, y))
}

/// The new block if the state goes on, else the old one.
pub(crate) fn taken<N: Number>(took: N::Truth, new: &Block<N>, old: &Block<N>) -> Block<N> {
    new.zip_map(old, |new, old| N::choose(took, new, old))
}

/// Whether a group changes so much in a step, from these sizes to those, that states within it are better made by steps.
pub(crate) fn changes_within<N: Number>(pace: &Pace<N>, scales: &Scales<N>, old: &[N], new: &[N]) -> N::Truth {
    let share = |(group, (old, new)): (usize, (&N, &N))| {
        let (larger, smaller) = (longer(*old, *new), N::choose(new.below(*old), *new, *old));
        let share = (N::of(CHANGES) * scales.tolerances(group, pace)[0]) * larger / smaller;
        N::choose(larger.at_most(N::of(0.0)), N::of(0.0), share)
    };
    let shares: Vec<N> = old.iter().zip(new).enumerate().map(share).collect();
    N::of(0.0).below(pace.lasts) & !largest(&shares).at_most(N::of(1.0))
}

/// The pace after an attempt, and whether the state goes on. `counts` are the numbers of groups of v and y.
pub(crate) fn judge<N: Number>(
    pace: &Pace<N>,
    scales: &Scales<N>,
    order: u32,
    counts: [usize; 2],
    made: &Made<N>,
    outlook: Outlook<N>,
) -> (Pace<N>, Scales<N>, N::Truth) {
    let zero = N::of(0.0);
    let (least, bound) = pace.tolerated(scales, outlook.step, counts, made);
    let error = made.errors.first().map_or(&[][..], Vec::as_slice);
    let rounded = pace.rounded(scales, outlook.step);
    let is_rounding: Vec<N::Truth> =
        error.iter().zip(&rounded).map(|(e, rounded)| zero.below(*rounded) & e.at_most(*rounded)).collect();
    let beyond = |errors: &[N]| -> Vec<N> { errors.iter().zip(&is_rounding).map(|(e, is)| N::choose(*is, zero, *e)).collect() };
    let mut r = over(&beyond(error), &bound);
    if let Some(coarse) = made.errors.get(1) {
        let size: Vec<N> = made.old.iter().zip(&made.new).map(|(old, new)| longer(*old, *new)).collect();
        let coarse = beyond(coarse);
        let (second, share) = (over(&coarse, &bound), over(&coarse, &size));
        let other = second / r;
        let by_chance = N::of(CHANCE).below(other) & N::of(WILD).below(share);
        if order > LOW {
            // Where rates jump, the finer estimate may be next to nothing by chance: it is corrected only where both are as of
            // smooth rates.
            let smooth = (other * other * share).below(N::of(SMOOTH * SMOOTH));
            r = N::choose(zero.below(r) & smooth, r / (N::of(1.0) + N::of(0.01) * (other * other)).sqrt(), r);
        }
        r = N::choose(by_chance, second, r);
    }
    // Sizes that overflow would tolerate any error, so they count as not finite; and so does a stage that only the estimate sees.
    let all = total(&made.new) + total(error);
    r = N::choose(all.below(N::of(f64::INFINITY)), r, N::of(f64::INFINITY));
    for number in &made.positive {
        r = N::choose(number.below(zero), longer(r, N::of(OUTSIDE)), r);
    }
    let rests = (total(error) + total(&made.moved)).at_most(zero);
    let (next, longest, took) = pace.decided(order > LOW, (r, rests), (&scales.longest, &least), outlook);
    let (noise, failed) = pace.heard(&next, scales, outlook.step, (error, &bound), made);
    (next, Scales { longest, noise, failed, ..scales.clone() }, took)
}

/// The largest error of a group over what is tolerated. A group that is zero, as it has always been, tolerates no error and has
/// none.
pub(crate) fn over<N: Number>(error: &[N], bound: &[N]) -> N {
    let zero = N::of(0.0);
    let shares = error.iter().zip(bound).map(|(error, bound)| N::choose(error.at_most(zero), zero, *error / *bound));
    shares.reduce(longer).unwrap_or(zero)
}

impl<N: Number> Pace<N> {
    /// Of each group the size that it has at least after the step, and the error that is tolerated. `counts` are how many groups
    /// v and y have; of what was made the sizes before and after the step count.
    fn tolerated(&self, scales: &Scales<N>, step: N, counts: [usize; 2], made: &Made<N>) -> (Vec<N>, Vec<N>) {
        let (zero, old, new) = (N::of(0.0), &made.old, &made.new);
        // A state at zero so far on which a force sets in counts as long as that force would have made it in a part of the time
        // since.
        let since = longer(N::of(1.0), N::of(PUSHED) * ((self.t + step - self.begin) / step));
        let rested = total(&scales.longest).at_most(zero);
        let (mut lasting, mut least) = (Vec::new(), Vec::new());
        let of_v = counts[0];
        for block in [0..of_v, of_v..of_v + counts[1]] {
            let (longest, after) = (&scales.longest[block.clone()], &new[block]);
            if let ([size], [now]) = (longest, after) {
                lasting.push(N::choose(rested, *now * since, N::of(LEAST_PART) * *size));
                least.push(*now);
            } else if !after.is_empty() {
                let onset = N::of(ONSET) * longer(largest(longest), largest(after));
                for (size, now) in longest.iter().zip(after) {
                    let been = zero.below(*size);
                    lasting.push(N::choose(been, N::of(LEAST_PART) * *size, N::choose(rested, *now * since, onset)));
                    least.push(N::choose(been | rested | onset.below(*now), *now, zero));
                }
            }
        }
        if counts[0] > 0 && counts[1] > 0 {
            let lost = N::of(made.rounding) / step;
            for (size, of_y) in lasting.iter_mut().zip(paired(&scales.longest[of_v..], of_v)) {
                *size = longer(*size, of_y * lost);
            }
        }
        let bound = |group: usize| {
            let size = longer(longer(N::choose(zero.below(self.lasts), lasting[group], zero), old[group]), new[group]);
            let [relative, absolute] = scales.tolerances(group, self);
            absolute + relative * size
        };
        let bound = (0..new.len()).map(bound).collect();
        (least, bound)
    }

    /// Of each group the error that is rounding.
    fn rounded(&self, scales: &Scales<N>, step: N) -> Vec<N> {
        let of_group = |(group, noise): (usize, &N)| {
            let (noise, most) = (*noise * step, scales.tolerances(group, self)[0] * scales.longest[group]);
            longer(N::choose(most.below(noise), most, noise), N::of(0.0))
        };
        scales.noise.iter().enumerate().map(of_group).collect()
    }

    /// The estimates of rounding after an attempt: [`Scales::noise`] and [`Scales::failed`].
    fn heard(
        &self,
        next: &Pace<N>,
        scales: &Scales<N>,
        step: N,
        (error, bound): (&[N], &[N]),
        made: &Made<N>,
    ) -> (Vec<N>, Vec<N>) {
        let zero = N::of(0.0);
        let (takes, fails) = (self.accepted.below(next.accepted), self.rejected.below(next.rejected));
        let (per_power, per_time, alike) = (N::of(1.0) / (step * step.sqrt()), N::of(ROUNDED) / step, N::of(ALIKE) * step);
        let small = N::of(if made.has_mass { 1.0 } else { ROUNDINGS * made.rounding });
        let of_group = |group: usize| {
            let (noise, failed, error, moved) = (scales.noise[group], scales.failed[group], error[group], made.moved[group]);
            let [relative, _] = scales.tolerances(group, self);
            let most = relative * scales.longest[group];
            let offends = bound[group].below(error) & error.at_most(most) & zero.below(self.lasts);
            let share = error * per_power;
            let is_small = error.at_most(small * scales.longest[group]);
            let is_slow = moved.at_most(N::of(SLOW) * relative.sqrt().sqrt() * made.old[group]);
            let is_pushed = (N::of(PUSHES) * made.old[group]).below(moved);
            let falls_slowly = zero.below(failed) & failed.at_most(share) & ((is_slow & is_small) | is_pushed);
            let is_rounding = falls_slowly | (error.at_most(alike * noise) & is_small);
            let next_failed = N::choose(moved.at_most(N::of(UNLIKE) * error), failed, zero);
            let next_noise = N::choose(is_rounding, error * per_time, N::of(FADES) * noise);
            let holds_down = N::of(HOLDS_DOWN) * bound[group];
            let stands = (N::of(UNLIKE) * moved).at_most(error) & holds_down.below(error) & zero.below(self.lasts);
            let (most_known, seen) = (longer(noise, bound[group] * per_time), error * per_time);
            let known = longer(N::of(FADES) * noise, N::choose(most_known.below(seen), most_known, seen));
            let taken = N::choose(stands, known, N::of(FADES) * noise);
            let offends = fails & offends;
            let next_noise = N::choose(offends, next_noise, N::choose(takes, taken, noise));
            (next_noise, N::choose(offends, longer(share, failed), N::choose(takes, next_failed, failed)))
        };
        (0..error.len()).map(of_group).unzip()
    }

    /// The pace after an attempt with this error, the largest sizes so far, and whether the state goes on. `high`: the estimate
    /// is of a high order; `rests`: nothing moved; `longest` and `new` are the largest sizes before, and those that the groups
    /// would have.
    fn decided(
        &self,
        high: bool,
        (r, rests): (N, N::Truth),
        (longest, new): (&[N], &[N]),
        outlook: Outlook<N>,
    ) -> (Pace<N>, Vec<N>, N::Truth) {
        let number = N::of;
        let Outlook { step, is_extra, ends, runs } = outlook;
        let good = r.at_most(number(1.0)); // NaN is not
        let floored = N::choose(number(TINY).below(r), r, number(TINY));
        let r8 = floored.sqrt().sqrt().sqrt(); // the eighth root of r
        let r16 = r8.sqrt();
        let r32 = r16.sqrt();
        let factor = number(SAFETY) / (if high { r16 } else { r8 } * r32);
        let factor = N::choose(good, factor * self.before, factor);
        let factor = N::choose(number(MIN_FACTOR).below(factor), factor, number(MIN_FACTOR));
        let ceiling = N::choose(good, self.most, number(1.0));
        let factor = N::choose(factor.below(ceiling), factor, ceiling);
        let factor = N::choose(r.below(number(f64::INFINITY)), factor, number(MIN_FACTOR));
        let reached = N::choose(ends, self.wall, self.t + step);
        let passes = self.target.below(reached);
        let (takes, holds, fails) = (runs & good & !passes, runs & good & passes, (runs | is_extra) & !good);
        let decides = takes | fails;
        let (root, calm) = if high { (r32, CALM_ROOTS[1]) } else { (r16, CALM_ROOTS[0]) };
        let root = N::choose(number(calm).below(root), root, number(calm));
        let count = |truth: N::Truth| N::choose(truth, number(1.0), number(0.0));
        let t = N::choose(takes, reached, self.t);
        let grown = N::choose(takes & ends, self.h, step * factor);
        let quiet = longer(step, number(QUIET) * (reached - self.begin));
        let grown = self.shortened(N::choose(takes & rests & quiet.below(grown), quiet, grown), t);
        let next = Pace {
            t,
            h: N::choose(decides, grown, self.h),
            extra: N::choose(is_extra, number(0.0), self.extra),
            held: N::choose(holds, number(1.0), N::choose(fails, number(0.0), self.held)),
            before: N::choose(takes, root, self.before),
            most: N::choose(decides, N::choose(good, number(MAX_FACTOR), number(1.0)), self.most),
            accepted: self.accepted + count(takes),
            rejected: self.rejected + count(fails),
            extra_steps: self.extra_steps + count(holds | (is_extra & good)),
            error: N::choose(decides, r, self.error),
            ..*self
        };
        let grows = longest.iter().zip(new).map(|(so_far, new)| N::choose(takes & so_far.below(*new), *new, *so_far));
        (next, grows.collect(), takes | (is_extra & good))
    }
}

/// A system whose time runs backward: it is scaled to a step of −1, and the time is that of the run, negated.
pub(crate) struct Backward<N: Number>(pub Box<dyn System<N>>);

impl<N: Number> System<N> for Backward<N> {
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.0.dv(-t, v, y)
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.0.dy(-t, v, y)
    }

    fn mass(&self) -> Option<&Mass> {
        self.0.mass()
    }

    fn project(&self, v: Block<N>, y: Block<N>) -> (Block<N>, Block<N>) {
        self.0.project(v, y)
    }

    fn tally(&self) -> Option<N> {
        self.0.tally().map(|work| -work)
    }
}

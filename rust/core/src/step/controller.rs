//! The time of a member and the state of its step-size controller.

use super::sizes::longer;
use crate::tape::number::Number;

/// Bounds of the new step over the old one.
pub(crate) const MIN_FACTOR: f64 = 0.2;
pub(crate) const MAX_FACTOR: f64 = 5.0;
/// See `runs/engine/adaptive.py`.
const BLIND: f64 = 1.0 / (1u64 << 20) as f64;
/// The first step, and one after a jump, is at least this part of the time: 2¹² roundings.
pub(crate) const MOVES: f64 = 1.0 / (1u64 << 40) as f64;

/// The structure and its numbers, in one order that is written once.
macro_rules! numbers {
    ($(#[$about:meta])* pub struct $name:ident { $($(#[$of:meta])* $number:ident,)* }) => {
        const NUMBERS: usize = [$(stringify!($number)),*].len();

        $(#[$about])*
        #[derive(Clone, Copy, Debug)]
        pub struct $name<N> {
            $($(#[$of])* pub $number: N,)*
        }

        impl<N: Copy> $name<N> {
            /// From its numbers.
            pub fn of([$($number),*]: [N; NUMBERS]) -> Self {
                $name { $($number),* }
            }

            /// Its numbers.
            pub fn numbers(&self) -> [N; NUMBERS] {
                [$(self.$number),*]
            }
        }
    };
}

numbers! {
    /// The time of a member and the state of its step-size controller. Steps do not depend on the saved times: a step that
    /// passes the next of them is held, not taken, until the states within it are saved, by the continuous extension of the
    /// method. The last of them, and all where there is no extension, are made by extra steps from the start of the held one. An
    /// extra step whose error is not tolerated shows that the held one missed something: that one is then rejected.
    pub struct Pace {
        /// Its time.
        t,
        /// The step that it will try next.
        h,
        /// The next output time.
        target,
        /// Above zero: the length of the extra step that comes next, to a saved time.
        extra,
        /// 1 if the next step is held: it was accepted, but passes the target.
        held,
        /// Tolerated error of a step, relative to the size of a group of components.
        relative,
        /// Tolerated error in addition to the relative one.
        absolute,
        /// 1 if errors are relative to the largest size of a group so far, 0 if they are relative to its present size.
        lasts,
        /// The time of the start.
        begin,
        /// The longest step while inputs change from sample to sample: it skips no sample.
        interval,
        /// The time until which inputs change from sample to sample.
        until,
        /// The longest step.
        most_step,
        /// The time that no step crosses, just before the next jump.
        wall,
        /// The sixteenth root of the last accepted error, or its thirty-second.
        before,
        /// How much the next step may grow.
        most,
        /// Accepted attempts.
        accepted,
        /// Rejected attempts.
        rejected,
        /// Steps for saved states: the extra ones, and those that were held and are made once more or extended.
        extra_steps,
        /// The last error over the tolerance.
        error,
        /// The energy that a control or projection added in accepted steps; for a control the sum over their evaluations.
        work,
    }
}

/// How long a step is that ends at the wall if it would cross it.
pub(crate) fn length(t: f64, h: f64, wall: f64) -> f64 {
    if wall < t + h { wall - t } else { h }
}

/// Where a step ends that does not cross the wall.
pub(crate) fn reach(t: f64, h: f64, wall: f64) -> f64 {
    if wall < t + h { wall } else { t + h }
}

/// The next attempt.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outlook<N: Number> {
    /// How long the step is.
    pub step: N,
    /// Whether it is an extra one.
    pub is_extra: N::Truth,
    /// Whether it ends at the wall.
    pub ends: N::Truth,
    /// Whether it is a step of the run: not at the target, not held, not out of attempts, and the time moves.
    pub runs: N::Truth,
}

impl Pace<usize> {
    /// The places of its numbers, which come after `others` other numbers.
    pub(crate) fn places(others: usize) -> Self {
        Pace::of(std::array::from_fn(|i| others + i))
    }
}

impl Pace<f64> {
    /// Whether there is a step of the run to try.
    pub(crate) fn runs(&self, budget: f64) -> bool {
        self.outlook(budget).runs
    }

    /// As `runs`, for many members, from rows of their numbers: moves nothing unneeded, for it is called after every attempt.
    pub(crate) fn find_running<'a>(row: impl Fn(usize) -> &'a [f64], budget: f64, runs: &mut [bool]) {
        let places = Pace::of(std::array::from_fn(|i| i as f64));
        let row = |place: f64| row(place as usize);
        let (t, h, target, wall, held) = (row(places.t), row(places.h), row(places.target), row(places.wall), row(places.held));
        let (extra, accepted, rejected) = (row(places.extra), row(places.accepted), row(places.rejected));
        let times = t.iter().zip(h).zip(target.iter().zip(wall));
        let counts = held.iter().zip(extra).zip(accepted.iter().zip(rejected));
        for (runs, (((t, h), (target, wall)), ((held, extra), (accepted, rejected)))) in runs.iter_mut().zip(times.zip(counts)) {
            let moves = (*t < *target) & (*t < *wall) & (*t < *t + *h);
            *runs = moves & (*accepted + *rejected < budget) & (*held <= 0.0) & (*extra <= 0.0);
        }
    }

    /// How many steps of the present length are left to the next output times, in the mean of those members that are not there.
    pub(crate) fn steps_left<'a>(row: impl Fn(usize) -> &'a [f64]) -> f64 {
        let places = Pace::of(std::array::from_fn(|i| i as f64));
        let [t, h, target] = [places.t, places.h, places.target].map(|place| row(place as usize));
        let left = t.iter().zip(h).zip(target).filter(|((t, _), target)| t < target).map(|((t, h), target)| (target - t) / h);
        let (count, sum) = left.fold((0.0, 0.0), |(n, sum), left| (n + 1.0, sum + left));
        if count > 0.0 { sum / count } else { 0.0 }
    }

    /// Whether the next output time is within the held step.
    pub(crate) fn holds(&self) -> bool {
        self.held > 0.0 && self.target < self.reach().0
    }

    /// Where a member goes on that has come to a wall: from a time just after the jump, to the next wall, with a step that is
    /// chosen anew. A series chooses its step by itself.
    #[must_use]
    pub(crate) fn crossed(self, after: f64, wall: f64, series: bool) -> Self {
        let (least, first) = (MOVES * after.abs(), MIN_FACTOR * self.h);
        let h = if series { self.h } else { longer(first, least) };
        let before = if series { MIN_FACTOR * self.before } else { 1.0 };
        Pace { t: after, wall, h, before, most: MAX_FACTOR, ..self }
    }

    /// Where a member begins again at its time, with a first step that is to be chosen: see `begun_again` in
    /// `runs/engine/adaptive.py`.
    #[must_use]
    pub(crate) fn again(self) -> Self {
        let (t, wall, none) = (self.t, f64::INFINITY, 0.0);
        Pace { h: -BLIND, target: t, extra: none, held: none, begin: t, wall, before: 1.0, most: MAX_FACTOR, ..self }
    }

    /// The pace of a lane where nothing runs.
    #[must_use]
    pub(crate) fn idle(self) -> Self {
        Pace { target: self.t, extra: 0.0, held: 0.0, ..self }
    }
}

impl<N: Number> Pace<N> {
    /// How many numbers it has.
    pub const NUMBERS: usize = NUMBERS;
    /// Places of the time and of the step to try next among them.
    pub(crate) const PLACES: [usize; 2] = [0, 1];
    /// The place of the number of accepted attempts.
    pub const ACCEPTED: usize = 15;

    /// Where the next step ends, and whether that is at the wall.
    pub(crate) fn reach(&self) -> (N, N::Truth) {
        let ends = self.wall.below(self.t + self.h);
        (N::choose(ends, self.wall, self.t + self.h), ends)
    }

    /// The next step.
    pub(crate) fn outlook(&self, budget: N) -> Outlook<N> {
        let zero = N::of(0.0);
        let is_extra = zero.below(self.extra);
        let ends = self.reach().1;
        let moves = self.t.below(self.t + self.h);
        let left = (self.accepted + self.rejected).below(budget);
        let waits = self.t.below(self.target) & self.t.below(self.wall);
        let runs = waits & moves & left & self.held.at_most(zero) & !is_extra;
        let step = N::choose(is_extra, self.extra, N::choose(ends, self.wall - self.t, self.h));
        Outlook { step, is_extra, ends, runs }
    }

    /// A step from t, no longer than is allowed there.
    pub(crate) fn shortened(&self, h: N, t: N) -> N {
        let most = N::choose(t.below(self.until) & self.interval.below(self.most_step), self.interval, self.most_step);
        N::choose(most.below(h), most, h)
    }
}

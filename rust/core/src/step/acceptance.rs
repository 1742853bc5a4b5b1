//! The conditions for a step to be accepted: sizes of groups of components, and their tolerances.

use super::{controller::Pace, sizes::absolute};
use crate::tape::number::Number;

/// The conditions for a step to be accepted.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Acceptance {
    /// For each number of v, then of y, the group to which it belongs, counted from 0 without gaps, those of v first. The error
    /// of a group is the length of its numbers. Numbers of none are carried along: steps do not depend on them. Empty if v is
    /// one group and y is another.
    pub groups: Vec<Option<u32>>,
    /// Whether each group has tolerances of its own.
    pub own: bool,
    /// Numbers of v, then of y, by their places, that must not become negative.
    pub positive: Vec<u32>,
    /// Whether what rounding leaves out of each number of the state is kept, for the next step to add.
    pub compensated: bool,
}

impl Acceptance {
    /// The numbers of groups of v and y, which have `v` and `y` numbers.
    pub(crate) fn counts(&self, v: usize, y: usize) -> [usize; 2] {
        if self.groups.is_empty() {
            return [v, y].map(|numbers| usize::from(numbers > 0));
        }
        let counted = |groups: &[Option<u32>]| groups.iter().flatten().max().map_or(0, |last| *last as usize + 1);
        let of_v = counted(self.groups.get(..v).unwrap_or_default());
        [of_v, counted(&self.groups) - of_v]
    }

    /// How many numbers stand behind those of the pace: `Scales`.
    pub fn numbers(&self, v: usize, y: usize) -> usize {
        let [of_v, of_y] = self.counts(v, y);
        (of_v + of_y) * if self.own { 5 } else { 3 } + if self.compensated { v + y } else { 0 }
    }

    /// The size of each group of components: of one number its absolute value, of several their length.
    pub(crate) fn sizes<N: Number>(&self, v: &[N], y: &[N]) -> Vec<N> {
        if self.groups.is_empty() {
            return [v, y].into_iter().filter(|block| !block.is_empty()).map(|block| length(block.iter())).collect();
        }
        let [of_v, of_y] = self.counts(v.len(), y.len());
        let mut members = vec![Vec::new(); of_v + of_y];
        for (group, number) in self.groups.iter().zip(v.iter().chain(y)) {
            if let Some(group) = group {
                members[*group as usize].push(number);
            }
        }
        members.into_iter().map(|numbers| length(numbers.into_iter())).collect()
    }
}

/// The length of some numbers; of one number its absolute value.
fn length<'a, N: Number>(mut numbers: impl ExactSizeIterator<Item = &'a N>) -> N {
    match numbers.len() {
        1 => numbers.next().map_or_else(|| N::of(0.0), |number| absolute(*number)),
        _ => numbers.fold(N::of(0.0), |total, number| total + *number * *number).sqrt(),
    }
}

/// Sizes of the groups of components, and what is tolerated of them. They stand behind the pace, in this order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scales<N> {
    /// The largest size so far of each group.
    pub longest: Vec<N>,
    /// The error per unit of time by the rounding of each group's rates, as far as it is known: see [`Pace::heard`].
    pub noise: Vec<N>,
    /// Of each group the error of steps that failed by it over the power 3/2 of their length, the largest; or zero.
    pub failed: Vec<N>,
    /// Tolerances of their own: the relative one of each group, then the absolute one of each; empty if there are none.
    pub own: Vec<N>,
    /// The part of each number of v, then of y, that rounding left out of the state, where the method keeps it; else empty.
    pub low: Vec<N>,
}

impl<N: Number> Scales<N> {
    /// Reads the scales from their numbers, for a state of `state` numbers.
    pub(crate) fn of(numbers: &[N], acceptance: &Acceptance, state: usize) -> Self {
        let (numbers, low) = numbers.split_at(numbers.len() - if acceptance.compensated { state } else { 0 });
        let groups = numbers.len() / if acceptance.own { 5 } else { 3 };
        let (longest, rest) = numbers.split_at(groups);
        let (noise, rest) = rest.split_at(groups);
        let (failed, own) = rest.split_at(groups);
        let [longest, noise, failed, own, low] = [longest, noise, failed, own, low].map(<[N]>::to_vec);
        Scales { longest, noise, failed, own, low }
    }

    /// Its numbers.
    pub(crate) fn numbers(&self) -> Vec<N> {
        [&self.longest[..], &self.noise[..], &self.failed[..], &self.own[..], &self.low[..]].concat()
    }

    /// The relative and the absolute tolerance of a group.
    pub(crate) fn tolerances(&self, group: usize, pace: &Pace<N>) -> [N; 2] {
        match self.own.get(group).zip(self.own.get(self.longest.len() + group)) {
            Some((relative, absolute)) => [*relative, *absolute],
            None => [pace.relative, pace.absolute],
        }
    }
}

//! Groups: a handful of members stepped together, whatever they are made of.

use crate::{error::Error, isa::Level};

/// The numbers of one parameter or input, for every member.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a>(pub &'a [f64]);

impl Row<'_> {
    /// The value for a member; a row of length one serves all.
    pub fn at(&self, member: usize) -> f64 {
        match self.0 {
            [one] => *one,
            many => many.get(member).copied().unwrap_or(f64::NAN),
        }
    }

    /// The values for the members from `first`; what is past the `count`-th repeats the last.
    pub fn fill(&self, first: usize, count: usize, lanes: &mut [f64]) {
        match self.0 {
            [one] => lanes.fill(*one),
            many => {
                lanes[..count].copy_from_slice(&many[first..first + count]);
                lanes[count..].fill(many[first + count - 1]);
            }
        }
    }
}

/// A sampled input: `samples[i]` holds from `start + i·interval` until the next sample.
#[derive(Clone, Debug)]
pub struct Table<'a> {
    /// One row per sample.
    pub samples: Vec<Row<'a>>,
    /// Time of the first sample.
    pub start: f64,
    /// Time from one sample to the next.
    pub interval: f64,
}

/// Which system, with which parameters.
#[derive(Clone, Debug, Default)]
pub struct Spec<'a> {
    /// The system's name: its file in `systems/`.
    pub system: &'a str,
    /// Which of its variants; each system documents its own.
    pub options: Vec<&'a str>,
    /// Its sizes, if they are chosen at run time; each system documents its own.
    pub sizes: Vec<usize>,
    /// Its parameters, in the order that the system documents.
    pub rows: Vec<Row<'a>>,
    /// Its sampled inputs, in the order in which the options name them.
    pub tables: Vec<Table<'a>>,
    /// Quantities to record beside the states; each system documents its own.
    pub record: Vec<&'a str>,
}

impl Spec<'_> {
    /// The value of parameter `i` for a member; a parameter that is not there is zero.
    pub fn at(&self, i: usize, member: usize) -> f64 {
        self.rows.get(i).map_or(0.0, |row| row.at(member))
    }

    /// Size `i`; one that is not there is zero.
    pub fn size(&self, i: usize) -> usize {
        self.sizes.get(i).copied().unwrap_or(0)
    }

    /// Whether an option is given.
    pub fn has(&self, option: &str) -> bool {
        self.options.contains(&option)
    }

    /// The error for options that the system does not know.
    pub fn unknown_options(&self) -> Error {
        Error::Options { system: self.system.to_owned(), options: self.options.join(" ") }
    }
}

/// Time and step: t = `t0` + k·`h` at step k, never accumulated.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Time of step 0.
    pub t0: f64,
    /// The step.
    pub h: f64,
    /// Which of the method's starts.
    pub start: usize,
    /// What the hot loop may use.
    pub level: Level,
    /// How many threads one force of one large system may use; zero for as many as there are.
    pub threads: usize,
}

impl Clock {
    /// The time of step `k`.
    #[inline(always)]
    pub fn at(&self, k: i64) -> f64 {
        self.t0 + k as f64 * self.h
    }
}

/// How many members to expect: a wide group has the throughput, a narrow one the latency. The other two step at a pace of their
/// own and not otherwise; a group that cannot do that may be anything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// As many lanes as the level's registers hold.
    Wide,
    /// A few lanes, for a few members.
    Narrow,
    /// Lanes that go at a pace of their own each.
    Paced,
    /// One member at a pace of its own.
    Lone,
}

/// Lanes of a narrow group. One vector of AVX-512, two of AVX2: a step takes as long as for a single member.
pub const NARROW: usize = 8;

/// A handful of members stepped together.
///
/// `v` and `y` are rows of [`Group::lanes`] numbers, one row per number of a member's block. The `v` slot holds what the
/// method carries between steps, which is the velocity for all but the methods that say otherwise in their record.
pub trait Group: Send + Sync {
    /// How many members it steps together.
    fn lanes(&self) -> usize;

    /// Whether this narrow group, one run of it after another, is better for so few members than one of so many lanes.
    fn pays_for(&self, members: usize, _lanes: usize) -> bool {
        members <= NARROW
    }

    /// Takes the parameters of the members from `first`; lanes past the `count`-th repeat the last member.
    fn prepare(&mut self, spec: &Spec, first: usize, count: usize);

    /// Both slots.
    fn slots(&self) -> (&[f64], &[f64]);

    /// Both slots, to write.
    fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]);

    /// Turns velocities in the `v` slot into what the method carries, at step `k`.
    fn start(&mut self, k: i64);

    /// `n` steps from step `k`.
    fn advance(&mut self, k: i64, n: i64);

    /// Turns what the method carries into velocities, at step `k`: the inverse of `start`.
    fn finish(&mut self, k: i64);

    /// Whether its lanes can go at a pace of their own, scaled to a step of 1.
    fn adapts(&self) -> bool {
        false
    }

    /// Takes the parameters of a member into one lane.
    fn prepare_lane(&mut self, _spec: &Spec, _lane: usize, _member: usize) {}

    /// So many attempts of every lane that runs; `paces` are rows of lanes.
    fn adapt(&mut self, _paces: &mut [f64], _budget: f64, _attempts: u32) {}

    /// How many numbers of a member it records.
    fn recorded(&self) -> usize {
        0
    }

    /// Records the present state, whose v slot is finished: rows of lanes.
    fn record(&mut self, _rows: &mut [f64]) {}

    /// What the system adds up over the steps, a row of lanes or nothing.
    fn tally(&self) -> &[f64] {
        &[]
    }

    /// What the system adds up, to write.
    fn tally_mut(&mut self) -> &mut [f64] {
        &mut []
    }
}

//! Packing: equal operations within one member become the lanes of one vector.
//!
//! A single member is stepped number by number, though much of a step is the same operation several times: the coordinates of a
//! body, the pairs of three bodies. Their roots and quotients wait for one unit of the CPU, which takes as long for one number as
//! for a vector of four (Zen 4) or half as long (Intel). So a pass over the body finds operations of the same kind that do not
//! depend on each other (`find`), puts them into vectors of two or four numbers, and moves numbers between lanes where an
//! operation needs them elsewhere (`lower`). No lane does anything but the operations of the body: the bits are the same.
//!
//! Whether that is faster depends on the step. A short one is a chain of operations that wait for each other, and moving numbers
//! makes it longer. So several packings are tried, and a model of the CPU (`estimate`) tells how many cycles a step takes with
//! each; one is used if it gains by `LEAST_GAIN`.

pub(super) mod estimate;
mod find;
mod lower;
mod packed;
mod planned;
mod sound;

pub use self::packed::{MOST_LANES, Make, Move, Packed, StateVector, Trial, Vector};
use crate::tape::split::Body;

/// A packing must save this share of the cycles of a step: the model is not exact.
const LEAST_GAIN: f64 = 0.04;
/// Steps of fewer operations are not packed.
const FEWEST_OPERATIONS: usize = 8;
/// In longer steps less is tried, so that it does not take long, and nothing is made a second time: there are enough operations
/// that do not wait for what is moved.
const LONG_STEP_OPERATIONS: usize = 600;
/// In steps of more operations, such as those of a series, only the widest vectors are tried: each trial takes as long as
/// thousands of steps.
const VERY_LONG_STEP_OPERATIONS: usize = 5000;
/// Longer steps are not packed: it would take seconds. No step of one tape is longer: its operations are
/// estimated to be at most 100 000, and may be twice as many.
const MOST_OPERATIONS: usize = 250_000;

/// The trials: how many successive numbers of the state, and how many roots, one vector makes.
const TRIALS: [(usize, usize); 6] = [(1, 4), (2, 4), (3, 4), (4, 4), (1, 2), (2, 2)];

/// The effect of packing on a step, and the reason to pack or not: cycles of a step by the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// Cycles number by number.
    pub single: f64,
    /// Cycles with the best packing; None if none was found.
    pub packed: Option<f64>,
    /// Cycles of the longest chain of operations, if there were units for all: no packing is faster.
    pub chain: f64,
    /// Operations of a step.
    pub operations: usize,
    /// Vectors that are made in their place, with those that move numbers between lanes.
    pub vectors: usize,
    /// How many of the vectors move numbers.
    pub moves: usize,
}

impl Verdict {
    /// Whether it is worth it.
    pub fn gains(&self) -> bool {
        self.packed.is_some_and(|packed| packed <= (1.0 - LEAST_GAIN) * self.single)
    }
}

/// The best packing of a body and the model's verdict. None for the packing if no operations are alike or the step is a
/// chain already; None at all if the step is too short or too long to be packed.
pub fn best(body: &Body) -> Option<(Verdict, Option<Packed>)> {
    let operations = body.work();
    if !(FEWEST_OPERATIONS..=MOST_OPERATIONS).contains(&operations) {
        return None;
    }
    let alone = lower::lower(body, &find::Packs::none(body), false)?;
    let (single, chain) = (estimate::cycles(&alone, true), estimate::cycles(&alone, false));
    let mut verdict = Verdict { single, packed: None, chain, operations, vectors: operations, moves: 0 };
    if single <= chain / (1.0 - LEAST_GAIN) {
        return Some((verdict, None));
    }
    let mut best: Option<(Trial, Packed)> = None;
    let mut attempt = |trial: Trial, best: &mut Option<(Trial, Packed)>| {
        let Some(packed) = pack(body, trial) else { return };
        let cycles = estimate::cycles(&packed, true);
        if verdict.packed.is_none_or(|least| cycles < least) {
            let made = packed.vectors.iter().filter(|vector| matches!(vector.make, Make::Op(_) | Make::Move(_)));
            let moves = packed.vectors.iter().filter(|vector| matches!(vector.make, Make::Move(_))).count();
            verdict = Verdict { packed: Some(cycles), vectors: made.count(), moves, ..verdict };
            *best = Some((trial, packed));
        }
    };
    let trials = match operations {
        _ if operations > VERY_LONG_STEP_OPERATIONS => &TRIALS[2..4],
        _ if operations > LONG_STEP_OPERATIONS => &TRIALS[..4],
        _ => &TRIALS[..],
    };
    for &(together, roots) in trials {
        attempt(Trial { together, roots, again: false }, &mut best);
    }
    if let Some((trial, _)) = best.as_ref().filter(|_| operations <= LONG_STEP_OPERATIONS) {
        attempt(Trial { again: true, ..*trial }, &mut best);
    }
    Some((verdict, best.map(|(_, packed)| packed)))
}

/// A body packed in one way; None if there is nothing to pack.
pub fn pack(body: &Body, trial: Trial) -> Option<Packed> {
    let packs = find::Packs::find(body, trial);
    if packs.is_empty() { None } else { lower::lower(body, &packs, trial.again) }
}

//! Packing: equal operations within one member become the lanes of one vector.
//!
//! A single member is stepped number by number, though much of a step is the same operation several times: the coordinates of a body, the
//! pairs of three bodies. Their roots and quotients wait for one unit of the CPU, which takes as long for one number as for a vector of
//! four (Zen 4) or half as long (Intel). So a pass over the body finds operations of the same kind that do not depend on each other
//! ([`find`]), puts them into vectors of two or four numbers, and moves numbers between lanes where an operation needs them elsewhere
//! ([`lower`]). No lane does anything but the operations of the body: the bits are the same.
//!
//! Whether that is faster depends on the step. A short one is a chain of operations that wait for each other, and moving numbers makes it
//! longer. So several packings are tried, and a model of the CPU ([`estimate`]) tells how many cycles a step takes with each; one is used
//! if it gains by [`LEAST_GAIN`].

mod estimate;
mod find;
mod lower;
mod planned;
mod sound;

use crate::tape::{Id, Op, split::Body};

/// The most lanes of a vector. Eight would be possible with AVX-512; a step of one member seldom has as many equal operations.
pub const MOST_LANES: usize = 4;
/// A packing must save this share of the cycles of a step: the model is not exact.
const LEAST_GAIN: f64 = 0.04;
/// Steps of fewer operations are not looked at.
const FEWEST_OPERATIONS: usize = 8;
/// In longer steps less is tried, so that it does not take long, and nothing is made a second time: there are enough operations that do not
/// wait for what is moved.
const LONG_STEP_OPERATIONS: usize = 600;
/// Steps longer than that are not looked at: it would take some 50 ms. They are seldom a single tape.
const MOST_OPERATIONS: usize = 5000;

/// What is tried: how many successive numbers of the state are made by one vector, and how many roots.
const TRIALS: [(usize, usize); 6] = [(1, 4), (2, 4), (3, 4), (4, 4), (1, 2), (2, 2)];

/// How numbers of one member are moved between lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Move {
    /// A vector of two: a lane of the low half of the first, and one of the second. Bit 0 says which of the first, bit 1 of the second.
    Pick(u8),
    /// The high half of a vector of four.
    High,
    /// A vector of four: the low half of the first and of the second.
    Join,
    /// A vector of four from lanes of one: two bits for each.
    Permute(u8),
}

/// How a vector of one member's numbers comes about.
#[derive(Clone, Debug, PartialEq)]
pub enum Make {
    /// A vector of the state, by its place in [`Packed::state`].
    State(u32),
    /// Leaves of the body that do not change, one for each lane.
    Fixed(Vec<Op>),
    /// A leaf that changes from step to step: `PerStep` or `Held`.
    Now(Op),
    /// An operation in all lanes; its operands are those of [`Vector::of`].
    Op(Op),
    /// Numbers of other vectors.
    Move(Move),
}

/// A vector of one member's numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Vector {
    /// How it comes about.
    pub make: Make,
    /// 1, 2 or 4.
    pub width: u8,
    /// Vectors made before; as many as it needs.
    pub of: [u32; 3],
    /// How many these are.
    pub operands: u8,
    /// The operations of the body in the lanes; empty if it was moved.
    pub lanes: Vec<Id>,
}

impl Vector {
    /// What it reads.
    pub fn of(&self) -> &[u32] {
        &self.of[..self.operands as usize]
    }
}

/// A vector of numbers of the state.
#[derive(Clone, Debug, PartialEq)]
pub struct StateVector {
    /// Which numbers, lane by lane: 1 to 4.
    pub numbers: Vec<u32>,
    /// The vector that replaces it; no other one is replaced by it.
    pub next: u32,
    /// The vector of its old numbers.
    pub old: u32,
    /// Whether the numbers at the end of a run are taken from here. A number may be in several vectors, which have the same bits.
    pub is_first: bool,
}

/// A body whose operations are vectors of one member's numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packed {
    /// Each after those that it is made of.
    pub vectors: Vec<Vector>,
    /// The vectors of the state.
    pub state: Vec<StateVector>,
}

/// Which packing is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trial {
    /// Successive numbers of the state that are made by one vector; one for none.
    pub together: usize,
    /// Roots and quotients in one vector; one for none.
    pub roots: usize,
    /// Whether vectors that are needed in another order of their lanes are computed in that order, too, where they can be.
    pub again: bool,
}

/// What packing does for a step, and why it is done or not: cycles of a step as the model has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// Number by number.
    pub single: f64,
    /// With the best packing; None if none was found.
    pub packed: Option<f64>,
    /// Of an operation waiting for another, if there were units for all: no packing is faster.
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

/// The best packing of a body and what the model says of it. None for the packing if no operations are alike or the step is a chain
/// already; None at all if the step is too short or too long to be looked at.
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
    let trials = if operations > LONG_STEP_OPERATIONS { &TRIALS[..3] } else { &TRIALS };
    for &(together, roots) in trials {
        attempt(Trial { together, roots, again: false }, &mut best);
    }
    if let Some((trial, _)) = best.as_ref().filter(|_| operations <= LONG_STEP_OPERATIONS) {
        attempt(Trial { again: true, ..*trial }, &mut best);
    }
    Some((verdict, best.map(|(_, packed)| packed)))
}

/// Cycles of a step, as the model has them.
pub fn cycles(packed: &Packed) -> f64 {
    estimate::cycles(packed, true)
}

/// A body packed in one way; None if there is nothing to pack.
pub fn pack(body: &Body, trial: Trial) -> Option<Packed> {
    let packs = find::Packs::find(body, trial);
    if packs.is_empty() { None } else { lower::lower(body, &packs, trial.again) }
}

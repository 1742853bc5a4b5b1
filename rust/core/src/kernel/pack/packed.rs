//! A step whose operations are vectors of one member's numbers.

use crate::tape::{Id, Op};

/// The most lanes of a vector. Eight would be possible with AVX-512; a step of one member seldom has as many equal operations.
pub const MOST_LANES: usize = 4;

/// How numbers of one member are moved between lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Move {
    /// A vector of two: a lane of the low half of the first, and one of the second. Bit 0 says which of the first, bit 1 of the
    /// second.
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
    /// An operation in all lanes; its operands are those of `Vector::of`.
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
    /// The vectors that it reads.
    pub(crate) fn of(&self) -> &[u32] {
        &self.of[..self.operands as usize]
    }

    /// Whether it is there before the step.
    pub(crate) fn is_leaf(&self) -> bool {
        matches!(self.make, Make::State(_) | Make::Fixed(_) | Make::Now(_))
    }
}

/// A vector of numbers of the state.
#[derive(Clone, Debug, PartialEq)]
pub struct StateVector {
    /// The numbers of the state, lane by lane: 1 to 4.
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
    /// The vectors, each after those that it is made of.
    pub vectors: Vec<Vector>,
    /// The vectors of the state.
    pub state: Vec<StateVector>,
}

/// A packing to try.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trial {
    /// Successive numbers of the state that are made by one vector; one for none.
    pub together: usize,
    /// Roots and quotients in one vector; one for none.
    pub roots: usize,
    /// Whether vectors that are needed in another order of their lanes are computed in that order, too, where they can be.
    pub again: bool,
}

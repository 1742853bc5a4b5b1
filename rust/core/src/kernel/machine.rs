//! What a kernel writer needs to know of a CPU: its instructions, and how they are written.

use std::fmt::Debug;

use super::{
    pack::Move,
    plan::Step,
    shape::Shape,
    write::{Value, Writer},
};
use crate::tape::Op;

/// What the pointers of a kernel point to. Those to rows are advanced from block to block, the one to the table from step to step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// The rows of the state.
    State,
    /// The rows of the members.
    Rows,
    /// Numbers that are the same for all.
    Pool,
    /// The table of the steps.
    PerStep,
    /// Rows of sampled inputs.
    Held,
    /// What was spilled.
    Scratch,
}

/// A place in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    pub base: Base,
    /// So many bytes behind the base.
    pub at: i32,
    /// The entry of the table of the steps that says how many numbers further on it is.
    pub held: Option<u32>,
    /// One number for all lanes, and not a vector.
    pub one: bool,
}

impl Place {
    /// A vector at so many bytes behind a base.
    pub fn new(base: Base, at: i32) -> Place {
        Place { base, at, held: None, one: false }
    }
}

/// What is counted down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counter {
    Steps,
    Blocks,
}

/// Instructions of a CPU, and the bytes of those written so far.
pub trait Machine: Sized {
    /// An instruction, or a few that belong together.
    type Doing: Copy + Debug;

    /// The most operations of a kernel over all vectors of a block, so that its jumps reach.
    const MOST_OPERATIONS: usize;

    /// Whether the numbers of one member may be lanes of vectors.
    const PACKS: bool = false;

    /// Nothing written yet, room for about so many instructions.
    fn new(shape: Shape, instructions: usize) -> Self;

    /// The instruction of an operation. Changes of sign and choices are not asked for.
    fn doing(&self, op: Op) -> Self::Doing;

    /// A change of sign, and the bits of a constant that is its second operand, if it has one.
    fn negate(&self) -> (Self::Doing, Option<u64>);

    /// By the bits of the first, of the second and the third. Whether the first is surely a mask: all bits of a number or none.
    fn select(&self, is_mask: bool) -> Self::Doing;

    /// A comparison of the first two that chooses of the third and the fourth; None where that takes two instructions anyway.
    fn pick(&self, comparison: Op) -> Option<Self::Doing>;

    /// The lesser of two numbers, or the greater: `a` if a < b, or if a > b, and else `b`, as where one is a NaN. None where that takes more
    /// than one instruction.
    fn min_or_max(&self, _is_greater: bool) -> Option<Self::Doing> {
        None
    }

    /// What moves numbers of one member between lanes. Asked for only if it [packs](Machine::PACKS).
    fn moving(&self, _to: Move) -> Self::Doing {
        self.doing(Op::Copy(0))
    }

    /// What is written from here on is of vectors of so many numbers. Called only where numbers are moved between lanes.
    fn of_width(&mut self, _width: usize) {}

    /// Writes an operation for one vector, and returns where its result is. None if there are too few registers.
    fn make(writer: &mut Writer<Self>, step: &Step<Self::Doing>, vector: usize, of: &[Value]) -> Option<u8>;

    /// From memory to a register.
    fn load(&mut self, register: u8, from: Place);

    /// From a register to memory.
    fn store(&mut self, register: u8, to: Place);

    /// From register to register.
    fn copy(&mut self, to: u8, from: u8);

    /// The start of the function: keeps what belongs to the caller, sets how numbers are rounded, gets the pointers and the number of steps.
    fn enter(&mut self);

    /// The end of the function.
    fn leave(&mut self);

    /// The number of steps and the table of the steps from the start again.
    fn rewind(&mut self);

    /// Moves a pointer by so many bytes.
    fn advance(&mut self, base: Base, bytes: i32);

    /// Sets the number of blocks to go.
    fn count_blocks(&mut self, blocks: i32);

    /// What follows begins a line of the cache.
    fn align(&mut self);

    /// Where the next instruction will be, in bytes.
    fn here(&self) -> usize;

    /// Counts down, and jumps back unless that makes zero.
    fn count_down(&mut self, counter: Counter, to: usize);

    /// The bytes written; nothing is left.
    fn take_bytes(&mut self) -> Vec<u8>;
}

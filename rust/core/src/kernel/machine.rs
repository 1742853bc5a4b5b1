//! How the instructions of a CPU are written.

use super::{instruction_set::InstructionSet, shape::Shape};

/// Memory areas of a kernel, by their pointers. Pointers to rows are advanced from block to block, the one to the table from
/// step to step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Base {
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
    /// The spill area.
    Scratch,
}

/// A place in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    pub base: Base,
    /// Offset from the base, in bytes.
    pub at: i32,
    /// The entry of the table of the steps that says how many numbers further on it is.
    pub held: Option<u32>,
    /// One number for all lanes, and not a vector.
    pub one: bool,
}

impl Place {
    /// A vector `at` bytes behind a base.
    pub(crate) fn new(base: Base, at: i32) -> Place {
        Place { base, at, held: None, one: false }
    }
}

/// Loop counters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Counter {
    Steps,
    Blocks,
}

/// The bytes of the instructions written so far.
pub(crate) trait Machine: InstructionSet {
    /// The most operations of a kernel over all vectors of a block, so that its jumps reach.
    const MOST_OPERATIONS: usize;

    /// An empty function, with room for about `instructions` instructions.
    fn new(shape: Shape, instructions: usize) -> Self;

    /// Sets the width of the vectors that follow. Called only where numbers are moved between lanes.
    fn of_width(&mut self, _width: usize) {}

    /// Loads from memory to a register.
    fn load(&mut self, register: u8, from: Place);

    /// Stores a register to memory.
    fn store(&mut self, register: u8, to: Place);

    /// Copies from register to register.
    fn copy(&mut self, to: u8, from: u8);

    /// Starts the function: keeps what belongs to the caller, sets how numbers are rounded, gets the pointers and the
    /// number of steps.
    fn enter(&mut self);

    /// Ends the function.
    fn leave(&mut self);

    /// Resets the number of steps and the table of the steps to the start.
    fn rewind(&mut self);

    /// Moves a pointer by `bytes` bytes.
    fn advance(&mut self, base: Base, bytes: i32);

    /// Sets the number of blocks to go.
    fn count_blocks(&mut self, blocks: i32);

    /// Aligns the next instruction to a line of the cache.
    fn align(&mut self);

    /// Where the next instruction will be, in bytes.
    fn here(&self) -> usize;

    /// Counts down, and jumps back unless that makes zero.
    fn count_down(&mut self, counter: Counter, to: usize);

    /// The bytes written; nothing is left.
    fn take_bytes(&mut self) -> Vec<u8>;
}

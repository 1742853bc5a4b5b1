//! The kernel writer for a CPU that has none: everything is interpreted.

use super::{Layout, interpret::Interpreter};
use crate::{isa::Level, tape::split::Body};

/// How a kernel goes through a tile. There is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {}

impl Shape {
    /// How long rows are.
    pub fn lanes(&self) -> usize {
        match *self {}
    }

    /// The same in words that every CPU has.
    pub fn layout(&self) -> Layout {
        match *self {}
    }
}

/// The shape for so many members.
pub fn choose(_: &Body, _: Level, _: usize) -> Option<Shape> {
    None
}

/// The shape for rows of so many numbers.
pub fn choose_long(_: &Body, _: Level, _: usize) -> Option<Shape> {
    None
}

/// The shape for several steps in one call, over rows of a given length.
pub fn choose_trail(_: &Body, _: Level, _: usize) -> Option<Shape> {
    None
}

/// Writes a kernel, which cannot be.
pub fn write(_: &Body, _: Shape) -> Option<Interpreter> {
    None
}

/// Whether the system lets machine code be run.
pub fn allowed() -> bool {
    false
}

//! Which shape is quick.

use super::Shape;
use crate::{isa::Level, tape::split::Body};

/// The shape for so many members.
pub fn choose(_body: &Body, level: Level, members: usize) -> Shape {
    let width = match level {
        _ if members == 1 => 1,
        Level::Avx512 => 8,
        _ => 4,
    };
    Shape { level, width, abreast: 1, blocks: 1, resident: true }
}

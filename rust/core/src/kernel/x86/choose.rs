//! Which shape is quick.

use super::Shape;
use crate::{isa::Level, tape::split::Body};

/// The shape for so many members.
pub fn choose(_body: &Body, level: Level, members: usize) -> Option<Shape> {
    let width = match level {
        _ if members == 1 => 1,
        Level::Avx512 => 8,
        _ => 4,
    };
    (level > Level::Baseline).then_some(Shape { level, width, abreast: 1, blocks: 1, resident: true })
}

/// The shape for rows of so many numbers, each a number of a long block: none if they are no whole vectors.
pub fn choose_long(_body: &Body, level: Level, lanes: usize) -> Option<Shape> {
    let most = if level == Level::Avx512 { 8 } else { 4 };
    let width = if lanes == 1 { 1 } else { most };
    let fits = level > Level::Baseline && lanes.is_multiple_of(width);
    fits.then_some(Shape { level, width, abreast: 1, blocks: lanes / width, resident: false })
}

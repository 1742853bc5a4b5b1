//! How machine code goes through a tile.

use super::Layout;
use crate::{isa::Level, tape::split::Body};

/// How a kernel goes through a tile. Its rows are `width · block_vectors · blocks` numbers long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// The instructions: of AVX2, AVX-512 or NEON.
    pub level: Level,
    /// The size of a number in bytes: 8 or 4.
    pub bytes: usize,
    /// Numbers in a vector: 1, or 16 (NEON), 32 (AVX2, AVX-512) or 64 bytes of them (AVX-512).
    pub width: usize,
    /// Vectors of a block: those that one turn of the loop steps.
    pub block_vectors: usize,
    /// How many of them are interleaved at a time, operation by operation: all, or fewer where registers are scarce and
    /// out-of-order execution overlaps them by itself.
    pub interleaved: usize,
    /// Blocks, which are stepped one after the other.
    pub blocks: usize,
    /// Whether a block makes all steps before the next one does, with the state in registers. Otherwise each step is made by all
    /// blocks.
    pub resident: bool,
}

impl Shape {
    /// How long rows are.
    pub fn lanes(&self) -> usize {
        self.width * self.block_vectors * self.blocks
    }

    /// The shape in terms that every CPU has.
    pub(crate) fn layout(&self) -> Layout {
        let Shape { width, block_vectors, blocks, resident, .. } = *self;
        Layout { width, block_vectors, blocks, resident, registers: self.registers() }
    }

    /// Whether the numbers of one member may be lanes of vectors: there is one member, numbers have 64 bits, and the CPU has a
    /// writer for it.
    pub fn packs(&self) -> bool {
        self.lanes() == 1 && self.bytes == 8 && self.resident && matches!(self.level, Level::Avx2 | Level::Avx512)
    }

    /// How many vector registers there are.
    pub(super) fn registers(&self) -> usize {
        if self.level == Level::Avx2 { 16 } else { 32 }
    }

    /// Copies of each number in the pool: AVX-512 can broadcast a single one to all lanes.
    pub(super) fn pool_copies(&self) -> usize {
        match (self.level, self.width) {
            (Level::Avx512, _) => 1,
            (Level::Avx2, 1) => 16 / self.bytes,
            (_, width) => width,
        }
    }

    /// Whether its instructions exist, and all addresses of a body in it fit into 31 bits.
    pub(super) fn is_possible(&self, body: &Body, most_operations: usize) -> bool {
        let is_known = match self.level {
            Level::Baseline => false,
            Level::Neon => self.width == 1 || self.width * self.bytes == 16,
            Level::Avx2 => self.width == 1 || self.width * self.bytes == 32,
            Level::Avx512 => self.width == 1 || matches!(self.width * self.bytes, 32 | 64),
        };
        let bytes = |sizes: &[usize]| sizes.iter().try_fold(8usize, |a, b| a.checked_mul(*b)).is_some_and(|n| n < 1 << 31);
        let lanes = [self.width, self.block_vectors, self.blocks];
        let rows = body.next.len().max(body.rows).max(1);
        is_known
            && self.bytes == body.precision.bytes()
            && self.block_vectors > 0
            && self.interleaved > 0
            && self.blocks > 0
            && body.ops.len().saturating_mul(self.block_vectors) < most_operations
            && bytes(&[rows, lanes[0], lanes[1], lanes[2]])
            && bytes(&[body.ops.len() + body.uniforms + body.per_step + 2, self.width.max(2), self.block_vectors])
    }
}

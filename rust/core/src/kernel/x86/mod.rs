//! The kernel writer for x86-64: a body becomes a vector loop, with AVX-512 or AVX2.
//!
//! [`plan`] selects instructions, [`write`] assigns registers and writes one step, [`loops`] writes the loops around it, [`encode`] the
//! bytes. [`Shape`] has the width and the order of the loops; [`choose`](choose::choose) chooses the fastest.

mod choose;
mod encode;
mod loops;
mod plan;
mod write;

pub use choose::{choose, choose_long, choose_trail};

use super::{
    Kernel, Layout, Tile,
    pages::{Frame, Pages},
};
use crate::{isa::Level, tape::split::Body};

/// How a kernel goes through a tile. Its rows are `width · block_vectors · blocks` numbers long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// The instructions: of AVX2 or AVX-512.
    pub level: Level,
    /// Numbers in a vector: 1, 4, or 8 (AVX-512).
    pub width: usize,
    /// Vectors of a block: those that one turn of the loop steps.
    pub block_vectors: usize,
    /// How many of them are interleaved at a time, operation by operation: all, or fewer where registers are scarce and
    /// out-of-order execution overlaps them by itself.
    pub interleaved: usize,
    /// Blocks, which are stepped one after the other.
    pub blocks: usize,
    /// Whether a block makes all steps before the next one does, with the state in registers. Otherwise each step is made by all blocks.
    pub resident: bool,
}

impl Shape {
    /// How long rows are.
    pub fn lanes(&self) -> usize {
        self.width * self.block_vectors * self.blocks
    }

    /// The same in words that every CPU has.
    pub fn layout(&self) -> Layout {
        let Shape { width, block_vectors, blocks, resident, .. } = *self;
        Layout { width, block_vectors, blocks, resident, registers: self.registers() }
    }

    /// How many vector registers there are.
    fn registers(&self) -> usize {
        if self.level == Level::Avx512 { 32 } else { 16 }
    }

    /// Copies of each number in the pool: AVX-512 can broadcast a single one to all lanes.
    fn pool_copies(&self) -> usize {
        match (self.level, self.width) {
            (Level::Avx512, _) => 1,
            (_, 1) => 2,
            (_, width) => width,
        }
    }

    /// Whether this machine has it, and all addresses of a body in it fit into 31 bits.
    fn is_possible(&self, body: &Body) -> bool {
        let is_known = match self.width {
            1 | 4 => self.level >= Level::Avx2,
            8 => self.level == Level::Avx512,
            _ => false,
        };
        let bytes = |sizes: &[usize]| sizes.iter().try_fold(8usize, |a, b| a.checked_mul(*b)).is_some_and(|n| n < 1 << 31);
        let lanes = [self.width, self.block_vectors, self.blocks];
        let rows = body.next.len().max(body.rows).max(1);
        is_known
            && self.block_vectors > 0
            && self.interleaved > 0
            && self.blocks > 0
            && self.level.here()
            && body.ops.len().saturating_mul(self.block_vectors) < MAX_OPERATIONS
            && bytes(&[rows, lanes[0], lanes[1], lanes[2]])
            && bytes(&[body.ops.len() + body.uniforms + body.per_step + 2, self.width.max(2), self.block_vectors])
    }
}

/// The most operations of a kernel, so that jumps fit into 31 bits.
const MAX_OPERATIONS: usize = 1 << 22;

/// A kernel as machine code.
#[derive(Debug)]
pub struct Written {
    pages: Pages,
    shape: Shape,
    constants: Vec<f64>,
    uniforms: usize,
    spills: usize,
}

/// Writes a kernel. None if this machine cannot run it, registers do not suffice, or the system does not let code be written.
pub fn write(body: &Body, shape: Shape) -> Option<Written> {
    if !shape.is_possible(body) {
        return None;
    }
    let plan = plan::Plan::new(body, shape.level == Level::Avx512)?;
    let (code, slots) = loops::function(&plan, shape)?;
    let frame = Frame {
        pool: (plan.constants.len() + body.uniforms) * shape.pool_copies(),
        scratch: (slots * shape.width).next_multiple_of(8),
        aligned_pool: shape.pool_copies() > 1,
        ..Frame::new(body, shape.lanes())
    };
    let pages = Pages::new(&code, frame)?;
    let constants = plan.constants.iter().map(|bits| f64::from_bits(*bits)).collect();
    Some(Written { pages, shape, constants, uniforms: body.uniforms, spills: slots })
}

/// Whether the system lets machine code be run.
pub fn allowed() -> bool {
    Pages::allowed()
}

impl Written {
    /// Its machine code.
    pub fn code(&self) -> &[u8] {
        self.pages.code()
    }

    /// What the code may touch.
    pub fn frame(&self) -> &Frame {
        self.pages.frame()
    }

    /// How it goes through a tile.
    pub fn shape(&self) -> Shape {
        self.shape
    }
}

impl Kernel for Written {
    fn lanes(&self) -> usize {
        self.shape.lanes()
    }

    fn pool(&self, uniforms: &[f64]) -> Vec<f64> {
        let numbers = self.constants.iter().chain(&uniforms[..self.uniforms]);
        numbers.flat_map(|x| std::iter::repeat_n(*x, self.shape.pool_copies())).collect()
    }

    fn run(&self, tile: &mut Tile, scratch: &mut Vec<f64>) {
        self.pages.run(tile, scratch);
    }

    fn bytes(&self) -> usize {
        self.code().len()
    }

    fn spills(&self) -> usize {
        self.spills
    }
}

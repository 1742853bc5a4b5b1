//! From a body to machine code, for any CPU, and to a kernel, for this one.

use super::{Kernel, Tile, aarch64, frame::Frame, loops, machine::Machine, pages::Pages, plan::Plan, shape::Shape, x86};
use crate::{isa::Level, real::Real, tape::split::Body};

/// Machine code for a CPU that this machine may not have.
#[derive(Clone, Debug)]
pub struct Assembled {
    /// The bytes of a function, from its first instruction on.
    pub code: Vec<u8>,
    /// What it may touch.
    pub frame: Frame,
    /// How it goes through a tile.
    pub shape: Shape,
    /// The most values that are spilled at once.
    pub spills: usize,
    /// The bits of each.
    constants: Vec<u64>,
}

impl Assembled {
    /// The numbers that are the same for all, as the code wants them.
    pub fn pool<T: Real>(&self, uniforms: &[T]) -> Vec<T> {
        let constants = self.constants.iter().map(|bits| T::from_pattern(*bits));
        let numbers = constants.chain(uniforms[..self.frame.body.uniforms].iter().copied());
        numbers.flat_map(|x| std::iter::repeat_n(x, self.shape.pool_copies())).collect()
    }
}

/// The machine code of a body in a shape. None if there is none, or registers do not suffice.
pub fn assemble(body: &Body, shape: Shape) -> Option<Assembled> {
    match shape.level {
        Level::Baseline => None,
        Level::Neon => assemble_for::<aarch64::encode::Code>(body, shape),
        Level::Avx2 | Level::Avx512 => assemble_for::<x86::encode::Code>(body, shape),
    }
}

fn assemble_for<M: Machine>(body: &Body, shape: Shape) -> Option<Assembled> {
    if !shape.is_possible(body, M::MOST_OPERATIONS) {
        return None;
    }
    let machine = M::new(shape, body.ops.len() * shape.block_vectors);
    let plan = Plan::new(body, &machine)?;
    let (code, spills) = loops::function(&plan, machine, shape)?;
    let frame = Frame {
        pool: (plan.constants.len() + body.uniforms) * shape.pool_copies(),
        scratch: (spills * shape.width).next_multiple_of(64 / shape.bytes),
        aligned_pool: shape.pool_copies() > 1,
        ..Frame::new(body, shape.lanes())
    };
    Some(Assembled { code, frame, shape, spills, constants: plan.constants })
}

/// A kernel as machine code of this machine.
#[derive(Debug)]
pub struct Written {
    pages: Pages,
    assembled: Assembled,
}

/// Writes a kernel. None if this machine cannot run it, registers do not suffice, or the system does not let code be written.
pub fn write(body: &Body, shape: Shape) -> Option<Written> {
    if !shape.level.here() {
        return None;
    }
    let assembled = assemble(body, shape)?;
    let pages = Pages::new(&assembled.code, assembled.frame.clone())?;
    Some(Written { pages, assembled: Assembled { code: Vec::new(), ..assembled } })
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
        self.assembled.shape
    }
}

impl<T: Real> Kernel<T> for Written {
    fn lanes(&self) -> usize {
        self.shape().lanes()
    }

    fn pool(&self, uniforms: &[T]) -> Vec<T> {
        self.assembled.pool(uniforms)
    }

    fn run(&self, tile: &mut Tile<T>, scratch: &mut Vec<T>) {
        self.pages.run(tile, scratch);
    }

    fn bytes(&self) -> usize {
        self.code().len()
    }

    fn spills(&self) -> usize {
        self.assembled.spills
    }
}

//! The steps from a body to machine code, for any CPU, and to a kernel, for this one.

use super::{
    Kernel, Tile, aarch64,
    frame::Frame,
    local_order::{MAX_WAITING, MAX_WAITING_PACKED, in_local_order, packed_in_local_order},
    loops,
    pack::{self, MOST_LANES, Packed, Verdict},
    pages::Pages,
    plan::{KernelPlan, is_sound},
    schedule,
    shape::Shape,
    write::MakeOperation,
    x86,
};
use crate::{
    isa::Level,
    tape::{real::Real, split::Body},
};

/// Machine code for a CPU that this machine may not have.
#[derive(Clone, Debug)]
pub struct Assembled {
    /// The bytes of a function, from its first instruction on.
    pub code: Vec<u8>,
    /// The memory that the code may access.
    pub frame: Frame,
    /// How it goes through a tile.
    pub shape: Shape,
    /// The most values that are spilled at once.
    pub spills: usize,
    /// The gain by packing operations of one member into vectors, where that was tried.
    pub packing: Option<Verdict>,
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

/// The machine code for this machine: what writes that of other CPUs is not in the library, but for the tests, which call
/// [`assemble`].
fn assemble_here(body: &Body, shape: Shape) -> Option<Assembled> {
    if cfg!(target_arch = "aarch64") {
        assemble_for::<aarch64::encode::Code>(body, shape)
    } else {
        assemble_for::<x86::encode::Code>(body, shape)
    }
}

fn assemble_for<M: MakeOperation>(body: &Body, shape: Shape) -> Option<Assembled> {
    assemble_plan::<M>(body, None, shape)
}

fn assemble_plan<M: MakeOperation>(body: &Body, packed: Option<&Packed>, shape: Shape) -> Option<Assembled> {
    // Everything below relies on the form of a body.
    if !is_sound(body) || !shape.is_possible(body, M::MOST_OPERATIONS) {
        return None;
    }
    let machine = M::new(shape, body.ops.len() * shape.block_vectors);
    let ordered = packed.is_none().then(|| in_local_order(body, MAX_WAITING));
    let body = ordered.as_ref().unwrap_or(body);
    let plan = match packed {
        None => KernelPlan::new(body, &machine),
        Some(packed) => KernelPlan::packed(body, packed, &machine)?,
    };
    let order = match packed {
        None => schedule::order(&plan, &body.ops, shape),
        // Its order is that of the model by which the packing was chosen.
        Some(_) => schedule::in_turn(plan.steps.len(), shape, 0),
    };
    let (code, spills) = loops::function(&plan, machine, shape, &order)?;
    let (homes, slot) = plan.packing.as_ref().map_or((0, shape.width), |packing| (packing.homes, MOST_LANES));
    let frame = Frame {
        pool: (plan.constants.list.len() + body.uniforms) * shape.pool_copies(),
        scratch: ((homes + spills) * slot).next_multiple_of(64 / shape.bytes),
        aligned_pool: shape.pool_copies() > 1,
        ..Frame::new(body, shape.lanes())
    };
    Some(Assembled { code, frame, shape, spills, packing: None, constants: plan.constants.list })
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
    execute(assemble_here(body, shape)?)
}

/// Writes a kernel for a single member, whose equal operations are lanes of one vector, if that gains. None as above, or if it
/// does not.
pub fn write_if_it_gains(body: &Body, shape: Shape) -> Option<Written> {
    if !shape.packs() || !is_sound(body) {
        return None;
    }
    let (verdict, packed) = pack::best(body)?;
    let packed = packed_in_local_order(&packed.filter(|_| verdict.gains())?, MAX_WAITING_PACKED);
    let written = write_packed(body, shape.level, &packed)?;
    Some(Written { assembled: Assembled { packing: Some(verdict), ..written.assembled }, ..written })
}

/// Writes a kernel for a single member, whose numbers are lanes of these vectors. None as above, or if they are no such vectors.
pub fn write_packed(body: &Body, level: Level, packed: &Packed) -> Option<Written> {
    let shape =
        Shape { level, bytes: body.precision.bytes(), width: 1, block_vectors: 1, interleaved: 1, blocks: 1, resident: true };
    if cfg!(not(target_arch = "x86_64")) || !level.here() || !shape.packs() || !packed.is_sound(body) {
        return None;
    }
    execute(assemble_plan::<x86::encode::Code>(body, Some(packed), shape)?)
}

fn execute(assembled: Assembled) -> Option<Written> {
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

    /// The memory that the code may access.
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

    fn packing(&self) -> Option<Verdict> {
        self.assembled.packing
    }
}

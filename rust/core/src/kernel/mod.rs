//! Kernels: from the list of operations to code that runs them.
//!
//! A kernel makes a number of steps of a tile of lanes, one lane a member. It is interpreted ([`interpret`]) or written as
//! machine code at run time ([`writer`], for x86-64 and AArch64); the bits are the same.

pub mod aarch64;
mod choose;
mod frame;
mod instruction_set;
pub mod interpret;
mod local_order;
mod loops;
mod machine;
mod memory;
pub mod pack;
mod pages;
mod plan;
mod registers;
pub(crate) mod runner;
mod scaled;
mod schedule;
mod shape;
mod timing;
mod write;
mod written;
mod x86;

/// The kernel writer: chooses shapes, and writes machine code in them.
pub mod writer {
    pub use super::{
        choose::{choose, choose_long, choose_unrolled},
        frame::Frame,
        local_order::{in_local_order, packed_in_local_order},
        schedule::{Order, Waits, in_turn},
        shape::Shape,
        written::{Assembled, Written, allowed, assemble, write, write_if_it_gains, write_packed},
    };
}

use crate::tape::{real::Real, split::Body};

/// How machine code goes through a tile, whatever the CPU: see the writer's `Shape`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Numbers in a vector.
    pub width: usize,
    /// Vectors that are stepped by one iteration of the loop.
    pub block_vectors: usize,
    /// Iterations of the loop for a tile.
    pub blocks: usize,
    /// Whether the state stays in registers over all steps.
    pub resident: bool,
    /// Vector registers that the CPU has at this level.
    pub registers: usize,
}

/// The data of a kernel. Rows are `lanes` numbers long, one for each member, and follow each other.
#[derive(Debug)]
pub struct Tile<'a, T = f64> {
    /// A row for each number of the state, changed in place.
    pub state: &'a mut [T],
    /// A row for each number of the members that stays.
    pub rows: &'a [T],
    /// Numbers that are the same for all: what [`Kernel::pool`] made of them.
    pub pool: &'a [T],
    /// How many steps to make.
    pub steps: usize,
    /// The entries of each step, as many as the body says: the bits of a number, or, for a held input, the place in `held` of the
    /// first number of its row.
    pub per_step: &'a [u64],
    /// Rows of sampled inputs.
    pub held: &'a [T],
}

/// Steps of a tile.
pub trait Kernel<T: Real = f64>: Send + Sync {
    /// How long rows are.
    fn lanes(&self) -> usize;

    /// The numbers that are the same for all, as this kernel wants them.
    fn pool(&self, uniforms: &[T]) -> Vec<T>;

    /// Makes the steps. `scratch` is the kernel's to use and grows as needed.
    ///
    /// # Panics
    ///
    /// If the tile's slices are shorter than its body says.
    fn run(&self, tile: &mut Tile<T>, scratch: &mut Vec<T>);

    /// How long its machine code is, in bytes; zero if it is interpreted.
    fn bytes(&self) -> usize {
        0
    }

    /// The most values that are spilled at once because there are not enough registers.
    fn spills(&self) -> usize {
        0
    }

    /// Where the operations of one member are lanes of vectors: what that gains.
    fn packing(&self) -> Option<pack::Verdict> {
        None
    }
}

/// Panics unless a tile has the rows that a body reads. Machine code relies on it.
#[inline]
pub(crate) fn check<T: Real>(body: &Body, lanes: usize, tile: &Tile<T>) {
    assert!(body.precision == T::PRECISION, "precision");
    assert!(tile.state.len() >= body.next.len() * lanes, "state");
    assert!(tile.rows.len() >= body.rows * lanes, "rows");
    assert!(tile.per_step.len() >= body.per_step.saturating_mul(tile.steps), "steps");
    for op in &body.ops {
        if let crate::tape::Op::Held(i) = op {
            let places = tile.per_step.iter().skip(*i as usize).step_by(body.per_step).take(tile.steps);
            assert!(places.clone().all(|at| (*at as usize).saturating_add(lanes) <= tile.held.len()), "held");
        }
    }
}

//! Bodies that attract each other: the forces, and the order in which sums over pairs and over bodies are made.
//!
//! The rule for the order is the same in all code that computes them: see the core's `systems/nbody.rs`.

use crate::{functions::log, number::Number};

/// A force and its potential.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// 1/r, with its own potential.
    Logarithmic,
    /// 1/r².
    Newton,
    /// 1/r, with the potential of the other, as Hoffmann prints it.
    Printed,
}

impl Law {
    /// f(r²)
    #[inline(always)]
    pub fn pull<N: Number>(self, r2: N) -> N {
        let r2 = if self == Law::Newton { r2 * r2.sqrt() } else { r2 };
        N::of(1.0) / r2
    }

    /// The potential, per mass, that a partner makes.
    #[inline(always)]
    pub fn potential<N: Number>(self, r2: N, pull: N, strength: N) -> N {
        match self {
            Law::Logarithmic => (N::of(0.5) * log(r2)) * strength,
            Law::Newton => -(r2 * (pull * strength)), // the product is at hand
            Law::Printed => -(pull.sqrt() * strength),
        }
    }
}

/// Sums over bodies are kept in this many parts, body i in part i mod `LANES`; distances that are taken together are so far
/// apart.
pub const LANES: usize = 8;
/// From this many bodies on, distances are split into slabs.
const SLABBED_FROM: usize = 64;
/// Bodies for each slab, and how many slabs there are at most.
const SLAB: usize = 256;
const SLABS: usize = 16;

/// The distances k at which body i meets body i + k, every pair once for k ≤ n/2, in the order in which they are summed.
///
/// Distances that are `LANES` apart form a group, groups form slabs, and a slab has sums of its own.
pub fn partners(n: usize) -> Vec<Vec<Vec<usize>>> {
    if n < SLABBED_FROM {
        let pairs = n / 2 / (2 * LANES) * (2 * LANES);
        let twos = (1..=pairs).step_by(2 * LANES).flat_map(|first| (first..first + LANES).map(|k| vec![k, k + LANES]));
        return vec![twos.chain((pairs + 1..=n / 2).map(|k| vec![k])).collect()];
    }
    let last = (n - 1) / 2;
    let length = last.div_ceil((n / SLAB).clamp(1, SLABS)).next_multiple_of(LANES);
    let slab = |first: usize| {
        let end = last.min(first + length - 1);
        (first..=end.min(first + LANES - 1)).map(|k| (k..=end).step_by(LANES).collect()).collect()
    };
    let mut slabs: Vec<Vec<Vec<usize>>> = (1..=last).step_by(length).map(slab).collect();
    if let (Some(slab), 0) = (slabs.last_mut(), n % 2) {
        slab.push(vec![n / 2]); // opposite bodies
    }
    slabs
}

/// How many bodies meet a partner at this distance: all, but opposite ones meet once.
pub fn meeting(n: usize, k: usize) -> usize {
    if 2 * k == n { k } else { n }
}

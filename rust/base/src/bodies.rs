//! Bodies that attract each other: the forces, and the order in which sums over pairs and over bodies are made.
//!
//! The rule for the order is the same in all code that computes them: see the core's `systems/nbody.rs`. So is the rule for what
//! is fused, if that is asked for: [`Rounding::plus`] and [`Law::pull`].

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

/// How often a product that is added is rounded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounding {
    /// Twice: the product, and the sum.
    Twice,
    /// Once, with the sum: fused.
    Once,
}

impl Rounding {
    /// Fused or not.
    pub const fn of(fused: bool) -> Rounding {
        if fused { Rounding::Once } else { Rounding::Twice }
    }

    /// The sum and a · b.
    #[inline(always)]
    pub fn plus<N: Number>(self, sum: N, a: N, b: N) -> N {
        match self {
            Rounding::Twice => sum + a * b,
            Rounding::Once => a.mul_add(b, sum),
        }
    }

    /// d · d + ε². Fused, the sum starts from ε².
    #[inline(always)]
    pub fn softened<N: Number>(self, d: &[N], soft: N) -> N {
        match self {
            Rounding::Twice => d.iter().map(|d| *d * *d).reduce(|length, d| length + d).unwrap_or(N::of(0.0)) + soft,
            Rounding::Once => d.iter().fold(soft, |length, d| d.mul_add(*d, length)),
        }
    }
}

impl Law {
    /// f(r²)
    #[inline(always)]
    pub fn pull<N: Number>(self, rounding: Rounding, r2: N) -> N {
        match (self, rounding) {
            (Law::Newton, Rounding::Twice) => N::of(1.0) / (r2 * r2.sqrt()),
            (Law::Newton, Rounding::Once) => inverse_cube(r2),
            _ => N::of(1.0) / r2,
        }
    }

    /// The potential, per mass, that a partner makes.
    #[allow(clippy::eq_op, reason = "a difference with itself is 0 for numbers alone")]
    #[inline(always)]
    pub fn potential<N: Number>(self, r2: N, pull: N, strength: N) -> N {
        match self {
            // The logarithm is of normal numbers; what is added is 0 for these, and of others, such as a distance of 0, a NaN.
            Law::Logarithmic => (N::of(0.5) * log(r2) + (r2 - r2) * pull) * strength,
            Law::Newton => -(r2 * (pull * strength)), // the product is at hand
            Law::Printed => -(pull.sqrt() * strength),
        }
    }
}

/// x^(−3/2) by fused multiply-adds, without a root or a quotient, for x ≥ 0.
///
/// Half the bits of x, subtracted from a whole number, are the bits of a y whose square is 1/x within a tenth: the exponent is
/// halved and turned. With e = 1 − x·y² the inverse root is y·(1 − e)^(−½). The first correction takes two terms of that, with
/// the factors that make the largest error least: then |e| < 5.1e-5. The second takes of y³·(1 − e)^(−3/2) the terms to e³; what
/// is left out, 315/128·e⁴, is below 1.7e-17.
///
/// The error, in units of 2⁻⁵³ of the value: that of y², d, enters y³ once and e with the other sign, so ½·d is left; the product
/// y³ has one, the last sum one, what is left out 0.15, and roundings within terms of the size of e nothing. In all 2.7, which is
/// at most 2.2 units of the last digit, where √x, its product with x and the quotient have up to 3. Of 2·10⁷ numbers the worst
/// has 1.71 (2.39).
///
/// As with the quotient, the result is not finite for x below 3.1e-206, such as zero; of a NaN and of an infinite x, whose cube
/// has no bits left, it is a NaN.
#[inline(always)]
fn inverse_cube<N: Number>(x: N) -> N {
    let start = if N::is_single() { SINGLE_START } else { START };
    let y = x.shift_down(1).sub_bits_from(start);
    let e = x.mul_sub_from(y * y, N::of(1.0));
    let y = (y * e).mul_add(e.mul_add(N::of(FIRST[1]), N::of(FIRST[0])), y);
    let square = y * y;
    let (e, cube) = (x.mul_sub_from(square, N::of(1.0)), square * y);
    let terms = e.mul_add(N::of(SECOND[2]), N::of(SECOND[1])).mul_add(e, N::of(SECOND[0]));
    (cube * e).mul_add(terms, cube)
}

/// The minuends of halved bits, of 64 and of 32 bits, and the factors of e, e² and e³ in both corrections.
const START: u64 = 0x5FE6_E96B_D011_219C;
const SINGLE_START: u64 = 0x5F37_4B5F;
const FIRST: [f64; 2] = [0.501_099_379_114_800_2, 0.375_890_992_932_605_7];
const SECOND: [f64; 3] = [1.5, 1.875, 2.1875];

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

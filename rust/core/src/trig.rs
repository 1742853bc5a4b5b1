//! Sine, the same to the last bit in Rust and in the reference, and without a branch, so that a lane loop stays a vector loop.
//!
//! One libm `sin` in a step costs a factor of eighteen and differs between machines. This one reduces by π in two parts (Cody and
//! Waite) to [−π/2, π/2], where one odd polynomial serves. Up to 10⁶ rad it is within 1 ulp of 1; beyond, its error stays below the
//! one that the rounding of the argument itself makes. Arguments past 2⁵⁰ are garbage in, garbage out, huge numbers included;
//! callers refuse them.

/// 1/π
const PER_HALF_TURN: f64 = std::f64::consts::FRAC_1_PI;
/// 1.5·2⁵²: adding it rounds to an integer, which then stands in the low bits.
const MAGIC: f64 = 6755399441055744.0;
/// π in two parts; the first has 33 bits, so that n times it is exact for n < 2²⁰.
const PI: [f64; 2] = [3.1415926534682512, 1.2154201013012384e-10];
/// sin r = r + r³·(S₀ + z·(S₁ + …)), z = r²: the polynomial of least error on [−π/2, π/2], 2.4e-19, with coefficients rounded one
/// after the other and the rest fitted again.
const S: [f64; 8] = [
    -0.16666666666666666,
    0.008333333333333196,
    -0.00019841269841207676,
    2.75573192107121e-6,
    -2.505210682744121e-8,
    1.6058937294753282e-10,
    -7.64292781535996e-13,
    2.7205082501769597e-15,
];

/// sin x
#[inline(always)]
pub fn sin(x: f64) -> f64 {
    let y = x * PER_HALF_TURN + MAGIC;
    let n = y - MAGIC;
    let r = (x - n * PI[0]) - n * PI[1];
    let z = r * r;
    let w = z * z;
    // Odd and even powers apart: half the wait of one chain. The largest term comes last, or the error would grow by a sixth.
    let odd = S[1] + w * (S[3] + w * (S[5] + w * S[7]));
    let even = S[2] + w * (S[4] + w * S[6]);
    let s = r + (r * z) * (S[0] + z * (odd + z * even));
    f64::from_bits(s.to_bits() ^ (y.to_bits() << 63)) // sin(r + nπ) = (−1)ⁿ·sin r
}

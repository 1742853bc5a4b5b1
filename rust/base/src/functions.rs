//! Functions of one number, the same to the last bit in Rust and in the reference: sine, cosine and natural logarithm.
//!
//! **Sine.** That of libm differs between machines. This one reduces by π in two parts (Cody and Waite) to [−π/2, π/2], where one
//! odd polynomial suffices. Up to 10⁶ rad the error is within 1 ulp of 1; beyond, it stays below the effect of rounding the
//! argument. For arguments past 2⁵⁰ the result is meaningless and may be huge; callers refuse them.
//!
//! **Logarithm.** A normal number above zero is 2ᵏ·(1 + f) with 1 + f between √½ and √2; ln(1 + f) is fdlibm's polynomial in
//! s = f/(2 + f). The error stays below 1 ulp. For zero, subnormal numbers, infinity and NaN the result is meaningless: callers
//! detect r² = 0 before.

#![allow(clippy::excessive_precision, reason = "the coefficients as fdlibm prints them")]

use crate::number::{Function, Number};

/// 1/π
const PER_HALF_TURN: f64 = std::f64::consts::FRAC_1_PI;
/// 1.5·2⁵²: adding it rounds to an integer, which is then in the low bits.
const MAGIC: f64 = 6755399441055744.0;
/// π in two parts; the first has 33 bits, so that its product with n is exact for n < 2²⁰.
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
pub fn sin<N: Number>(x: N) -> N {
    if N::is_single() {
        return single_sin(x).marked(Function::Sin, x);
    }
    let y = x * N::of(PER_HALF_TURN) + N::of(MAGIC);
    let n = y - N::of(MAGIC);
    half_turn((x - n * N::of(PI[0])) - n * N::of(PI[1]), y).marked(Function::Sin, x)
}

/// cos x, which is the sine a quarter of a turn further. Series of sines need it.
#[inline(always)]
pub fn cos<N: Number>(x: N) -> N {
    if N::is_single() {
        return single_cos(x).marked(Function::Cos, x);
    }
    let y = (x * N::of(PER_HALF_TURN) + N::of(0.5)) + N::of(MAGIC);
    let n = (y - N::of(MAGIC)) - N::of(0.5);
    half_turn((x - n * N::of(PI[0])) - n * N::of(PI[1]), y).marked(Function::Cos, x)
}

/// sin r on [−π/2, π/2]; its sign turns if the integer in the low bits of y is odd: sin(r + nπ) = (−1)ⁿ·sin r.
#[inline(always)]
fn half_turn<N: Number>(r: N, y: N) -> N {
    let s = |i: usize| N::of(S[i]);
    let z = r * r;
    let w = z * z;
    // Separate sums of odd and even powers have half the latency of one chain. The largest term is added last; otherwise the
    // error would be a sixth larger.
    let odd = s(1) + w * (s(3) + w * (s(5) + w * s(7)));
    let even = s(2) + w * (s(4) + w * s(6));
    let sine = r + (r * z) * (s(0) + z * (odd + z * even));
    sine.xor_bits(y.shift_up(63))
}

/// 2^r on [−½, ½], and log₂(1 + f)/f for 1 + f between √½ and √2: fitted at Chebyshev's nodes, wrong by 3.5e-6 and, times f, by
/// 2.9e-5.
const ROUGH_EXP2: [f64; 5] = [1.0, 0.693121045203, 0.24022349038, 0.0559219758423, 0.00966636851538];
const ROUGH_LOG2: [f64; 5] = [1.44264046428, -0.72062921586, 0.485737842443, -0.389675223792, 0.250287846961];

/// 2ˣ to five digits, which is enough for the length of a step.
#[inline(always)]
pub fn rough_exp2<N: Number>(x: N) -> N {
    let magic = x + N::of(MAGIC);
    rough(x - (magic - N::of(MAGIC)), ROUGH_EXP2) * magic.shift_up(52).add_bits(1023 << 52)
}

/// log₂ x of a normal number above zero to four digits behind the point, which is enough for the length of a step.
#[inline(always)]
pub fn rough_log2<N: Number>(x: N) -> N {
    let (exponent, f) = split(x);
    exponent + f * rough(f, ROUGH_LOG2)
}

/// A polynomial of degree four, in few operations one after the other.
#[inline(always)]
fn rough<N: Number>(x: N, coefficients: [f64; 5]) -> N {
    let [c0, c1, c2, c3, c4] = coefficients.map(N::of);
    let x2 = x * x;
    (c0 + c1 * x) + x2 * ((c2 + c3 * x) + c4 * x2)
}

/// The whole exponent k and the fraction f of x = 2ᵏ·(1 + f).
#[inline(always)]
fn split<N: Number>(x: N) -> (N, N) {
    let u = x.add_bits(TO_ONE);
    let exponent = u.shift_down(52).or_bits(TWO_52) - N::of(4_503_599_627_370_496.0 + 1023.0);
    (exponent, u.and_bits(MANTISSA).add_bits(HALF_ROOT) - N::of(1.0))
}

/// ln 2 in two parts; the first has 33 bits, so that its product with k is exact.
const LN2: [f64; 2] = [6.93147180369123816490e-01, 1.90821492927058770002e-10];
/// ln((1 + s)/(1 − s)) = 2s + s·(L₀z + L₁z² + …), z = s²
const L: [f64; 7] = [
    6.666666666666735130e-01,
    3.999999999940941908e-01,
    2.857142874366239149e-01,
    2.222219843214978396e-01,
    1.818357216161805012e-01,
    1.531383769920937332e-01,
    1.479819860511658591e-01,
];
/// The high bits of √½: mantissas are taken between √½ and √2.
const HALF_ROOT: u64 = 0x3FE6_A09E_0000_0000;
const TO_ONE: u64 = 0x3FF0_0000_0000_0000 - HALF_ROOT;
const MANTISSA: u64 = 0x000F_FFFF_FFFF_FFFF;
/// 2⁵²: or-ing an integer below 2⁵² into its low bits gives 2⁵² plus that integer.
const TWO_52: u64 = 0x4330_0000_0000_0000;

/// ln x
#[inline(always)]
pub fn log<N: Number>(x: N) -> N {
    if N::is_single() {
        return single_log(x).marked(Function::Log, x);
    }
    let l = |i: usize| N::of(L[i]);
    let (k, f) = split(x);
    let s = f / (N::of(2.0) + f);
    let z = s * s;
    let r = z * (l(0) + z * (l(1) + z * (l(2) + z * (l(3) + z * (l(4) + z * (l(5) + z * l(6)))))));
    let half = N::of(0.5) * f * f;
    (k * N::of(LN2[0]) - ((half - (s * (half + r) + k * N::of(LN2[1]))) - f)).marked(Function::Log, x)
}

// ---- numbers of 32 bits: the same ways, with shorter polynomials

/// 1.5·2²³
const SINGLE_MAGIC: f64 = 12582912.0;
/// π: two parts of 13 bits, so that their products with n are exact for n < 2¹¹, and the rest.
const SINGLE_PI: [f64; 3] = [3.1416015625, -8.909031748771667e-06, 1.215420125655342e-10];
/// As `S`; the error is 5e-9 at most.
const SINGLE_S: [f64; 4] = [-0.16666656732559204, 0.008333008736371994, -0.00019806012278422713, 2.5987430944951484e-06];

/// sin x
fn single_sin<N: Number>(x: N) -> N {
    let y = x * N::of(PER_HALF_TURN) + N::of(SINGLE_MAGIC);
    single_half_turn(x, y, y - N::of(SINGLE_MAGIC))
}

/// cos x
fn single_cos<N: Number>(x: N) -> N {
    let y = (x * N::of(PER_HALF_TURN) + N::of(0.5)) + N::of(SINGLE_MAGIC);
    single_half_turn(x, y, (y - N::of(SINGLE_MAGIC)) - N::of(0.5))
}

/// sin(x − nπ); its sign turns if the integer in the low bits of y is odd.
fn single_half_turn<N: Number>(x: N, y: N, n: N) -> N {
    let s = |i: usize| N::of(SINGLE_S[i]);
    let r = ((x - n * N::of(SINGLE_PI[0])) - n * N::of(SINGLE_PI[1])) - n * N::of(SINGLE_PI[2]);
    let z = r * r;
    let sine = r + (r * z) * (s(0) + z * (s(1) + z * (s(2) + z * s(3))));
    sine.xor_bits(y.shift_up(31))
}

/// ln 2 in two parts; the first has 15 bits, so that its product with k is exact.
const SINGLE_LN2: [f64; 2] = [0.693145751953125, 1.428606765330187e-06];
/// As `L`.
const SINGLE_L: [f64; 4] = [0.6666666269302368, 0.40000972151756287, 0.2849878966808319, 0.2427894026041031];
const SINGLE_HALF_ROOT: u64 = 0x3F35_0400;
const SINGLE_TO_ONE: u64 = 0x3F80_0000 - SINGLE_HALF_ROOT;
const SINGLE_MANTISSA: u64 = 0x007F_FFFF;
const TWO_23: u64 = 0x4B00_0000;

fn single_log<N: Number>(x: N) -> N {
    let l = |i: usize| N::of(SINGLE_L[i]);
    let u = x.add_bits(SINGLE_TO_ONE);
    let k = u.shift_down(23).or_bits(TWO_23) - N::of(8_388_608.0 + 127.0);
    let f = u.and_bits(SINGLE_MANTISSA).add_bits(SINGLE_HALF_ROOT) - N::of(1.0);
    let s = f / (N::of(2.0) + f);
    let z = s * s;
    let r = z * (l(0) + z * (l(1) + z * (l(2) + z * l(3))));
    let half = N::of(0.5) * f * f;
    k * N::of(SINGLE_LN2[0]) - ((half - (s * (half + r) + k * N::of(SINGLE_LN2[1]))) - f)
}

//! Natural logarithm, the same to the last bit in Rust and in the reference, and without a branch.
//!
//! A normal number above zero is 2ᵏ·(1 + f) with 1 + f between √½ and √2; ln(1 + f) is fdlibm's polynomial in s = f/(2 + f). The
//! error stays below 1 ulp. Zero, subnormal numbers, infinity and NaN give garbage: whoever asks has found r² = 0 before.

#![allow(clippy::excessive_precision, reason = "the coefficients as fdlibm prints them")]

/// ln 2 in two parts; the first has 33 bits, so that k times it is exact.
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
/// √½, cut: the mantissa is taken from √½ to √2.
const HALF_ROOT: u64 = 0x3FE6_A09E_0000_0000;
const TO_ONE: u64 = 0x3FF0_0000_0000_0000 - HALF_ROOT;
const MANTISSA: u64 = 0x000F_FFFF_FFFF_FFFF;
/// 2⁵², whose low bits hold a whole number.
const TWO_52: u64 = 0x4330_0000_0000_0000;

/// ln x
#[inline(always)]
pub fn log(x: f64) -> f64 {
    let u = x.to_bits().wrapping_add(TO_ONE);
    let k = f64::from_bits((u >> 52) | TWO_52) - (4_503_599_627_370_496.0 + 1023.0);
    let f = f64::from_bits((u & MANTISSA).wrapping_add(HALF_ROOT)) - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let r = z * (L[0] + z * (L[1] + z * (L[2] + z * (L[3] + z * (L[4] + z * (L[5] + z * L[6]))))));
    let half = 0.5 * f * f;
    k * LN2[0] - ((half - (s * (half + r) + k * LN2[1])) - f)
}

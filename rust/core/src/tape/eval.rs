//! The meaning of each operation, in one place.

use super::op::Op;

/// a·b + c rounded once, for sums that are asked to be fused and are not on a tape.
#[inline(always)]
pub(crate) fn fused(a: f64, b: f64, c: f64) -> f64 {
    a.mul_add(b, c)
}

macro_rules! meaning {
    ($(#[$doc:meta])* $apply:ident, $bits:ident, $float:ident) => {
        $(#[$doc])*
        #[inline(always)]
        pub fn $apply(op: Op, a: $bits, b: $bits, c: $bits) -> $bits {
            use Op::*;
            let (x, y, z) = ($float::from_bits(a), $float::from_bits(b), $float::from_bits(c));
            let mask = |yes: bool| if yes { $bits::MAX } else { 0 };
            match op {
                Add(..) => (x + y).to_bits(),
                Sub(..) => (x - y).to_bits(),
                Mul(..) => (x * y).to_bits(),
                Div(..) => (x / y).to_bits(),
                MulAdd(..) => x.mul_add(y, z).to_bits(),
                MulSub(..) => x.mul_add(y, -z).to_bits(),
                SubMul(..) => (-x).mul_add(y, z).to_bits(),
                Sqrt(_) => x.sqrt().to_bits(),
                Neg(_) => a ^ (1 << ($bits::BITS - 1)),
                Floor(_) => x.floor().to_bits(),
                Less(..) => mask(x < y),
                LessEqual(..) => mask(x <= y),
                Equal(..) => mask(x == y),
                Select(..) => (a & b) | (!a & c),
                And(..) => a & b,
                Or(..) => a | b,
                Xor(..) => a ^ b,
                AddBits(..) => a.wrapping_add(b),
                SubBits(..) => a.wrapping_sub(b),
                ShiftUp(_, n) => a.checked_shl(n).unwrap_or(0),
                ShiftDown(_, n) => a.checked_shr(n).unwrap_or(0),
                Copy(_) => a,
                Const(bits) => bits as $bits,
                State(_) | Param(_) | Step | Time | Sample(..) | Row(_) | Uniform(_) | PerStep(_) | Held(_) | Gather(_) => 0,
            }
        }
    };
}

meaning! {
    /// The bits that an operation makes of the bits of its operands.
    apply, u64, f64
}
meaning! {
    /// The bits that an operation makes of its operands of 32 bits.
    apply_single, u32, f32
}

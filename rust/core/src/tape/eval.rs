//! What each operation means, in one place.

use super::Op;

/// The bits that an operation makes of the bits of its operands.
#[inline(always)]
pub fn apply(op: Op, a: u64, b: u64, c: u64) -> u64 {
    use Op::*;
    let (x, y, z) = (f64::from_bits(a), f64::from_bits(b), f64::from_bits(c));
    let mask = |yes: bool| if yes { u64::MAX } else { 0 };
    match op {
        Add(..) => (x + y).to_bits(),
        Sub(..) => (x - y).to_bits(),
        Mul(..) => (x * y).to_bits(),
        Div(..) => (x / y).to_bits(),
        MulAdd(..) => x.mul_add(y, z).to_bits(),
        MulSub(..) => x.mul_add(y, -z).to_bits(),
        SubMul(..) => (-x).mul_add(y, z).to_bits(),
        Sqrt(_) => x.sqrt().to_bits(),
        Neg(_) => a ^ (1 << 63),
        Floor(_) => x.floor().to_bits(),
        Less(..) => mask(x < y),
        LessEqual(..) => mask(x <= y),
        Equal(..) => mask(x == y),
        Select(..) => (a & b) | (!a & c),
        And(..) => a & b,
        Or(..) => a | b,
        Xor(..) => a ^ b,
        AddBits(..) => a.wrapping_add(b),
        ShiftUp(_, n) => a << n,
        ShiftDown(_, n) => a >> n,
        Copy(_) => a,
        Const(bits) => bits,
        State(_) | Param(_) | Step | Time | Sample(..) | Row(_) | Uniform(_) | PerStep(_) | Held(_) | Gather(_) => 0,
    }
}

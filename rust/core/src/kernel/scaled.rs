//! Where exponential functions multiply by a power of two: an instruction of AVX-512 does what takes four operations.
//!
//! No normal number is 2ⁿ for all n at which x·2ⁿ, x near 1, is neither 0 nor infinite. So `scaled` in
//! `reference/functions/exponential.py` has two factors, (x·2ⁿ⁺¹⁰⁰)·2⁻¹⁰⁰ or (x·2ⁿ⁻¹)·2, of which the first product is exact. One
//! rounding of x·2ⁿ gives the same bits. Nothing else writes these operations on bits: equations know only whole functions.
//!
//! A fused step has c ± (…)·2 in one operation where c is a number, as in 1 + eˣ. The product with 2 or 2⁻¹⁰⁰ is exact there but
//! where it is subnormal or infinite, and beside a c that is far from both that makes no difference.

use crate::tape::{
    Id, Op,
    real::{Precision, power_of_two},
    split::Body,
};

/// Products x·2ⁿ in a body.
pub(super) struct Scaled {
    /// For each value x and n, if it is such a product.
    pub of: Vec<Option<[Id; 2]>>,
    /// For each value the sum that replaces it, if it is a sum with such a product.
    pub sums: Vec<Option<Op>>,
    /// Whether a value is a part of such a product, and has no other use.
    pub replaced: Vec<bool>,
}

/// 1.5·2⁵², and the exponent's bits of 1.
const MAGIC: f64 = 6_755_399_441_055_744.0;
const BIAS: f64 = 1023.0;
/// Numbers are raised by this many powers of two where n < 0.
const RAISED: i32 = 100;
/// Numbers between this power of two and its inverse are far from what is subnormal or infinite.
const FAR: i32 = 900;

impl Scaled {
    /// Finds scalings in a body, and lowers the use counts of the operations they replace.
    pub(super) fn new(body: &Body, uses: &mut [u32]) -> Scaled {
        let ops = &body.ops;
        let mut made = Scaled { of: vec![None; ops.len()], sums: vec![None; ops.len()], replaced: vec![false; ops.len()] };
        if body.precision != Precision::Double {
            return made;
        }
        for (id, op) in ops.iter().enumerate() {
            let (a, b, sum) = match *op {
                Op::Mul(a, b) => (a, b, None),
                Op::MulAdd(a, b, c) | Op::MulSub(a, b, c) | Op::SubMul(a, b, c) if is_far(body, c) => (a, b, Some(c)),
                _ => continue,
            };
            for (inner, factor) in [(a, b), (b, a)] {
                let once = |id: Id| uses[id as usize] == 1;
                let Some(Product { x, n, shifted }) = product(body, inner, factor) else { continue };
                if ![inner, factor, shifted].into_iter().all(once) {
                    continue;
                }
                uses[n as usize] += 1;
                for part in [factor, shifted] {
                    made.remove(part, body, uses);
                }
                // In a sum the product is where the first of the two was.
                let at = if sum.is_some() { inner as usize } else { id };
                made.of[at] = Some([x, n]);
                made.sums[id] = match *op {
                    Op::MulAdd(_, _, c) => Some(Op::Add(inner, c)),
                    Op::MulSub(_, _, c) => Some(Op::Sub(inner, c)),
                    Op::SubMul(_, _, c) => Some(Op::Sub(c, inner)),
                    _ => None,
                };
                if sum.is_none() {
                    made.replaced[inner as usize] = true;
                    uses[inner as usize] = 0;
                }
                break;
            }
        }
        made
    }

    /// Takes away a value that nothing uses, and what only it uses.
    fn remove(&mut self, id: Id, body: &Body, uses: &mut [u32]) {
        self.replaced[id as usize] = true;
        uses[id as usize] = 0;
        let (operands, n) = body.ops[id as usize].operands();
        for of in &operands[..n] {
            uses[*of as usize] -= 1;
            if uses[*of as usize] == 0 && !body.ops[*of as usize].is_leaf() {
                self.remove(*of, body, uses);
            }
        }
    }
}

fn is_far(body: &Body, c: Id) -> bool {
    let far = power_of_two(FAR);
    match body.ops[c as usize] {
        Op::Const(bits) => (1.0 / far..=far).contains(&f64::from_bits(bits).abs()),
        _ => false,
    }
}

struct Product {
    x: Id,
    n: Id,
    shifted: Id,
}

/// (x·2ⁿ⁺¹⁰⁰)·2⁻¹⁰⁰ where `low` is true, else (x·2ⁿ⁻¹)·2.
fn product(body: &Body, inner: Id, factor: Id) -> Option<Product> {
    let op = |id: Id| body.ops[id as usize];
    let is = |id: Id, x: f64| op(id) == Op::Const(x.to_bits());
    let (Op::Mul(a, b), Op::Select(low, small, two)) = (op(inner), op(factor)) else { return None };
    if !(is(small, power_of_two(-RAISED)) && is(two, 2.0)) {
        return None;
    }
    [(a, b), (b, a)].into_iter().find_map(|(x, shifted)| {
        let Op::ShiftUp(turn, 52) = op(shifted) else { return None };
        // n is what is left of the sum in whose low bits the exponent stands, or is itself added to what makes that.
        let is_rounded = |n: Id| matches!(op(n), Op::Sub(_, magic) if is(magic, MAGIC));
        let n = match op(turn) {
            Op::Add(n, magic) | Op::Add(magic, n) if is_rounded(n) && is_magic(body, magic, low) => n,
            _ => (turn..inner).find(|n| match op(*n) {
                Op::Sub(a, magic) => a == turn && is_magic(body, magic, low),
                _ => false,
            })?,
        };
        Some(Product { x, n, shifted })
    })
}

fn is_magic(body: &Body, magic: Id, low: Id) -> bool {
    let is = |id: Id, x: f64| body.ops[id as usize] == Op::Const(x.to_bits());
    match body.ops[magic as usize] {
        Op::Select(m, raised, plain) => {
            m == low && is(raised, MAGIC + (BIAS + f64::from(RAISED))) && is(plain, MAGIC + (BIAS - 1.0))
        }
        _ => false,
    }
}

//! The second exact arithmetic: sums with a product in them become fused multiply-adds, which round once instead of twice.
//!
//! First increments are multiplied last ([`super::increments`]). Then products are fused. The choice is made on the tape and not by a compiler, so it is the same on every machine. A product is fused into the sum or the
//! difference of which it is a term if
//!
//! - nothing else reads it, so that it vanishes, and
//! - it depends on the state. Values that depend on parameters and the time alone are computed once before the steps, or once a step for
//!   all members, and cost nothing in the hot loop. Whether members share a parameter has no influence: a result must not depend on
//!   the batch.
//!
//! Of two such products the one of the higher [`ranks`] is fused. The rank of a value depends on the graph of operations alone, not on the
//! order in which the tape was written: both languages fuse the same products.

use super::{Id, Op, Tape, increments::increments_last, print::named};

/// What decides about the values of a tape that are needed for some others.
pub(super) struct Facts {
    pub needed: Vec<bool>,
    /// How often each is read.
    pub reads: Vec<u32>,
    pub ranks: Vec<u32>,
    /// Whether it depends on the step h.
    pub of_step: Vec<bool>,
}

impl Facts {
    pub fn new(tape: &Tape, roots: &[Id]) -> Facts {
        let ops = tape.ops();
        let needed = tape.needed(roots.iter().copied());
        let mut reads = vec![0; ops.len()];
        let mut of_step: Vec<bool> = Vec::with_capacity(ops.len());
        roots.iter().for_each(|root| reads[*root as usize] += 1);
        for (op, needed) in ops.iter().zip(&needed) {
            let (operands, n) = op.operands();
            of_step.push(*op == Op::Step || operands[..n].iter().any(|id| of_step[*id as usize]));
            if *needed {
                operands[..n].iter().for_each(|id| reads[*id as usize] += 1);
            }
        }
        let ranks = ranks(ops, &needed);
        Facts { needed, reads, ranks, of_step }
    }
}

/// A number for each value that is needed. Values are sorted by the depth of their graph; equally deep ones by the name of the operation,
/// by its constants, and by the ranks of its operands, which are sorted where the operation commutes.
fn ranks(ops: &[Op], needed: &[bool]) -> Vec<u32> {
    let mut depths: Vec<usize> = Vec::with_capacity(ops.len());
    for op in ops {
        let (operands, n) = op.operands();
        depths.push(operands[..n].iter().map(|id| depths[*id as usize] + 1).max().unwrap_or(0));
    }
    let mut levels: Vec<Vec<Id>> = vec![Vec::new(); depths.iter().max().map_or(0, |most| most + 1)];
    for (id, depth) in depths.into_iter().enumerate().filter(|(id, _)| needed[*id]) {
        levels[depth].push(id as Id);
    }
    let (mut ranks, mut next) = (vec![0; ops.len()], 0);
    for mut level in levels {
        level.sort_by_cached_key(|id| {
            let op = ops[*id as usize];
            let (operands, n) = op.operands();
            let mut of = operands.map(|id| ranks[id as usize]);
            if op.commutes() {
                of[..n].sort_unstable();
            }
            (named(op), of, n)
        });
        for id in level {
            ranks[id as usize] = next;
            next += 1;
        }
    }
    ranks
}

/// The same tape for these values, with fused multiply-adds, and the values on it.
#[must_use]
pub fn fuse(tape: &Tape, roots: &[Id]) -> (Tape, Vec<Id>) {
    let (tape, roots) = increments_last(tape, roots);
    let Facts { needed, reads, ranks, .. } = Facts::new(&tape, &roots);
    let ops = tape.ops();
    let is_higher = |a: Id, b: Id| ranks[a as usize] > ranks[b as usize];
    let product = |id: Id| match ops[id as usize] {
        Op::Mul(x, y) if reads[id as usize] == 1 && tape.is_of_state(id) => Some((x, y)),
        _ => None,
    };
    let fused = |op: Op| match op {
        Op::Add(a, b) => match (product(a), product(b)) {
            (Some((x, y)), None) => Op::MulAdd(x, y, b),
            (Some((x, y)), Some(_)) if is_higher(a, b) => Op::MulAdd(x, y, b),
            (_, Some((x, y))) => Op::MulAdd(x, y, a),
            _ => op,
        },
        Op::Sub(a, b) => match (product(a), product(b)) {
            (Some((x, y)), None) => Op::MulSub(x, y, b),
            (Some((x, y)), Some(_)) if is_higher(a, b) => Op::MulSub(x, y, b),
            (_, Some((x, y))) => Op::SubMul(x, y, a),
            _ => op,
        },
        _ => op,
    };
    let made = tape.rewritten(|id, op| if needed[id as usize] { fused(op) } else { op });
    (made, roots)
}

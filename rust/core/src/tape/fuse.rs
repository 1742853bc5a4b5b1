//! The second exact arithmetic: sums with a product in them become fused multiply-adds, which round once instead of twice.
//!
//! First functions get their quick forms (`forms.rs`), increments are multiplied last (`increments.rs`), quotients by numbers
//! become products (`quotients.rs`), and sums of two products are taken apart (`terms.rs`). Then products are fused. The choice
//! is made on the tape and not by a compiler, so it is the same on every machine. A product is fused into the sum or the
//! difference of which it is a term if
//!
//! - nothing else reads it, so that it vanishes, and
//! - it depends on the state. Values that depend on parameters and the time alone are computed once before the steps, or once a
//!   step for all members, and cost nothing in the hot loop. Whether members share a parameter has no influence: a result must
//!   not depend on the batch.
//!
//! Of two such products the one of the higher rank (`uses.rs`) is fused. The rank of a value depends on the graph of operations
//! alone, not on the order in which the tape was written: both languages fuse the same products.

use super::{
    Id, Op, Tape, forms::in_quick_forms, increments::increments_last, quotients::without_quotients, terms::terms_apart,
    uses::UseCounts,
};

/// Rewrites sums with fused multiply-adds. Returns the new tape and the new ids of the roots.
#[must_use]
pub fn fuse(tape: &Tape, roots: &[Id]) -> (Tape, Vec<Id>) {
    let (tape, roots) = in_quick_forms(tape, roots);
    let (tape, roots) = increments_last(&tape, &roots);
    let (tape, roots) = without_quotients(&tape, &roots);
    let (tape, roots) = terms_apart(&tape, &roots);
    let UseCounts { needed, reads, ranks, .. } = UseCounts::new(&tape, &roots);
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

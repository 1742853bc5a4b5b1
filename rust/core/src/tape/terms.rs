//! The fourth pass of [`super::fuse::fuse`]: two products that are added to a third value are added one by one.
//!
//! a + (p·q + r·s) is a product, a fused multiply-add and a sum. As (a + p·q) + r·s it is two fused multiply-adds, and the
//! product that is known last has one operation after it in place of three. So it is written, unless a depends on the state and
//! is of a higher rank than both products, and so known last itself. Each of the terms may have the other sign. Both products and
//! their sum depend on the state and are read once; of two such sums the one of the higher rank is taken apart. The same in
//! Python: `reference/tape/terms.py`.

use super::{Id, Op, Tape, uses::UseCounts};

/// A value, and whether it is subtracted.
#[derive(Clone, Copy)]
struct Term {
    id: Id,
    is_minus: bool,
}

/// Rewrites such sums with their terms one by one. Returns the new tape and the new ids of the roots.
pub(super) fn terms_apart(tape: &Tape, roots: &[Id]) -> (Tape, Vec<Id>) {
    let uses = UseCounts::new(tape, roots);
    let mut made = Tape { written: tape.written, series: tape.series, ..Tape::new(tape.precision()) };
    let mut place = vec![0; tape.ops().len()];
    for (id, op) in tape.ops().iter().enumerate().filter(|(id, _)| uses.needed[*id]) {
        place[id] = match apart(tape, &uses, *op) {
            Some(terms) => {
                let [other, first, last] = terms.map(|term| Term { id: place[term.id as usize], ..term });
                let so_far = added(&mut made, other, first);
                let sum = added(&mut made, so_far, last);
                if sum.is_minus { made.put(Op::Neg(sum.id)) } else { sum.id }
            }
            None => made.put(op.with(|id| place[id as usize])),
        };
    }
    let roots = roots.iter().map(|root| place[*root as usize]).collect();
    (made, roots)
}

/// The terms of a sum that is taken apart, in the order in which they are added.
fn apart(tape: &Tape, uses: &UseCounts, op: Op) -> Option<[Term; 3]> {
    let [a, b] = terms(op)?.map(|term| match tape.op(term.id) {
        Op::Neg(id) if uses.reads[term.id as usize] == 1 => Term { id, is_minus: !term.is_minus },
        _ => term,
    });
    let is_once = |id: Id| uses.reads[id as usize] == 1 && tape.is_of_state(id);
    let is_product = |id: Id| matches!(tape.op(id), Op::Mul(..)) && is_once(id);
    let products = |term: Term| {
        let both = terms(tape.op(term.id)).filter(|both| is_once(term.id) && both.iter().all(|each| is_product(each.id)))?;
        Some(both.map(|each| Term { is_minus: each.is_minus != term.is_minus, ..each }))
    };
    let rank = |term: Term| uses.ranks[term.id as usize];
    let (other, [p, q]) = match (products(a), products(b)) {
        (Some(of_a), Some(_)) if rank(a) > rank(b) => (b, of_a),
        (_, Some(of_b)) => (a, of_b),
        (Some(of_a), None) => (b, of_a),
        (None, None) => return None,
    };
    let (first, last) = if rank(p) > rank(q) { (q, p) } else { (p, q) };
    (!tape.is_of_state(other.id) || rank(other) <= rank(last)).then_some([other, first, last])
}

/// Both terms of a sum or a difference.
fn terms(op: Op) -> Option<[Term; 2]> {
    match op {
        Op::Add(a, b) => Some([Term { id: a, is_minus: false }, Term { id: b, is_minus: false }]),
        Op::Sub(a, b) => Some([Term { id: a, is_minus: false }, Term { id: b, is_minus: true }]),
        _ => None,
    }
}

/// The sum of two terms, or its negative where both are subtracted.
fn added(made: &mut Tape, x: Term, y: Term) -> Term {
    let op = match (x.is_minus, y.is_minus) {
        (true, false) => Op::Sub(y.id, x.id),
        (false, true) => Op::Sub(x.id, y.id),
        _ => Op::Add(x.id, y.id),
    };
    Term { id: made.put(op), is_minus: x.is_minus && y.is_minus }
}

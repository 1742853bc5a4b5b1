//! The tape: the operations of a step, as a straight-line program.
//!
//! A step is run once with symbols instead of numbers ([`crate::tape::number::Symbol`]), which record its operations on the tape.
//! An operation that is already on the tape is not written again, constants are folded where that is exact, and an operation that
//! changes no bit is left out. So the bits of every value are those of the operations as the step performs them.
//!
//! Only the sign and payload of a NaN may differ: they are not promised.

pub mod equations;
pub mod eval;
pub(crate) mod fast_hash;
mod forms;
mod forms_table;
pub mod fuse;
mod increments;
pub mod mass;
pub mod number;
mod op;
pub mod print;
mod quotients;
pub mod real;
pub mod reserved;
pub(crate) mod series;
pub mod split;
mod symbol;
mod terms;
mod uses;

use std::collections::BTreeSet;

pub use self::op::{Counts, Id, OPERATIONS, Op};
use self::{fast_hash::FastHashMap, real::Precision};

/// Operations in the order in which they were first requested, each once.
#[derive(Clone, Debug, Default)]
pub struct Tape {
    ops: Vec<Op>,
    precision: Precision,
    seen: FastHashMap<Op, Id>,
    /// For each value: whether it is surely not −0.
    not_minus_zero: Vec<bool>,
    /// For each value: whether it depends on the state.
    of_state: Vec<bool>,
    /// Counts of the requested operations on values that depend on the state, before equal ones were merged.
    written: Counts,
    /// In a step with a series: the operations of one evaluation of the rates, and of all coefficients of the rates.
    series: [usize; 2],
}

impl Tape {
    /// An empty one, for numbers of a precision.
    pub fn new(precision: Precision) -> Tape {
        Tape { precision, ..Tape::default() }
    }

    /// The numbers that it computes with.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// The operations.
    pub fn ops(&self) -> &[Op] {
        &self.ops
    }

    /// The operation of a value.
    pub fn op(&self, id: Id) -> Op {
        self.ops[id as usize]
    }

    /// Counts of the operations of a step as it is written down, if these values are its next state: the operations on values
    /// that depend on the state, before equal ones were merged and unused ones left out, and those of inputs that change with
    /// time. Operations on parameters alone are not counted, since they are computed before the steps.
    pub fn written(&self, roots: impl IntoIterator<Item = Id>) -> Counts {
        let mut counts = self.written;
        let mut changes: Vec<bool> = Vec::with_capacity(self.ops.len());
        for ((op, needed), of_state) in self.ops.iter().zip(self.needed(roots)).zip(&self.of_state) {
            let (operands, n) = op.operands();
            let varies = matches!(op, Op::Time | Op::Sample(..)) || operands[..n].iter().any(|id| changes[*id as usize]);
            changes.push(varies);
            if needed && varies && !of_state {
                counts.note(*op);
            }
        }
        counts
    }

    /// How many operations on what changes between steps these values are made of, equal ones once and some of them left out.
    pub(crate) fn changing(&self, roots: impl IntoIterator<Item = Id>, without: &BTreeSet<Id>) -> usize {
        let mask = self.needed(roots);
        let mut counts = Counts::default();
        let mut changes: Vec<bool> = Vec::with_capacity(self.ops.len());
        for (op, needed) in self.ops.iter().zip(&mask) {
            let (operands, n) = op.operands();
            let varies =
                matches!(op, Op::State(_) | Op::Time | Op::Sample(..)) || operands[..n].iter().any(|id| changes[*id as usize]);
            changes.push(varies);
            if *needed && varies {
                counts.note(*op);
            }
        }
        counts.total() - without.iter().filter(|id| mask[**id as usize] && changes[**id as usize]).count()
    }

    /// Notes how many operations one evaluation of the rates takes, and how many all coefficients of their series.
    pub(crate) fn note_series(&mut self, rates: usize, coefficients: usize) {
        self.series = [rates, coefficients];
    }

    /// The cost of the coefficients of a series, in evaluations of the rates, by their operations; 0 without a series.
    pub(crate) fn series_evaluations(&self) -> usize {
        let [rates, coefficients] = self.series;
        coefficients.div_ceil(rates.max(1))
    }

    /// Whether a value depends on the state.
    pub(crate) fn is_of_state(&self, id: Id) -> bool {
        self.of_state[id as usize]
    }

    /// A number, rounded to the tape's precision.
    pub fn constant(&mut self, x: f64) -> Id {
        self.keep(Op::Const(self.precision.bits_of(x)))
    }

    /// A constant of bits: see `Precision::pattern`.
    pub fn bits_of(&mut self, bits: u64) -> Id {
        self.keep(Op::Const(self.precision.pattern(bits)))
    }

    /// Writes an operation, or finds a value that is equal to its result in every bit.
    pub fn push(&mut self, op: Op) -> Id {
        let (operands, n) = op.operands();
        if operands[..n].iter().any(|id| self.is_of_state(*id)) {
            self.written.note(op);
        }
        self.shorten(op)
    }

    fn bits(&self, id: Id) -> Option<u64> {
        match self.op(id) {
            Op::Const(bits) => Some(bits),
            _ => None,
        }
    }

    fn never_minus_zero(&self, id: Id) -> bool {
        self.not_minus_zero[id as usize]
    }

    /// 0 + x, returned as x.
    fn behind_zero(&self, id: Id) -> Option<Id> {
        match self.op(id) {
            Op::Add(a, b) if self.bits(a) == Some(0) => Some(b),
            Op::Add(a, b) if self.bits(b) == Some(0) => Some(a),
            _ => None,
        }
    }

    /// Writes an operation, with the operands of a sum or a product in order. Nothing is folded or left out: the reference does
    /// the same.
    fn put(&mut self, op: Op) -> Id {
        self.keep(match op {
            Op::Add(a, b) => Op::Add(a.min(b), a.max(b)),
            Op::Mul(a, b) => Op::Mul(a.min(b), a.max(b)),
            _ => op,
        })
    }

    fn keep(&mut self, op: Op) -> Id {
        if let Some(&id) = self.seen.get(&op) {
            return id;
        }
        let id = self.ops.len() as Id;
        let sure = |id: Id| self.not_minus_zero[id as usize];
        let not_minus_zero = match op {
            Op::Const(bits) => bits != self.precision.sign_bit(),
            // A sum is −0 only if both are, a difference only of −0 and +0.
            Op::Add(a, b) => sure(a) || sure(b),
            Op::Sub(a, _) | Op::Sqrt(a) => sure(a),
            Op::Mul(a, b) => a == b,
            Op::Select(_, a, b) => sure(a) && sure(b),
            _ => false,
        };
        let (operands, n) = op.operands();
        let of_state = matches!(op, Op::State(_)) || operands[..n].iter().any(|id| self.is_of_state(*id));
        self.ops.push(op);
        self.not_minus_zero.push(not_minus_zero);
        self.of_state.push(of_state);
        self.seen.insert(op, id);
        id
    }

    /// Every rule here changes no bit of any result, whatever the numbers are: infinities, NaN but for its payload, both zeros.
    fn shorten(&mut self, op: Op) -> Id {
        use Op::*;
        if let Some(known) = self.fold(op) {
            return self.keep(Const(known));
        }
        let [one, minus_one] = [1.0, -1.0].map(|x| Some(self.precision.bits_of(x)));
        let (zero, minus_zero) = (Some(0), Some(self.precision.sign_bit()));
        match op {
            Neg(a) => match self.op(a) {
                Neg(x) => x,
                _ => self.keep(op),
            },
            MulAdd(a, b, c) if self.bits(c) == minus_zero => self.shorten(Mul(a, b)),
            Add(a, b) => {
                // x + −0 is x, and so is x + 0 unless x is −0.
                for (x, y) in [(a, b), (b, a)] {
                    if self.bits(y) == minus_zero || (self.bits(y) == zero && self.never_minus_zero(x)) {
                        return x;
                    }
                }
                // −x + −y is −x − y, whichever comes first.
                match (self.op(a), self.op(b)) {
                    (Neg(x), Neg(y)) if y < x => return self.shorten(Sub(b, x)),
                    (_, Neg(y)) => return self.shorten(Sub(a, y)),
                    (Neg(x), _) => return self.shorten(Sub(b, x)),
                    _ => {}
                }
                // (0 + x) + y: the zero matters only if x is −0, and then y alone decides, unless it is −0 too.
                for (x, y) in [(a, b), (b, a)] {
                    if self.never_minus_zero(y)
                        && let Some(x) = self.behind_zero(x)
                    {
                        return self.shorten(Add(x, y));
                    }
                }
                self.keep(op.in_order())
            }
            Sub(a, b) => {
                if self.bits(b) == zero {
                    return a;
                }
                if self.bits(a) == minus_zero {
                    return self.shorten(Neg(b));
                }
                if let Neg(x) = self.op(b) {
                    return self.shorten(Add(a, x));
                }
                self.keep(op)
            }
            Mul(a, b) => {
                for (x, y) in [(a, b), (b, a)] {
                    if self.bits(y) == one {
                        return x;
                    }
                    if self.bits(y) == minus_one {
                        return self.shorten(Neg(x));
                    }
                }
                match (self.op(a), self.op(b)) {
                    (Neg(x), Neg(y)) => self.shorten(Mul(x, y)),
                    (Neg(x), _) => {
                        let product = self.shorten(Mul(x, b));
                        self.shorten(Neg(product))
                    }
                    (_, Neg(y)) => {
                        let product = self.shorten(Mul(a, y));
                        self.shorten(Neg(product))
                    }
                    _ => self.keep(op.in_order()),
                }
            }
            Div(a, b) if self.bits(b) == one => a,
            Select(_, a, b) if a == b => a,
            Select(truth, a, _) if self.bits(truth) == Some(self.precision.all_bits()) => a,
            Select(truth, _, b) if self.bits(truth) == zero => b,
            Copy(a) => a,
            ShiftUp(a, 0) | ShiftDown(a, 0) => a,
            _ => self.keep(op.in_order()),
        }
    }

    /// The result of an operation on constants; none if it is a NaN, which is computed at run time.
    fn fold(&self, op: Op) -> Option<u64> {
        let ([a, b, c], n) = op.operands();
        if n == 0 || matches!(op, Op::Sample(..) | Op::Gather(_)) {
            return None;
        }
        let bits = |id: Id| self.bits(id);
        let (x, y, z) = (bits(a)?, if n > 1 { bits(b)? } else { 0 }, if n > 2 { bits(c)? } else { 0 });
        let made = self.precision.apply(op, x, y, z);
        (!op.rounds() || !self.precision.number(made).is_nan()).then_some(made)
    }

    /// The tape with some operations replaced, in place, by others of the same operands or earlier ones.
    fn rewritten(&self, replace: impl Fn(Id, Op) -> Op) -> Tape {
        let ops: Vec<Op> = self.ops.iter().enumerate().map(|(id, op)| replace(id as Id, *op)).collect();
        let seen = ops.iter().enumerate().map(|(id, op)| (*op, id as Id)).collect();
        let of_state = self.of_state.clone();
        Tape {
            ops,
            seen,
            not_minus_zero: vec![false; self.ops.len()],
            of_state,
            written: self.written,
            precision: self.precision,
            series: self.series,
        }
    }

    /// For each value of the tape whether these values need it; they need themselves.
    pub fn needed(&self, roots: impl IntoIterator<Item = Id>) -> Vec<bool> {
        let mut needed = vec![false; self.ops.len()];
        for root in roots {
            needed[root as usize] = true;
        }
        for id in (0..self.ops.len()).rev() {
            if needed[id] {
                let (operands, n) = self.ops[id].operands();
                for operand in &operands[..n] {
                    needed[*operand as usize] = true;
                }
            }
        }
        needed
    }

    /// How often each kind occurs among what these values need.
    pub fn counts(&self, roots: impl IntoIterator<Item = Id>) -> Counts {
        let mut counts = Counts::default();
        for (op, needed) in self.ops.iter().zip(self.needed(roots)) {
            if needed {
                counts.note(*op);
            }
        }
        counts
    }
}

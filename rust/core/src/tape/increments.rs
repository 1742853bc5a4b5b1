//! The second pass of [`super::fuse::fuse`]: increments are not rounded before they are added.
//!
//! Methods compute with increments, a factor that depends on the step h times something of the state: h·v̇. Here an increment is
//! kept as c·factor·x, a number, a value known before the step, and a value:
//!
//! - a change of sign, a product with a number, and a product with something else that is known before the step change c and
//!   the factor;
//! - of two increments of one factor, the sum is one too: c₁·f·x + c₂·f·y = c₁·f·(x + (c₂/c₁)·y), where x is the one of the
//!   lower rank;
//! - everything else takes the product, (c·f)·x, whose first half is computed before the steps.
//!
//! So v + ½(h·a₁ + h·a₂) becomes v + (½h)·(a₁ + a₂), and no product stands between a rate and the sum it belongs to.
//! `reference/tape/increments.py` says the same in Python.

use super::{Id, Op, Tape, uses::UseCounts};

/// c · factor · of
#[derive(Clone, Copy)]
struct Increment {
    c: f64,
    factor: Id,
    of: Id,
}

#[derive(Clone, Copy)]
enum Value {
    /// A value of the new tape.
    Plain(Id),
    Increment(Increment),
}

struct Rewriting<'a> {
    tape: &'a Tape,
    uses: UseCounts,
    made: Tape,
    /// For each value of the old tape what it is on the new one.
    values: Vec<Value>,
}

/// Multiplies increments last. Returns the new tape and the new ids of the roots.
pub(super) fn increments_last(tape: &Tape, roots: &[Id]) -> (Tape, Vec<Id>) {
    let (tape, roots) = &negated_sums(tape, roots);
    let made = Tape { written: tape.written, ..Tape::new(tape.precision()) };
    let mut work = Rewriting { tape, uses: UseCounts::new(tape, roots), made, values: Vec::with_capacity(tape.ops().len()) };
    for (id, op) in tape.ops().iter().enumerate() {
        let value = if work.uses.needed[id] { work.value(*op) } else { Value::Plain(0) };
        work.values.push(value);
    }
    let roots = roots.iter().map(|root| work.plain(*root)).collect();
    (work.made, roots)
}

/// Rewrites (−x) − y as −(x + y). Of −x and −y a tape has (−x) − y or (−y) − x, depending on which comes first, and the result
/// must not depend on that.
fn negated_sums(tape: &Tape, roots: &[Id]) -> (Tape, Vec<Id>) {
    let mut made = Tape { written: tape.written, ..Tape::new(tape.precision()) };
    let mut place = Vec::<Id>::with_capacity(tape.ops().len());
    for op in tape.ops() {
        let id = if let Op::Sub(a, b) = op
            && let Op::Neg(x) = tape.op(*a)
        {
            let (x, y) = (place[x as usize], place[*b as usize]);
            let sum = made.put(Op::Add(x, y));
            made.keep(Op::Neg(sum))
        } else {
            made.keep(op.with(|id| place[id as usize]))
        };
        place.push(id);
    }
    let roots = roots.iter().map(|root| place[*root as usize]).collect();
    (made, roots)
}

impl Rewriting<'_> {
    fn value(&mut self, op: Op) -> Value {
        match op {
            Op::Mul(a, b) => {
                let Some((p, x)) = self.weighted(a, b) else { return self.same(op) };
                match self.values[x as usize] {
                    Value::Increment(of) => Value::Increment(self.times(of, p)),
                    Value::Plain(_) if self.uses.of_step[p as usize] => Value::Increment(self.increment(p, x)),
                    Value::Plain(_) => self.same(op),
                }
            }
            Op::Neg(a) => match self.values[a as usize] {
                Value::Increment(of) => Value::Increment(Increment { c: -of.c, ..of }),
                Value::Plain(_) => self.same(op),
            },
            Op::Add(a, b) => self.sum(a, b, false),
            Op::Sub(a, b) => self.sum(a, b, true),
            _ => self.same(op),
        }
    }

    /// The factors of a product: the one known before the step, and the one of the state.
    fn weighted(&self, a: Id, b: Id) -> Option<(Id, Id)> {
        match (self.tape.is_of_state(a), self.tape.is_of_state(b)) {
            (false, true) => Some((a, b)),
            (true, false) => Some((b, a)),
            _ => None,
        }
    }

    /// p·x, where p depends on the step. Factors of x that are known before the step and read by nothing else join `factor`.
    fn increment(&mut self, p: Id, mut x: Id) -> Increment {
        let mut made = Increment { c: 1.0, factor: self.plain(p), of: 0 };
        while let Op::Mul(a, b) = self.tape.op(x)
            && self.uses.reads[x as usize] == 1
            && let Some((q, rest)) = self.weighted(a, b)
        {
            made = self.times(made, q);
            x = rest;
        }
        Increment { of: self.plain(x), ..made }
    }

    /// An increment times a value that is known before the step.
    fn times(&mut self, of: Increment, p: Id) -> Increment {
        match self.tape.op(p) {
            Op::Const(bits) => Increment { c: of.c * self.tape.precision().number(bits), ..of },
            _ => {
                let p = self.plain(p);
                Increment { factor: self.put(Op::Mul(p, of.factor)), ..of }
            }
        }
    }

    fn sum(&mut self, a: Id, b: Id, is_difference: bool) -> Value {
        if let (Value::Increment(x), Value::Increment(y)) = (self.values[a as usize], self.values[b as usize])
            && x.factor == y.factor
            && a != b
        {
            let turned = self.uses.ranks[b as usize] < self.uses.ranks[a as usize];
            let (low, high) = if turned { (y, x) } else { (x, y) };
            let ratio = if is_difference { -(high.c / low.c) } else { high.c / low.c };
            if ratio.is_finite() && ratio != 0.0 {
                let c = if is_difference && turned { -low.c } else { low.c };
                let size = self.made.constant(ratio.abs());
                let scaled = if ratio.abs() == 1.0 { high.of } else { self.put(Op::Mul(size, high.of)) };
                let of = self.put(if ratio > 0.0 { Op::Add(low.of, scaled) } else { Op::Sub(low.of, scaled) });
                return Value::Increment(Increment { c, of, ..low });
            }
        }
        let ((minus_a, a), (minus_b, b)) = (self.signed(a), self.signed(b));
        let made = match (minus_a, minus_b != is_difference) {
            (false, false) => self.put(Op::Add(a, b)),
            (false, true) => self.put(Op::Sub(a, b)),
            (true, false) => self.put(Op::Sub(b, a)),
            (true, true) => {
                let sum = self.put(Op::Add(a, b));
                self.put(Op::Neg(sum))
            }
        };
        Value::Plain(made)
    }

    /// A value of the old tape but for its sign, and whether that is minus.
    fn signed(&mut self, id: Id) -> (bool, Id) {
        match self.values[id as usize] {
            Value::Plain(id) => (false, id),
            Value::Increment(Increment { c, factor, of }) => {
                let factor = if c.abs() == 1.0 {
                    factor
                } else {
                    let c = self.made.constant(c.abs());
                    self.put(Op::Mul(c, factor))
                };
                (c < 0.0, self.put(Op::Mul(factor, of)))
            }
        }
    }

    fn plain(&mut self, id: Id) -> Id {
        match self.signed(id) {
            (true, id) => self.put(Op::Neg(id)),
            (false, id) => id,
        }
    }

    fn same(&mut self, op: Op) -> Value {
        let op = op.with(|id| self.plain(id));
        Value::Plain(self.put(op))
    }

    fn put(&mut self, op: Op) -> Id {
        self.made.put(op)
    }
}

//! The portable interpreter: operation after operation, each over all lanes of a tile.
//!
//! It is used where machine code is not allowed, where a run is too short for it to be worthwhile, and in the tests, which
//! compare kernel writers with it.

use std::cell::Cell;

use super::{Kernel, Tile, check};
use crate::{
    isa::{Level, Task, with_isa},
    tape::{Id, Op, real::Real, split::Body},
};

/// A body with a place in the scratch for each value.
///
/// First come the rows of the state, then what stays over all steps, then what an operation makes, for as long as it is needed.
#[derive(Clone, Debug)]
pub struct Interpreter {
    lanes: usize,
    level: Level,
    /// The body that tiles are checked against.
    body: Body,
    /// The leaves that stay over all steps, with their rows.
    fixed: Vec<(Op, usize)>,
    /// The operations of a step.
    steps: Vec<Step>,
    /// Rows of the state to replace after a step, each with its new row, where the result could not be written in place.
    next: Vec<(usize, usize)>,
    /// How many rows the scratch has.
    rows: usize,
}

/// An operation with the places of its result and its operands.
#[derive(Clone, Copy, Debug)]
struct Step {
    op: Op,
    to: usize,
    of: [usize; 3],
}

impl Interpreter {
    /// An interpreter of `body` over rows of `lanes` lanes.
    pub fn new(body: &Body, lanes: usize, level: Level) -> Self {
        let count = body.ops.len();
        let mut last = vec![0; count];
        for (at, op) in body.ops.iter().enumerate() {
            last[at] = at;
            let (operands, n) = op.operands();
            operands[..n].iter().for_each(|id| last[*id as usize] = at);
        }
        body.next.iter().for_each(|id| last[*id as usize] = count);
        // Of each number of the state when it is read last; what replaces it then takes its row at once.
        let mut read = vec![0; body.next.len()];
        let mut replaces: Vec<Option<usize>> = vec![None; count];
        for (s, id) in body.next.iter().enumerate().filter(|(s, _)| !body.keeps(*s)) {
            replaces[*id as usize] = Some(s);
        }
        for (at, op) in body.ops.iter().enumerate() {
            if let Op::State(s) = *op {
                read[s as usize] = read[s as usize].max(last[at]);
            }
        }

        let mut rows = body.next.len();
        let mut free = Vec::new();
        let mut places: Vec<usize> = Vec::with_capacity(count);
        let mut made =
            Interpreter { lanes, level, body: body.clone(), fixed: Vec::new(), steps: Vec::new(), next: Vec::new(), rows: 0 };
        let new = |rows: &mut usize| {
            *rows += 1;
            *rows - 1
        };
        for (at, op) in body.ops.iter().enumerate() {
            if let Op::State(s) = *op {
                places.push(s as usize);
                continue;
            }
            if matches!(op, Op::Row(_) | Op::Uniform(_) | Op::Const(_)) {
                places.push(new(&mut rows));
                made.fixed.push((*op, places[at] * lanes));
                continue;
            }
            // The place of an operand that is not needed any more can be taken at once: an operation goes lane by lane.
            let (operands, n) = op.operands();
            for (i, id) in operands[..n].iter().enumerate() {
                if last[*id as usize] == at && !operands[..i].contains(id) && is_made(body.ops[*id as usize]) {
                    free.push(places[*id as usize]);
                }
            }
            let home = replaces[at].filter(|s| read[*s] <= at);
            let to = home.unwrap_or_else(|| free.pop().unwrap_or_else(|| new(&mut rows)));
            places.push(to);
            if last[at] == at {
                free.push(to);
            }
            let of = |i: usize| if i < n { places[operands[i] as usize] * lanes } else { to * lanes };
            made.steps.push(Step { op: *op, to: to * lanes, of: [of(0), of(1), of(2)] });
        }
        let moved = (0..body.next.len()).filter(|s| !body.keeps(*s) && places[body.next[*s] as usize] != *s);
        made.next = moved.map(|s| (s * lanes, places[body.next[s] as usize] * lanes)).collect();
        made.rows = rows;
        made
    }
}

impl Interpreter {
    /// How many values it has at once.
    pub(crate) fn rows(&self) -> usize {
        self.rows
    }
}

/// Whether a value is made anew in every step.
fn is_made(op: Op) -> bool {
    !matches!(op, Op::State(_) | Op::Row(_) | Op::Uniform(_) | Op::Const(_))
}

impl<T: Real> Kernel<T> for Interpreter {
    fn lanes(&self) -> usize {
        self.lanes
    }

    fn pool(&self, uniforms: &[T]) -> Vec<T> {
        uniforms.to_vec()
    }

    fn run(&self, tile: &mut Tile<T>, scratch: &mut Vec<T>) {
        check(&self.body, self.lanes, tile);
        assert!(tile.pool.len() >= self.body.uniforms, "pool");
        // From the start of a line of the cache on, so that no vector lies across two: fewer numbers than a line has are before
        // it.
        let enough = self.rows * self.lanes + 64 / size_of::<T>() - 1;
        if scratch.len() < enough {
            scratch.resize(enough, T::default());
        }
        let start = (scratch.as_ptr() as usize).wrapping_neg() % 64 / size_of::<T>();
        let scratch = &mut scratch[start..];
        with_isa!(self.level, |isa| isa.run(Run { of: self, tile, scratch }));
    }
}

struct Run<'a, 'b, T> {
    of: &'a Interpreter,
    tile: &'a mut Tile<'b, T>,
    scratch: &'a mut [T],
}

impl<T: Real> Task for Run<'_, '_, T> {
    #[inline(always)]
    fn run(self) {
        let Run { of, tile, scratch } = self;
        let (lanes, numbers) = (of.lanes, of.body.next.len() * of.lanes);
        scratch[..numbers].copy_from_slice(&tile.state[..numbers]);
        for (op, to) in &of.fixed {
            let to = &mut scratch[*to..*to + lanes];
            match *op {
                Op::Row(i) => to.copy_from_slice(&tile.rows[i as usize * lanes..][..lanes]),
                Op::Uniform(i) => to.fill(tile.pool[i as usize]),
                Op::Const(bits) => to.fill(T::from_pattern(bits)),
                _ => {}
            }
        }
        for step in 0..tile.steps {
            let entries = &tile.per_step[(step * of.body.per_step).min(tile.per_step.len())..];
            for Step { op, to, of } in &of.steps {
                match *op {
                    Op::PerStep(i) => scratch[*to..*to + lanes].fill(T::from_pattern(entries[i as usize])),
                    Op::Held(i) => {
                        let from = entries[i as usize] as usize;
                        scratch[*to..*to + lanes].copy_from_slice(&tile.held[from..from + lanes]);
                    }
                    Op::Gather(_) => {
                        for l in 0..lanes {
                            // An index out of range comes from a NaN; its result is discarded.
                            let place = scratch[of[0] + l].wide() as usize + l;
                            scratch[*to + l] = tile.held.get(place).copied().unwrap_or(T::NAN);
                        }
                    }
                    op => apply(op, scratch, *to, *of, lanes),
                }
            }
            for (to, from) in &of.next {
                scratch.copy_within(*from..*from + lanes, *to);
            }
        }
        tile.state[..numbers].copy_from_slice(&scratch[..numbers]);
    }
}

/// Numbers that are read before any of their results is written: no check is needed whether rows are the same.
const TOGETHER: usize = 8;

/// An operation over rows of the scratch. Each kind has a loop of its own, which is vector code.
#[inline(always)]
fn apply<T: Real>(op: Op, scratch: &mut [T], to: usize, [a, b, c]: [usize; 3], lanes: usize) {
    // Cells, because the place of an operand may be that of the result.
    let cells = Cell::from_mut(scratch).as_slice_of_cells();
    let row = |at: usize| cells[at..at + lanes].as_chunks::<TOGETHER>();
    let ((to, to_end), (a, a_end), (b, b_end), (c, c_end)) = (row(to), row(a), row(b), row(c));
    macro_rules! each {
        ($($kind:pat $(if $known:expr)? => $same:expr),* $(,)?) => {
            match op {
                $($kind $(if $known)? => {
                    for (((to, a), b), c) in to.iter().zip(a).zip(b).zip(c) {
                        let made: [T; TOGETHER] =
                            std::array::from_fn(|l| T::apply($same, a[l].get(), b[l].get(), c[l].get()));
                        to.iter().zip(made).for_each(|(to, made)| to.set(made));
                    }
                    for (((to, a), b), c) in to_end.iter().zip(a_end).zip(b_end).zip(c_end) {
                        to.set(T::apply($same, a.get(), b.get(), c.get()));
                    }
                })*
                Op::ShiftUp(..) | Op::ShiftDown(..) => {
                    to.iter().flatten().chain(to_end).for_each(|to| to.set(T::from_pattern(0)));
                }
                // Not a wild card: the compiler asks for a line for each new operation.
                Op::State(_) | Op::Param(_) | Op::Step | Op::Time | Op::Const(_) | Op::Sample(..) => {}
                Op::Row(_) | Op::Uniform(_) | Op::PerStep(_) | Op::Held(_) | Op::Gather(_) => {}
            }
        };
    }
    const ANY: Id = 0;
    // A loop that knows that something is left of a number need not ask in every lane.
    let bits = 8 * size_of::<T>() as u32;
    each! {
        Op::Add(..) => Op::Add(ANY, ANY),
        Op::Sub(..) => Op::Sub(ANY, ANY),
        Op::Mul(..) => Op::Mul(ANY, ANY),
        Op::Div(..) => Op::Div(ANY, ANY),
        Op::MulAdd(..) => Op::MulAdd(ANY, ANY, ANY),
        Op::MulSub(..) => Op::MulSub(ANY, ANY, ANY),
        Op::SubMul(..) => Op::SubMul(ANY, ANY, ANY),
        Op::Sqrt(_) => Op::Sqrt(ANY),
        Op::Neg(_) => Op::Neg(ANY),
        Op::Floor(_) => Op::Floor(ANY),
        Op::Less(..) => Op::Less(ANY, ANY),
        Op::LessEqual(..) => Op::LessEqual(ANY, ANY),
        Op::Equal(..) => Op::Equal(ANY, ANY),
        Op::Select(..) => Op::Select(ANY, ANY, ANY),
        Op::And(..) => Op::And(ANY, ANY),
        Op::Or(..) => Op::Or(ANY, ANY),
        Op::Xor(..) => Op::Xor(ANY, ANY),
        Op::AddBits(..) => Op::AddBits(ANY, ANY),
        Op::SubBits(..) => Op::SubBits(ANY, ANY),
        Op::ShiftUp(_, n) if n < bits => Op::ShiftUp(ANY, n),
        Op::ShiftDown(_, n) if n < bits => Op::ShiftDown(ANY, n),
        Op::Copy(_) => Op::Copy(ANY),
    }
}

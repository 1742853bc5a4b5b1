//! The portable interpreter: operation after operation, each over all lanes of a tile.
//!
//! It serves where no machine code may be written, where a run is too short for writing any, and the tests: it is what a kernel
//! writer is held against.

use super::{Kernel, Tile, check};
use crate::{
    isa::{Level, Task, with_isa},
    tape::{Id, Op, eval, split::Body},
};

/// A body with a place for each value.
#[derive(Clone, Debug)]
pub struct Interpreter {
    body: Body,
    lanes: usize,
    level: Level,
    /// Where each value is while it is needed.
    places: Vec<u32>,
    /// How many values there are at once at most.
    most: usize,
}

impl Interpreter {
    /// For rows of so many lanes.
    pub fn new(body: &Body, lanes: usize, level: Level) -> Self {
        let mut last = vec![0usize; body.ops.len()];
        for (at, op) in body.ops.iter().enumerate() {
            last[at] = at;
            let (operands, n) = op.operands();
            operands[..n].iter().for_each(|id| last[*id as usize] = at);
        }
        body.next.iter().for_each(|id| last[*id as usize] = body.ops.len());
        let (mut free, mut most, mut places) = (Vec::new(), 0, Vec::with_capacity(body.ops.len()));
        for (at, op) in body.ops.iter().enumerate() {
            // The place of an operand that is not needed any more can be taken at once: an operation goes lane by lane.
            let (operands, n) = op.operands();
            for (i, id) in operands[..n].iter().enumerate() {
                if last[*id as usize] == at && !operands[..i].contains(id) {
                    free.push(places[*id as usize]);
                }
            }
            let place = free.pop().unwrap_or_else(|| {
                most += 1;
                most as u32 - 1
            });
            places.push(place);
            if last[at] == at {
                free.push(place);
            }
        }
        Interpreter { body: body.clone(), lanes, level, places, most }
    }
}

impl Kernel for Interpreter {
    fn lanes(&self) -> usize {
        self.lanes
    }

    fn pool(&self, uniforms: &[f64]) -> Vec<f64> {
        uniforms.to_vec()
    }

    fn run(&self, tile: &mut Tile, scratch: &mut Vec<f64>) {
        check(&self.body, self.lanes, tile);
        assert!(tile.pool.len() >= self.body.uniforms, "pool");
        scratch.resize(scratch.len().max(self.most * self.lanes), 0.0);
        with_isa!(self.level, |isa| isa.run(Run { of: self, tile, scratch }));
    }
}

struct Run<'a, 'b> {
    of: &'a Interpreter,
    tile: &'a mut Tile<'b>,
    scratch: &'a mut [f64],
}

impl Task for Run<'_, '_> {
    #[inline(always)]
    fn run(self) {
        let Run { of, tile, scratch } = self;
        let (lanes, body) = (of.lanes, &of.body);
        let at = |id: Id| of.places[id as usize] as usize * lanes;
        for step in 0..tile.steps {
            for (id, op) in body.ops.iter().enumerate() {
                let to = at(id as Id);
                match *op {
                    Op::State(i) => scratch[to..to + lanes].copy_from_slice(&tile.state[i as usize * lanes..][..lanes]),
                    Op::Row(i) => scratch[to..to + lanes].copy_from_slice(&tile.rows[i as usize * lanes..][..lanes]),
                    Op::Uniform(i) => scratch[to..to + lanes].fill(tile.pool[i as usize]),
                    Op::Const(bits) => scratch[to..to + lanes].fill(f64::from_bits(bits)),
                    Op::PerStep(i) => {
                        scratch[to..to + lanes].fill(f64::from_bits(tile.per_step[step * body.per_step + i as usize]));
                    }
                    Op::Held(i) => {
                        let from = tile.per_step[step * body.per_step + i as usize] as usize;
                        scratch[to..to + lanes].copy_from_slice(&tile.held[from..from + lanes]);
                    }
                    Op::Gather(place) => {
                        let from = at(place);
                        for l in 0..lanes {
                            // A place that is none is a NaN's: what comes of it is of no use to anybody.
                            let place = scratch[from + l] as usize + l;
                            scratch[to + l] = tile.held.get(place).copied().unwrap_or(f64::NAN);
                        }
                    }
                    _ => apply(*op, scratch, &at, to, lanes),
                }
            }
            for (s, id) in body.next.iter().enumerate() {
                let from = at(*id);
                tile.state[s * lanes..(s + 1) * lanes].copy_from_slice(&scratch[from..from + lanes]);
            }
        }
    }
}

/// An operation over rows of the scratch. Each kind has a loop of its own, which is vector code.
#[inline(always)]
fn apply(op: Op, scratch: &mut [f64], at: &impl Fn(Id) -> usize, to: usize, lanes: usize) {
    let ([a, b, c], n) = op.operands();
    let (a, b, c) = (at(a), if n > 1 { at(b) } else { to }, if n > 2 { at(c) } else { to });
    macro_rules! each {
        ($($kind:pat => $same:expr),* $(,)?) => {
            match op {
                $($kind => {
                    // Cells, because the place of an operand may be that of the result.
                    let cells = std::cell::Cell::from_mut(&mut *scratch).as_slice_of_cells();
                    let (to, a, b, c) = (&cells[to..to + lanes], &cells[a..a + lanes], &cells[b..b + lanes], &cells[c..c + lanes]);
                    for l in 0..lanes {
                        let made = eval::apply($same, a[l].get().to_bits(), b[l].get().to_bits(), c[l].get().to_bits());
                        to[l].set(f64::from_bits(made));
                    }
                })*
                _ => {}
            }
        };
    }
    each! {
        Op::Add(..) => Op::Add(0, 0),
        Op::Sub(..) => Op::Sub(0, 0),
        Op::Mul(..) => Op::Mul(0, 0),
        Op::Div(..) => Op::Div(0, 0),
        Op::Sqrt(_) => Op::Sqrt(0),
        Op::Neg(_) => Op::Neg(0),
        Op::Floor(_) => Op::Floor(0),
        Op::Less(..) => Op::Less(0, 0),
        Op::LessEqual(..) => Op::LessEqual(0, 0),
        Op::Equal(..) => Op::Equal(0, 0),
        Op::Select(..) => Op::Select(0, 0, 0),
        Op::And(..) => Op::And(0, 0),
        Op::Or(..) => Op::Or(0, 0),
        Op::Xor(..) => Op::Xor(0, 0),
        Op::AddBits(..) => Op::AddBits(0, 0),
        Op::ShiftUp(_, n) => Op::ShiftUp(0, n),
        Op::ShiftDown(_, n) => Op::ShiftDown(0, n),
        Op::Copy(_) => Op::Copy(0),
    }
}

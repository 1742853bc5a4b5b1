//! Whether vectors are what the writer relies on: nothing outside of a tile is read or written.

use super::packed::{MOST_LANES, Make, Move, Packed, Vector};
use crate::tape::{Op, split::Body};

impl Packed {
    /// Whether these can be the vectors of a body, which is sound itself.
    pub fn is_sound(&self, body: &Body) -> bool {
        let mut taken = vec![false; self.vectors.len()];
        self.vectors.iter().enumerate().all(|(at, vector)| self.is_vector_sound(at, vector, body))
            && self.state.iter().enumerate().all(|(s, state)| {
                let is_leaf = |at: u32, make: &Make| self.vectors.get(at as usize).is_some_and(|vector| vector.make == *make);
                let is_made = |at: u32| {
                    self.vectors.get(at as usize).is_some_and(|vector| matches!(vector.make, Make::Op(_) | Make::Move(_)))
                };
                (1..=MOST_LANES).contains(&state.numbers.len())
                    && state.numbers.iter().all(|number| (*number as usize) < body.next.len())
                    && is_leaf(state.old, &Make::State(s as u32))
                    && is_made(state.next)
                    && !std::mem::replace(&mut taken[state.next as usize], true)
            })
    }

    fn is_vector_sound(&self, at: usize, vector: &Vector, body: &Body) -> bool {
        let operands = match &vector.make {
            Make::Op(op) => op.operands().1,
            Make::Move(Move::Pick(_) | Move::Join) => 2,
            Make::Move(_) => 1,
            Make::State(_) | Make::Fixed(_) | Make::Now(_) => 0,
        };
        // What changes from step to step is a single number in memory: only moves, which fetch it, may take it for the lane of a
        // vector.
        let is_whole = |of: &u32| vector.width == 1 || !matches!(self.vectors[*of as usize].make, Make::Now(_));
        matches!(vector.width, 1 | 2 | 4)
            && vector.operands as usize == operands
            && vector.of().iter().all(|of| (*of as usize) < at)
            && match &vector.make {
                Make::State(s) => self.state.get(*s as usize).is_some_and(|state| state.old as usize == at),
                Make::Fixed(leaves) => {
                    (1..=MOST_LANES).contains(&leaves.len())
                        && leaves.iter().all(|leaf| match *leaf {
                            Op::State(s) => (s as usize) < body.next.len(),
                            Op::Row(i) => (i as usize) < body.rows,
                            Op::Uniform(i) => (i as usize) < body.uniforms,
                            Op::Const(_) => true,
                            _ => false,
                        })
                }
                // Where samples are held is checked for the leaves of the body.
                Make::Now(op) => vector.width == 1 && matches!(op, Op::PerStep(_) | Op::Held(_)) && body.ops.contains(op),
                Make::Op(op) => {
                    let is_known = match *op {
                        Op::ShiftUp(_, places) | Op::ShiftDown(_, places) => places < 64,
                        Op::Sample(..) | Op::Gather(_) => false,
                        // Of a choice it is asked whether its first operands are masks.
                        Op::Select(..) => {
                            vector.lanes.iter().all(|id| matches!(body.ops.get(*id as usize), Some(Op::Select(..))))
                        }
                        op => !op.is_leaf(),
                    };
                    is_known && vector.of().iter().all(is_whole)
                }
                Make::Move(to) => vector.width == if matches!(to, Move::Pick(_) | Move::High) { 2 } else { 4 },
            }
    }
}

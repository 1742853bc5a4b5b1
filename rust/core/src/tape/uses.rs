//! How the values of a tape are used: what decides which of them are fused.

use super::{Id, Op, Tape};

/// Use counts, ranks and step dependence of the values needed for the roots.
pub(super) struct UseCounts {
    pub needed: Vec<bool>,
    /// How often each is read.
    pub reads: Vec<u32>,
    pub ranks: Vec<u32>,
    /// Whether it depends on the step h.
    pub of_step: Vec<bool>,
}

impl UseCounts {
    pub(crate) fn new(tape: &Tape, roots: &[Id]) -> UseCounts {
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
        UseCounts { needed, reads, ranks, of_step }
    }
}

/// A number for each value that is needed. Values are sorted by the depth of their graph; equally deep ones by the name of the
/// operation, by its constants, and by the ranks of its operands, which are sorted where the operation commutes.
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
            (op.name(), op.extra(), of, n)
        });
        for id in level {
            ranks[id as usize] = next;
            next += 1;
        }
    }
    ranks
}

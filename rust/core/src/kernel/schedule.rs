//! In which order the operations of a step are written.
//!
//! A CPU begins operations out of order, but sees some hundred at a time. Several interleaved vectors give it enough to do. A long step
//! leaves no registers for a second vector, and a single member has none: written down function after function, such a step is a row of
//! chains, each longer than what the CPU sees. So an operation that would wait for its operands is put off, and the first one behind it
//! that need not wait goes before it.

use std::collections::BTreeSet;

use super::{choose::timing, plan::Plan, shape::Shape};
use crate::tape::Op;

/// The operations in their order: the index of each among those of the plan, and its vector.
pub type Order = Vec<(usize, usize)>;

/// A CPU overlaps the steps of a vector that are shorter than this by itself, and the next vector with them.
const SHORT_STEP_OPERATIONS: usize = 128;
/// If interleaved vectors share more numbers than this, they are read from memory, once for all vectors as long as these keep in turn.
const MOST_SHARED: usize = 12;
/// So many operations that could be next are looked at.
const MOST_LOOKED_AT: usize = 64;
/// A CPU begins two operations on long vectors in a cycle.
const CYCLES_PER_OPERATION: f64 = 0.5;

/// Operation after operation, each for all vectors that are interleaved.
pub fn in_turn(operations: usize, shape: Shape) -> Order {
    let mut order = Vec::with_capacity(operations * shape.block_vectors);
    for first in (0..shape.block_vectors).step_by(shape.interleaved) {
        let team = first..shape.block_vectors.min(first + shape.interleaved);
        order.extend((0..operations).flat_map(|i| team.clone().map(move |vector| (i, vector))));
    }
    order
}

/// The same where that is well, else with fewer waits. `ops` are those of the body of the plan.
pub fn order<D: Copy>(plan: &Plan<D>, ops: &[Op], shape: Shape) -> Order {
    let order = in_turn(plan.steps.len(), shape);
    let alone = shape.width == 1 && shape.block_vectors == 1;
    let registers = shape.registers();
    let shared = plan.sources.iter().filter(|source| source.is_shared()).count();
    // How many results may wait to be used. More than there are registers: it costs less to spill some than to wait.
    let e = |n: &str, d: usize| std::env::var(n).map_or(d, |x| x.parse().unwrap());
    let most_waiting = if shape.interleaved.min(shape.block_vectors) == 1 { e("X_MW1", 8) * registers / 4 } else { e("X_MW2", 3) * registers / 4 };
    match shape.interleaved.min(shape.block_vectors) {
        1 if !alone && plan.steps.len() < SHORT_STEP_OPERATIONS => order,
        1 => Waits::new(plan, ops).shortened(order, most_waiting, alone),
        _ if shared <= MOST_SHARED => Waits::new(plan, ops).shortened(order, most_waiting, false),
        _ => order,
    }
}

/// What waits for what.
struct Waits {
    /// Of each operation those that make its operands.
    operands: Vec<Vec<usize>>,
    /// Those that use its result.
    users: Vec<Vec<usize>>,
    /// How long it takes, and how long until the same unit can begin another one.
    time: Vec<(f64, f64)>,
}

impl Waits {
    fn new<D: Copy>(plan: &Plan<D>, ops: &[Op]) -> Waits {
        let mut maker = vec![None; plan.sources.len()];
        for (i, step) in plan.steps.iter().enumerate() {
            maker[step.id as usize] = Some(i);
        }
        let mut users = vec![Vec::new(); plan.steps.len()];
        let mut operands = Vec::with_capacity(plan.steps.len());
        for (i, step) in plan.steps.iter().enumerate() {
            let mut of: Vec<usize> = step.of().iter().filter_map(|id| maker[*id as usize]).collect();
            of.sort_unstable();
            of.dedup();
            of.iter().for_each(|made| users[*made].push(i));
            operands.push(of);
        }
        let time = plan.steps.iter().map(|step| timing(ops[step.id as usize])).collect();
        Waits { operands, users, time }
    }

    /// Of each operation the time from its start to the end of the step.
    fn to_the_end(&self) -> Vec<f64> {
        let mut rest = vec![0.0f64; self.time.len()];
        for i in (0..rest.len()).rev() {
            rest[i] = self.time[i].0 + self.users[i].iter().map(|user| rest[*user]).fold(0.0, f64::max);
        }
        rest
    }

    /// The order, changed where an operation would wait. At most so many results wait to be used, if that can be. If the vector is alone,
    /// what has the longest way to the end goes first: there is no other vector whose work would fill the waits at the end.
    fn shortened(&self, mut order: Order, most_waiting: usize, alone: bool) -> Order {
        if alone {
            let rest = self.to_the_end();
            order.sort_by(|(a, _), (b, _)| rest[*b].total_cmp(&rest[*a]));
        }
        let operations = self.time.len();
        // Of an operation for a vector its place in the order.
        let mut place = vec![0; order.len()];
        let number = |(i, vector): (usize, usize)| vector * operations + i;
        order.iter().enumerate().for_each(|(at, each)| place[number(*each)] = at);
        let mut missing: Vec<usize> = order.iter().map(|(i, _)| self.operands[*i].len()).collect();
        let mut uses: Vec<usize> = order.iter().map(|(i, _)| self.users[*i].len()).collect();
        let mut can_begin = vec![0.0f64; order.len()];
        let mut ready: BTreeSet<usize> = (0..order.len()).filter(|at| missing[*at] == 0).collect();
        let mut made = Vec::with_capacity(order.len());
        let (mut now, mut waiting, mut slow_unit) = (0.0f64, 0, 0.0f64);
        while !ready.is_empty() {
            let is_full = waiting >= most_waiting;
            let mut best: Option<(usize, (usize, f64))> = None;
            for &at in ready.iter().take(MOST_LOOKED_AT) {
                let (i, vector) = order[at];
                let begin = can_begin[at].max(now).max(if self.is_slow(i) { slow_unit } else { 0.0 });
                let ends = || self.operands[i].iter().filter(|of| uses[place[number((**of, vector))]] == 1).count();
                let more = if is_full { usize::from(uses[at] > 0).saturating_sub(ends()) } else { 0 };
                if best.is_none_or(|(_, than)| (more, begin) < than) {
                    best = Some((at, (more, begin)));
                }
                if more == 0 && begin <= now {
                    break;
                }
            }
            let Some((at, (_, begin))) = best else { break };
            ready.remove(&at);
            let (i, vector) = order[at];
            let (latency, busy) = self.time[i];
            if self.is_slow(i) {
                slow_unit = begin + busy;
            }
            waiting += usize::from(uses[at] > 0);
            for of in &self.operands[i] {
                let of = place[number((*of, vector))];
                uses[of] -= 1;
                waiting -= usize::from(uses[of] == 0);
            }
            for user in &self.users[i] {
                let user = place[number((*user, vector))];
                can_begin[user] = can_begin[user].max(begin + latency);
                missing[user] -= 1;
                if missing[user] == 0 {
                    ready.insert(user);
                }
            }
            made.push((i, vector));
            now = begin + CYCLES_PER_OPERATION;
        }
        made
    }

    /// Whether its unit cannot begin one in every cycle: roots and quotients.
    fn is_slow(&self, i: usize) -> bool {
        self.time[i].1 > 1.0
    }
}

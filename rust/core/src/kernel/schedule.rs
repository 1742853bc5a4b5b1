//! The order in which the operations of a step are written.
//!
//! A CPU executes out of order, but only among the next few hundred operations. Several interleaved vectors give it enough to do.
//! A long step leaves no registers for a second vector, and a single member has none: written function after function, such a
//! step is a row of chains, each longer than what the CPU sees. So an operation that would wait for its operands is put off, and
//! the first one after it that need not wait goes before it.

use std::collections::BTreeSet;

use super::{plan::KernelPlan, shape::Shape, timing::timing};
use crate::tape::Op;

/// The operations in their order: the index of each among those of the plan, and its vector.
pub type Order = Vec<(usize, usize)>;

/// The CPU overlaps shorter steps of a vector with those of the next vector by itself.
const MIN_STEP_OPERATIONS: usize = 128;
/// If interleaved vectors share more numbers than this, these are read from memory: once for all vectors, if one follows the
/// other.
const MAX_SHARED: usize = 12;
/// How many results of a single vector may wait to be used, for each register, if they do not fit into registers in any case:
/// fewer waits then gain more than spills cost.
const MAX_WAITING_PER_REGISTER: usize = 2;
/// Likewise for vectors one after the other, some of which wait for roots and quotients, also where there are fewer registers.
const MAX_WAITING_AROUND_SLOW: usize = 32;
/// Results of a single vector that may wait if the operation with the longest way to the end goes first: of a wide step nearly
/// all would.
const MAX_WAITING_LONGEST: usize = 128;
/// Operations by which an interleaved vector is behind the one before it: some units make its sums while others make products of
/// the one before. Fitted to the fastest numbers on the scenes of the benchmarks; less where steps are so short that it would
/// leave gaps.
const MAX_BEHIND: usize = 3;
const MIN_OPERATIONS_PER_BEHIND: usize = 6;
/// The most such operations where a single vector leaves no registers, as with three bodies in space: in step, all vectors need
/// most at once, so they are spread. Fitted likewise, to two to four bodies; two vectors gain nothing by it.
const MAX_BEHIND_IF_WIDE: usize = 24;
/// Ready operations, with operands made or under way, that are compared for the next place, from the first one on.
const MAX_COMPARED: usize = 64;
/// A CPU begins two operations on long vectors in a cycle.
const CYCLES_PER_OPERATION: f64 = 0.5;

/// Operation after operation, each for all vectors that are interleaved; each vector `behind` operations after the one before.
pub fn in_turn(operations: usize, shape: Shape, behind: usize) -> Order {
    let mut order = Vec::with_capacity(operations * shape.block_vectors);
    for first in (0..shape.block_vectors).step_by(shape.interleaved) {
        let team = first..shape.block_vectors.min(first + shape.interleaved);
        let moments = 0..operations + behind * (team.len() - 1);
        let at =
            |now: usize| team.clone().enumerate().filter_map(move |(j, vector)| Some((now.checked_sub(behind * j)?, vector)));
        order.extend(moments.flat_map(at).filter(|(i, _)| *i < operations));
    }
    order
}

/// The order in which a plan is written; `ops` are the operations of its body.
pub(super) fn order<I: Copy>(plan: &KernelPlan<I>, ops: &[Op], shape: Shape) -> Order {
    let together = shape.interleaved.min(shape.block_vectors);
    let interleaves = together > 1;
    let is_single = shape.width == 1 && shape.block_vectors == 1;
    let shared = plan.sources.iter().filter(|source| source.is_shared()).count();
    let waits = Waits::of(plan, ops, shape);
    let has_slow = (0..plan.steps.len()).any(|i| waits.is_slow(i));
    if has_slow && !interleaves && !shape.resident && shape.block_vectors > 1 {
        // Roots and quotients have one unit for all vectors. Side by side, all would come to it at once and wait for it, and then
        // leave it idle at once. So each vector goes as far as it can, and the next one fills its waits.
        return waits.shortened(&in_turn(plan.steps.len(), shape, 0), MAX_WAITING_AROUND_SLOW);
    }
    // A state that is in registers leaves none to interleaved vectors for more results that wait.
    let is_best =
        if interleaves { shape.resident || shared > MAX_SHARED } else { !is_single && plan.steps.len() < MIN_STEP_OPERATIONS };
    // The other registers hold shared numbers and the state.
    let fit = shape.registers() * 3 / 4;
    // With 16 registers a distance gains here what it loses there.
    let may_be_behind = shape.registers() > 16;
    if may_be_behind && together > 2 && !shape.resident && !has_slow && waits.width(plan) > fit {
        return in_turn(plan.steps.len(), shape, MAX_BEHIND_IF_WIDE.min(plan.steps.len() / together));
    }
    let behind = if may_be_behind { MAX_BEHIND.min(plan.steps.len() / MIN_OPERATIONS_PER_BEHIND) } else { 0 };
    if is_best {
        return in_turn(plan.steps.len(), shape, behind);
    }
    // Vectors that wait for the one unit of roots and quotients fall behind each other by that.
    let order = in_turn(plan.steps.len(), shape, if has_slow { 0 } else { behind });
    if interleaves {
        return waits.shortened(&order, fit);
    }
    let waiting = waits.waiting(&order);
    let most_waiting = if waiting <= fit { waiting } else { MAX_WAITING_PER_REGISTER * shape.registers() };
    let longest = is_single.then(|| waits.longest_first(order.clone()));
    let order = longest.filter(|longest| waits.waiting(longest) <= MAX_WAITING_LONGEST).unwrap_or(order);
    waits.shortened(&order, most_waiting)
}

/// The dependences of operations, and their latencies.
pub struct Waits {
    /// For each operation, the operations that make its operands.
    operands: Vec<Vec<usize>>,
    /// For each operation, the operations that use its result.
    users: Vec<Vec<usize>>,
    /// For each operation, after how many cycles its result is there, and after how many its unit can begin another one.
    time: Vec<[f64; 2]>,
}

impl Waits {
    /// The dependences of operations whose operands come first: for each, the operations that make its operands, and its times.
    pub fn new(operands: Vec<Vec<usize>>, time: Vec<[f64; 2]>) -> Waits {
        let mut users = vec![Vec::new(); operands.len()];
        for (i, of) in operands.iter().enumerate() {
            of.iter().for_each(|made| users[*made].push(i));
        }
        Waits { operands, users, time }
    }

    fn of<I: Copy>(plan: &KernelPlan<I>, ops: &[Op], shape: Shape) -> Waits {
        // Half a vector is done in half the time where a unit makes a few numbers after the other.
        let share = if shape.width * shape.bytes < 64 { 0.5 } else { 1.0 };
        let time = |op: Op| {
            let timing = timing(op);
            [timing.latency.into(), if timing.is_slow() { timing.interval() * share } else { timing.interval() }]
        };
        let mut maker = vec![None; plan.sources.len()];
        plan.steps.iter().enumerate().for_each(|(i, step)| maker[step.id as usize] = Some(i));
        let made_by = |ids: &[u32]| {
            let mut of: Vec<usize> = ids.iter().filter_map(|id| maker[*id as usize]).collect();
            of.sort_unstable();
            of.dedup();
            of
        };
        let operands = plan.steps.iter().map(|step| made_by(step.of())).collect();
        Waits::new(operands, plan.steps.iter().map(|step| time(ops[step.id as usize])).collect())
    }

    /// How many registers a vector would need: for the state that it reads, and for the most results that wait.
    fn width<I>(&self, plan: &KernelPlan<I>) -> usize {
        let order = (0..plan.steps.len()).map(|i| (i, 0)).collect();
        plan.old.iter().flatten().count() + self.waiting(&order)
    }

    /// The most results that wait to be used at once, in an order of the operations of one vector.
    pub fn waiting(&self, order: &Order) -> usize {
        let mut uses: Vec<usize> = self.users.iter().map(Vec::len).collect();
        let (mut waiting, mut most) = (0, 0);
        for (i, _) in order {
            waiting += usize::from(uses[*i] > 0);
            for of in &self.operands[*i] {
                uses[*of] -= 1;
                waiting -= usize::from(uses[*of] == 0);
            }
            most = most.max(waiting);
        }
        most
    }

    /// The order in which that goes first which has the longest way to the end of the step: no other vector fills the waits
    /// there.
    pub fn longest_first(&self, mut order: Order) -> Order {
        let mut rest = vec![0.0f64; self.time.len()];
        for i in (0..rest.len()).rev() {
            rest[i] = self.time[i][0] + self.users[i].iter().map(|user| rest[*user]).fold(0.0, f64::max);
        }
        order.sort_by(|(a, _), (b, _)| rest[*b].total_cmp(&rest[*a]));
        order
    }

    /// The order, changed where an operation would wait. If possible, at most `most_waiting` results wait to be used.
    pub fn shortened(&self, order: &Order, most_waiting: usize) -> Order {
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
            for &at in ready.iter().take(MAX_COMPARED) {
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
            let [latency, busy] = self.time[i];
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

    /// Whether its unit cannot begin one in every cycle.
    fn is_slow(&self, i: usize) -> bool {
        self.time[i][1] > 1.0
    }
}

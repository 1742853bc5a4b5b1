//! The order of the operations of a long body: what is made is used soon.
//!
//! A tape has the operations of an array side by side: all differences, then all their squares. Some hundred results then wait at
//! once for operations far behind, each is stored and loaded, and the code of a step becomes twice as long. So operations are put
//! where they are needed: the operands of a next value just before it, and what only frees registers at once.

use crate::tape::{Id, Op, split::Body};

use super::{
    pack::{Packed, Vector, estimate::time_of},
    schedule::Waits,
};

/// A body with at most this many waiting results keeps its order: most are in registers, and the tape's order has fewer waits.
pub(super) const MAX_WAITING: usize = 64;
/// The limit for packed vectors of one member: some that are spilled cost less than a wait.
pub(super) const MAX_WAITING_PACKED: usize = 128;

/// The operands of an operation; a leaf is in memory, and never waits.
#[derive(Clone, Copy)]
struct Node {
    of: [Id; 3],
    n: usize,
    is_leaf: bool,
}

impl Node {
    /// Its different operands.
    fn operands(&self) -> impl Iterator<Item = usize> {
        (0..self.n).filter(|i| !self.of[..*i].contains(&self.of[*i])).map(|i| self.of[i] as usize)
    }
}

/// The body in an order in which fewer results wait to be used, if more than that do.
pub fn in_local_order(body: &Body, most: usize) -> Body {
    let node = |op: &Op| {
        let (of, n) = op.operands();
        Node { of, n, is_leaf: op.is_leaf() }
    };
    let nodes: Vec<Node> = body.ops.iter().map(node).collect();
    let Some((order, place)) = order(&nodes, body.next.iter().copied(), most) else { return body.clone() };
    let ops = order.iter().map(|id| body.ops[*id].with(|of| place[of as usize])).collect();
    Body { ops, next: body.next.iter().map(|id| place[*id as usize]).collect(), ..body.clone() }
}

/// As `in_local_order`, for packed vectors of one member.
pub fn packed_in_local_order(packed: &Packed, most: usize) -> Packed {
    let node = |vector: &Vector| {
        let mut of = [0; 3];
        of[..vector.of().len()].copy_from_slice(vector.of());
        Node { of, n: vector.of().len(), is_leaf: vector.is_leaf() }
    };
    let nodes: Vec<Node> = packed.vectors.iter().map(node).collect();
    let Some((order, _)) = order(&nodes, packed.state.iter().map(|state| state.next), most) else {
        return packed.clone();
    };
    // Leaves come first; what would wait for its operands is put off.
    let made = |of: usize| !nodes[of].is_leaf;
    let operands = nodes.iter().map(|node| node.operands().filter(|of| made(*of)).collect()).collect();
    let time = |vector: &Vector| time_of(&vector.make).map_or([0.0; 2], |timing| [timing.latency.into(), timing.interval()]);
    let waits = Waits::new(operands, packed.vectors.iter().map(time).collect());
    let order = waits.shortened(&order.into_iter().map(|id| (id, 0)).collect(), MAX_WAITING);
    let (made, leaves): (Vec<usize>, Vec<usize>) = order.iter().map(|(id, _)| *id).partition(|id| made(*id));
    let order = [leaves, made].concat();
    let mut place = vec![0; nodes.len()];
    order.iter().enumerate().for_each(|(at, id)| place[*id] = at as Id);
    let mut ordered = packed.clone();
    for (vector, from) in ordered.vectors.iter_mut().zip(&order) {
        *vector = packed.vectors[*from].clone();
        vector.of.iter_mut().take(vector.operands.into()).for_each(|of| *of = place[*of as usize]);
    }
    for state in &mut ordered.state {
        (state.next, state.old) = (place[state.next as usize], place[state.old as usize]);
    }
    ordered
}

/// The order, and the place of each in it; None if what there is is as good.
fn order(nodes: &[Node], roots: impl Iterator<Item = Id>, most: usize) -> Option<(Vec<usize>, Vec<Id>)> {
    let before = waiting(nodes, 0..nodes.len());
    if before <= most {
        return None;
    }
    let order = Walk::new(nodes).order(roots);
    if before <= waiting(nodes, order.iter().copied()) {
        return None;
    }
    let mut place = vec![0; nodes.len()];
    order.iter().enumerate().for_each(|(at, id)| place[*id] = at as Id);
    Some((order, place))
}

/// The most results that wait to be used at once.
fn waiting(nodes: &[Node], order: impl Iterator<Item = usize>) -> usize {
    let mut unread = vec![0u32; nodes.len()];
    nodes.iter().flat_map(Node::operands).for_each(|of| unread[of] += 1);
    let (mut waiting, mut most) = (0, 0);
    for id in order {
        waiting += usize::from(unread[id] > 0 && !nodes[id].is_leaf);
        for of in nodes[id].operands() {
            unread[of] -= 1;
            waiting -= usize::from(unread[of] == 0 && !nodes[of].is_leaf);
        }
        most = most.max(waiting);
    }
    most
}

struct Walk<'a> {
    nodes: &'a [Node],
    /// Users of each operation, one behind the other, and where those of an operation begin; how many of these are not placed
    /// yet, and how many of its operands are not.
    users: Vec<usize>,
    first: Vec<usize>,
    unread: Vec<u32>,
    missing: Vec<u32>,
    /// The longest chain of operations below it.
    height: Vec<u32>,
    is_there: Vec<bool>,
    order: Vec<usize>,
}

impl<'a> Walk<'a> {
    fn new(nodes: &'a [Node]) -> Walk<'a> {
        let count = nodes.len();
        let mut walk = Walk {
            nodes,
            users: Vec::new(),
            first: vec![0; count + 1],
            unread: vec![0; count],
            missing: vec![0; count],
            height: vec![0; count],
            is_there: vec![false; count],
            order: Vec::with_capacity(count),
        };
        for (id, node) in nodes.iter().enumerate() {
            for of in node.operands() {
                walk.first[of + 1] += 1;
                walk.unread[of] += 1;
                walk.missing[id] += 1;
                walk.height[id] = walk.height[id].max(walk.height[of] + 1);
            }
        }
        (0..count).for_each(|id| walk.first[id + 1] += walk.first[id]);
        walk.users = vec![0; walk.first[count]];
        let mut next = walk.first.clone();
        for (id, node) in nodes.iter().enumerate() {
            for of in node.operands() {
                walk.users[next[of]] = id;
                next[of] += 1;
            }
        }
        walk
    }

    /// The operations that read an operation.
    fn users(&self, id: usize) -> &[usize] {
        &self.users[self.first[id]..self.first[id + 1]]
    }

    /// The order of a walk from the roots down.
    fn order(mut self, roots: impl Iterator<Item = Id>) -> Vec<usize> {
        let mut stack = Vec::new();
        for root in roots.map(|id| id as usize).chain(0..self.nodes.len()) {
            stack.push(root);
            while let Some(&id) = stack.last() {
                // What has the longest way comes first: nothing else waits meanwhile.
                let missing = self.nodes[id].operands().filter(|of| !self.is_there[*of]);
                match missing.max_by_key(|of| self.height[*of]) {
                    Some(of) => stack.push(of),
                    None => {
                        stack.pop();
                        self.put(id);
                    }
                }
            }
        }
        self.order
    }

    /// The next operation, and behind it all that frees as many registers as it takes.
    fn put(&mut self, id: usize) {
        let mut ready = vec![id];
        while let Some(id) = ready.pop() {
            if std::mem::replace(&mut self.is_there[id], true) {
                continue;
            }
            self.order.push(id);
            let mut candidates = self.users(id).to_vec();
            for user in &candidates {
                self.missing[*user] -= 1;
            }
            for of in self.nodes[id].operands() {
                self.unread[of] -= 1;
                if self.unread[of] == 1 {
                    candidates.extend(self.users(of).iter().filter(|user| !self.is_there[**user]));
                }
            }
            let frees = |user: &usize| {
                let is_last = |of: usize| self.unread[of] == 1 && !self.nodes[of].is_leaf;
                self.missing[*user] == 0 && !self.is_there[*user] && self.nodes[*user].operands().any(is_last)
            };
            ready.extend(candidates.into_iter().filter(frees));
        }
    }
}

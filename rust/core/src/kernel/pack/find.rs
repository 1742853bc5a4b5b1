//! Finds operations of one member that can be lanes of one vector.
//!
//! The lanes of a vector are operations of one kind at the same *height*: the longest chain of operations below them. So no lane
//! depends on another, nor vectors on each other in a circle. It begins with what is surely worth it, roots and quotients, or
//! with the next values of successive numbers of the state, such as the coordinates of a body. From each vector it goes on to the
//! operands of its lanes and to what is made of them: if these are operations that fit, they become a vector, too.

use std::{
    collections::VecDeque,
    hash::{DefaultHasher, Hash, Hasher},
};

use super::packed::{MOST_LANES, Trial};
use crate::tape::{Id, Op, split::Body};

/// Operations that are lanes of one vector.
#[derive(Debug)]
pub(crate) struct Packs {
    /// The operations of the body; of some that commute the operands have changed places, so that those of a vector are alike.
    pub ops: Vec<Op>,
    /// Two to four operations each.
    pub packs: Vec<Vec<Id>>,
    /// For each operation its vector.
    pub of: Vec<Option<u32>>,
}

impl Packs {
    /// Every operation alone.
    pub(crate) fn none(body: &Body) -> Packs {
        Packs { ops: body.ops.clone(), packs: Vec::new(), of: vec![None; body.ops.len()] }
    }

    /// Whether every operation is alone.
    pub(crate) fn is_empty(&self) -> bool {
        self.packs.is_empty()
    }

    /// The packs that a trial finds.
    pub(crate) fn find(body: &Body, trial: Trial) -> Packs {
        let mut finder = Finder::new(body);
        if trial.together > 1 {
            for numbers in finder.successive(body, trial.together) {
                finder.begin(&numbers);
            }
        }
        if trial.roots > 1 {
            for roots in finder.roots(trial.roots) {
                finder.begin(&roots);
            }
        }
        finder.packs
    }
}

/// The kind of an operation: the operation without its operands.
fn kind(op: Op) -> Op {
    op.with(|_| 0)
}

struct Finder {
    packs: Packs,
    height: Vec<u32>,
    /// Equal for operations of the same form, down to the leaves.
    form: Vec<u64>,
    /// For each operation those that it is an operand of, in order.
    users: Vec<Vec<Id>>,
    /// Vectors whose operands and users were not searched yet.
    queue: VecDeque<u32>,
}

impl Finder {
    fn new(body: &Body) -> Finder {
        let n = body.ops.len();
        let (mut height, mut form, mut users) = (vec![0u32; n], vec![0u64; n], vec![Vec::new(); n]);
        for (id, op) in body.ops.iter().enumerate() {
            let (operands, count) = op.operands();
            let operands = &operands[..count];
            let mut hasher = DefaultHasher::new();
            match *op {
                Op::State(_) => 0.hash(&mut hasher),
                Op::Row(_) | Op::Uniform(_) => 1.hash(&mut hasher),
                _ => kind(*op).hash(&mut hasher),
            }
            let mut forms: Vec<u64> = operands.iter().map(|of| form[*of as usize]).collect();
            if op.commutes() {
                forms.sort_unstable();
            }
            forms.hash(&mut hasher);
            form[id] = hasher.finish();
            height[id] = operands.iter().map(|of| height[*of as usize] + 1).max().unwrap_or(0);
            for (at, of) in operands.iter().enumerate() {
                if !operands[..at].contains(of) {
                    users[*of as usize].push(id as Id);
                }
            }
        }
        Finder { packs: Packs::none(body), height, form, users, queue: VecDeque::new() }
    }

    /// Whether two operations, neither of which is in a vector, may be lanes of one.
    fn fit(&self, a: Id, b: Id) -> bool {
        let (a, b) = (a as usize, b as usize);
        let ops = &self.packs.ops;
        self.height[a] > 0
            && self.height[a] == self.height[b]
            && self.packs.of[a].is_none()
            && self.packs.of[b].is_none()
            && kind(ops[a]) == kind(ops[b])
    }

    /// Groups of the next values of successive numbers of the state.
    fn successive(&self, body: &Body, together: usize) -> Vec<Vec<Id>> {
        let mut groups = Vec::new();
        let mut run: Vec<Id> = Vec::new();
        let mut flush = |run: &mut Vec<Id>| {
            groups.extend(run.chunks(together).map(<[Id]>::to_vec));
            run.clear();
        };
        for s in 0..body.next.len() {
            let id = body.next[s];
            if run.first().is_some_and(|first| !self.fit(*first, id)) {
                flush(&mut run);
            }
            run.push(id);
        }
        flush(&mut run);
        groups
    }

    /// Groups of roots and of quotients of the same form.
    fn roots(&self, together: usize) -> Vec<Vec<Id>> {
        let mut alike: Vec<(u64, Vec<Id>)> = Vec::new();
        for (id, op) in self.packs.ops.iter().enumerate() {
            if matches!(op, Op::Sqrt(_) | Op::Div(..)) && self.packs.of[id].is_none() {
                match alike.iter_mut().find(|(form, _)| *form == self.form[id]) {
                    Some((_, group)) => group.push(id as Id),
                    None => alike.push((self.form[id], vec![id as Id])),
                }
            }
        }
        alike.into_iter().flat_map(|(_, group)| group.chunks(together).map(<[Id]>::to_vec).collect::<Vec<_>>()).collect()
    }

    /// Makes a vector of operations, if they fit, and goes on from there.
    fn begin(&mut self, lanes: &[Id]) {
        self.pack(lanes);
        while let Some(pack) = self.queue.pop_front() {
            let lanes = self.packs.packs[pack as usize].clone();
            self.below(&lanes);
            self.above(&lanes);
        }
    }

    fn pack(&mut self, lanes: &[Id]) -> bool {
        let different = lanes.iter().enumerate().all(|(at, id)| !lanes[..at].contains(id));
        let fits = (2..=MOST_LANES).contains(&lanes.len()) && different && lanes.iter().all(|id| self.fit(lanes[0], *id));
        if fits {
            let pack = self.packs.packs.len() as u32;
            lanes.iter().for_each(|id| self.packs.of[*id as usize] = Some(pack));
            self.align(lanes);
            self.packs.packs.push(lanes.to_vec());
            self.queue.push_back(pack);
        }
        fits
    }

    /// Exchanges operands so that they are like those of the first lane.
    fn align(&mut self, lanes: &[Id]) {
        let first = self.packs.ops[lanes[0] as usize];
        if !first.commutes() {
            return;
        }
        let [p, q, _] = first.operands().0;
        let alike = |a: Id, b: Id| {
            let (i, j) = (a as usize, b as usize);
            let same = self.height[i] == self.height[j] && kind(self.packs.ops[i]) == kind(self.packs.ops[j]);
            2 * u32::from(a == b) + 2 * u32::from(self.form[i] == self.form[j]) + u32::from(same)
        };
        let turned: Vec<Id> = lanes[1..]
            .iter()
            .copied()
            .filter(|id| {
                let [a, b, _] = self.packs.ops[*id as usize].operands().0;
                alike(p, b) + alike(q, a) > alike(p, a) + alike(q, b)
            })
            .collect();
        for id in turned {
            let op = &mut self.packs.ops[id as usize];
            let [a, b, _] = op.operands().0;
            let mut other = [b, a].into_iter();
            *op = op.with(|of| other.next().unwrap_or(of));
        }
    }

    /// Packs the operands of the lanes.
    fn below(&mut self, lanes: &[Id]) {
        let (_, count) = self.packs.ops[lanes[0] as usize].operands();
        for at in 0..count {
            let operands: Vec<Id> = lanes.iter().map(|id| self.packs.ops[*id as usize].operands().0[at]).collect();
            self.pack(&operands);
        }
    }

    /// Packs the users of the lanes.
    fn above(&mut self, lanes: &[Id]) {
        for user in self.users[lanes[0] as usize].clone() {
            if self.packs.of[user as usize].is_some() {
                continue;
            }
            let mut users = vec![user];
            for lane in &lanes[1..] {
                // Rather one of the same form, and the first of several.
                let fitting = self.users[*lane as usize].iter().filter(|other| !users.contains(other) && self.fit(user, **other));
                let best = fitting.min_by_key(|other| self.form[**other as usize] != self.form[user as usize]);
                users.extend(best);
            }
            if users.len() == lanes.len() {
                self.pack(&users);
            }
        }
    }
}

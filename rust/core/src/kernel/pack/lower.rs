//! Lowers packs (operations that are lanes of one vector) to vectors and moves between lanes.
//!
//! An operation may need numbers that are in other vectors, or in another order. Then they are moved; or, with `again` and if
//! that is sooner, they are computed a second time in that order. So the positions of bodies are kept from step to step in the
//! order of the pairs, too, and the distances of pairs need no moves.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, HashMap},
};

use super::{
    estimate,
    find::Packs,
    packed::{Make, Move, Packed, StateVector, Vector},
};
use crate::tape::{Id, Op, split::Body};

/// How many operations back the search goes that estimates when a second computation of numbers would be ready.
const DEPTH: usize = 6;
/// The largest share of operations that may be computed a second time.
const MOST_AGAIN: f64 = 0.5;

/// The vectors of a body; None if they depend on each other in a circle, which operations of the same height do not.
pub(crate) fn lower(body: &Body, packs: &Packs, again: bool) -> Option<Packed> {
    let count = body.ops.len();
    let mut leaves: Vec<Vec<Id>> = vec![Vec::new(); body.next.len()];
    for (id, op) in body.ops.iter().enumerate() {
        if let Op::State(s) = *op {
            leaves[s as usize].push(id as Id);
        }
    }
    let mut lower = Lower {
        body,
        leaves,
        packs,
        places: vec![None; count],
        known: HashMap::new(),
        moved: HashMap::new(),
        halves: HashMap::new(),
        times: Vec::new(),
        out: Packed::default(),
        again: if again { (MOST_AGAIN * packs.packs.len() as f64) as usize + 2 } else { 0 },
    };
    lower.state_of_next();
    for unit in lower.in_order()? {
        lower.make(&unit);
    }
    lower.replace_state();
    Some(lower.needed())
}

struct Lower<'a> {
    body: &'a Body,
    packs: &'a Packs,
    /// For each number of the state, the operations that read it.
    leaves: Vec<Vec<Id>>,
    /// For each operation, the vector and the lane in which it was computed first.
    places: Vec<Option<(u32, u8)>>,
    /// Vectors by their lanes.
    known: HashMap<Vec<Id>, u32>,
    moved: HashMap<(Move, u32, u32), u32>,
    halves: HashMap<u32, u32>,
    /// For each vector, when it is ready, in cycles from the start of the step.
    times: Vec<u64>,
    out: Packed,
    /// How many more operations may be computed a second time.
    again: usize,
}

fn width(lanes: usize) -> u8 {
    if lanes > 2 { 4 } else { lanes as u8 }
}

impl Lower<'_> {
    fn push(&mut self, make: Make, width: u8, of: &[u32], lanes: &[Id]) -> u32 {
        let operands_at = of.iter().map(|of| self.times[*of as usize]).max().unwrap_or(0);
        self.times.push(operands_at + estimate::wait(&make));
        let mut operands = [0; 3];
        operands[..of.len()].copy_from_slice(of);
        self.out.vectors.push(Vector { make, width, of: operands, operands: of.len() as u8, lanes: lanes.to_vec() });
        self.out.vectors.len() as u32 - 1
    }

    fn is_fixed(&self, id: Id) -> bool {
        match self.body.ops[id as usize] {
            Op::State(s) => self.body.keeps(s as usize),
            Op::Row(_) | Op::Uniform(_) | Op::Const(_) => true,
            _ => false,
        }
    }

    /// The number of the state that a leaf reads, if that changes in the step.
    fn state(&self, id: Id) -> Option<u32> {
        match self.body.ops[id as usize] {
            Op::State(s) if !self.body.keeps(s as usize) => Some(s),
            _ => None,
        }
    }

    /// Keeps the state in the order in which its next values are computed, so that nothing is moved at the end of a step.
    fn state_of_next(&mut self) {
        let mut number: HashMap<Id, u32> = HashMap::new();
        for s in (0..self.body.next.len()).filter(|s| !self.body.keeps(*s)) {
            number.insert(self.body.next[s], s as u32);
        }
        let mut done = vec![false; self.body.next.len()];
        for pack in &self.packs.packs {
            let numbers: Option<Vec<u32>> = pack.iter().map(|id| number.get(id).copied()).collect();
            if let Some(numbers) = numbers {
                numbers.iter().for_each(|s| done[*s as usize] = true);
                self.state_vector(numbers, true);
            }
        }
        for s in (0..self.body.next.len()).filter(|s| !self.body.keeps(*s)) {
            if !std::mem::replace(&mut done[s], true) {
                self.state_vector(vec![s as u32], true);
            }
        }
    }

    fn state_vector(&mut self, numbers: Vec<u32>, is_first: bool) -> u32 {
        // A leaf may occur twice, or not at all.
        let ids: Option<Vec<Id>> = numbers.iter().map(|s| self.leaves[*s as usize].first().copied()).collect();
        let make = Make::State(self.out.state.len() as u32);
        let vector = self.push(make, width(numbers.len()), &[], ids.as_deref().unwrap_or(&[]));
        if is_first {
            for (lane, s) in numbers.iter().enumerate() {
                for id in &self.leaves[*s as usize] {
                    self.places[*id as usize] = Some((vector, lane as u8));
                }
            }
        }
        if let Some(ids) = ids {
            self.known.insert(ids, vector);
        }
        self.out.state.push(StateVector { numbers, next: 0, old: vector, is_first });
        vector
    }

    /// Packs and single operations in the order of the body, each after its operands.
    fn in_order(&self) -> Option<Vec<Vec<Id>>> {
        let ops = &self.packs.ops;
        let mut units: Vec<Vec<Id>> = self.packs.packs.clone();
        let mut unit_of: Vec<Option<usize>> = self.packs.of.iter().map(|of| of.map(|of| of as usize)).collect();
        for id in 0..ops.len() {
            if !ops[id].is_leaf() && unit_of[id].is_none() {
                unit_of[id] = Some(units.len());
                units.push(vec![id as Id]);
            }
        }
        let mut waits = vec![0usize; units.len()];
        let mut users: Vec<Vec<usize>> = vec![Vec::new(); units.len()];
        for (unit, lanes) in units.iter().enumerate() {
            for id in lanes {
                let (operands, count) = ops[*id as usize].operands();
                for from in operands[..count].iter().filter_map(|of| unit_of[*of as usize]) {
                    users[from].push(unit);
                    waits[unit] += 1;
                }
            }
        }
        let first = |unit: usize| units[unit].iter().copied().max().unwrap_or(0);
        let mut ready: BinaryHeap<Reverse<(Id, usize)>> =
            (0..units.len()).filter(|unit| waits[*unit] == 0).map(|unit| Reverse((first(unit), unit))).collect();
        let mut order = Vec::with_capacity(units.len());
        while let Some(Reverse((_, unit))) = ready.pop() {
            order.push(unit);
            for user in &users[unit] {
                waits[*user] -= 1;
                if waits[*user] == 0 {
                    ready.push(Reverse((first(*user), *user)));
                }
            }
        }
        (order.len() == units.len()).then(|| order.into_iter().map(|unit| units[unit].clone()).collect())
    }

    fn make(&mut self, lanes: &[Id]) {
        let vector = self.operation(lanes);
        for (lane, id) in lanes.iter().enumerate() {
            self.places[*id as usize] = Some((vector, lane as u8));
        }
    }

    fn operation(&mut self, lanes: &[Id]) -> u32 {
        let op = self.packs.ops[lanes[0] as usize];
        let (_, count) = op.operands();
        let of: Vec<u32> = (0..count).map(|at| self.gather(&self.operands(lanes, at))).collect();
        let vector = self.push(Make::Op(op), width(lanes.len()), &of, lanes);
        self.known.insert(lanes.to_vec(), vector);
        vector
    }

    fn operands(&self, lanes: &[Id], at: usize) -> Vec<Id> {
        lanes.iter().map(|id| self.packs.ops[*id as usize].operands().0[at]).collect()
    }

    /// A vector with these numbers in its first lanes.
    fn gather(&mut self, ids: &[Id]) -> u32 {
        // A fixed number that all lanes share is in a vector of four copies.
        let ids = if self.is_fixed(ids[0]) && ids.iter().all(|id| *id == ids[0]) { &ids[..1] } else { ids };
        if let Some(vector) = self.known.get(ids) {
            return *vector;
        }
        let vector = if ids.iter().all(|id| self.is_fixed(*id)) {
            let leaves = ids.iter().map(|id| self.body.ops[*id as usize]).collect();
            self.push(Make::Fixed(leaves), if ids.len() == 1 { 4 } else { width(ids.len()) }, &[], ids)
        } else if self.again > 0 && ids.len() > 1 && matches!(self.times(ids, DEPTH), (moved, Some(again)) if again < moved) {
            match ids.iter().map(|id| self.state(*id)).collect::<Option<Vec<u32>>>() {
                Some(numbers) => self.state_vector(numbers, false),
                None => {
                    self.again = self.again.saturating_sub(1);
                    self.operation(ids)
                }
            }
        } else {
            self.moved(ids)
        };
        self.known.insert(ids.to_vec(), vector);
        vector
    }

    /// When these numbers are ready, in cycles from the start of the step: if they are moved, and if they are computed a second
    /// time.
    fn times(&self, ids: &[Id], depth: usize) -> (u64, Option<u64>) {
        let places: Option<Vec<(u32, u8)>> = ids.iter().map(|id| self.places[*id as usize]).collect();
        // Only numbers that are lanes of vectors, needed in another order.
        let Some(places) = places.filter(|places| places.iter().all(|(at, _)| self.out.vectors[*at as usize].width > 1)) else {
            return (0, None);
        };
        let made = places.iter().map(|(at, _)| self.times[*at as usize]).max().unwrap_or(0);
        let moved = made
            + if ids.len() == 2 {
                estimate::wait(&Make::Move(Move::Pick(0)))
            } else {
                estimate::wait(&Make::Move(Move::Permute(0)))
            };
        if ids.iter().enumerate().any(|(at, id)| ids[..at].contains(id)) {
            return (moved, None);
        }
        if ids.iter().all(|id| self.state(*id).is_some()) {
            return (moved, Some(0));
        }
        let ops = &self.packs.ops;
        let op = ops[ids[0] as usize];
        let same = |id: &Id| ops[*id as usize].with(|_| 0) == op.with(|_| 0);
        if depth == 0 || op.is_leaf() || matches!(op, Op::Sqrt(_) | Op::Div(..)) || !ids.iter().all(same) {
            return (moved, None);
        }
        let operands = (0..op.operands().1).map(|at| {
            let of = self.operands(ids, at);
            let is_one = of.iter().all(|id| *id == of[0]);
            match self.known.get(if is_one { &of[..1] } else { &of }) {
                Some(vector) => self.times[*vector as usize],
                None if of.iter().all(|id| self.is_fixed(*id)) => 0,
                None => {
                    let (moved, again) = self.times(&of, depth - 1);
                    again.map_or(moved, |again| again.min(moved))
                }
            }
        });
        (moved, Some(operands.max().unwrap_or(0) + estimate::wait(&Make::Op(op))))
    }

    fn moved(&mut self, ids: &[Id]) -> u32 {
        if let &[id] = ids {
            let (half, lane) = self.half(id);
            return if lane == 0 { half } else { self.pick((half, 1), (half, 1)) };
        }
        let places: Vec<(u32, u8)> = ids.iter().map(|id| self.place(*id)).collect();
        let (first, _) = places[0];
        let from_one = places.iter().all(|(vector, _)| *vector == first);
        let in_order = places.iter().enumerate().all(|(at, (_, lane))| at as u8 == *lane);
        if from_one && in_order && width(ids.len()) <= self.out.vectors[first as usize].width {
            return first;
        }
        if let &[a, b] = ids {
            let (low, high) = (self.half(a), self.half(b));
            return if low.0 == high.0 && (low.1, high.1) == (0, 1) { low.0 } else { self.pick(low, high) };
        }
        if from_one {
            // Lanes that are not needed stay where they are.
            let lanes = (0..4).map(|at| places.get(at).map_or(at as u8, |(_, lane)| *lane) << (2 * at));
            return self.shift(Move::Permute(lanes.fold(0, |all, lane| all | lane)), 4, first, None);
        }
        let (low, high) = (self.gather(&ids[..2]), self.gather(&ids[2..]));
        self.shift(Move::Join, 4, low, Some(high))
    }

    /// The vector and lane of a number.
    fn place(&mut self, id: Id) -> (u32, u8) {
        if let Some(place) = self.places[id as usize] {
            return place;
        }
        let op = self.body.ops[id as usize];
        let vector = match self.known.get(&vec![id]) {
            Some(vector) => *vector,
            None if self.is_fixed(id) => self.push(Make::Fixed(vec![op]), 4, &[], &[id]),
            None => self.push(Make::Now(op), 1, &[], &[id]),
        };
        self.known.insert(vec![id], vector);
        self.places[id as usize] = Some((vector, 0));
        (vector, 0)
    }

    /// A vector of two, or the low half of a larger one, with a number in it, and its lane.
    fn half(&mut self, id: Id) -> (u32, u8) {
        let (vector, lane) = self.place(id);
        if lane < 2 {
            return (vector, lane);
        }
        let high = match self.halves.get(&vector) {
            Some(high) => *high,
            None => self.push(Make::Move(Move::High), 2, &[vector], &[]),
        };
        self.halves.insert(vector, high);
        (high, lane - 2)
    }

    fn pick(&mut self, (a, i): (u32, u8), (b, j): (u32, u8)) -> u32 {
        self.shift(Move::Pick(i | j << 1), 2, a, Some(b))
    }

    fn shift(&mut self, to: Move, width: u8, a: u32, b: Option<u32>) -> u32 {
        let key = (to, a, b.unwrap_or(a));
        if let Some(vector) = self.moved.get(&key) {
            return *vector;
        }
        let of: Vec<u32> = std::iter::once(a).chain(b).collect();
        let vector = self.push(Make::Move(to), width, &of, &[]);
        self.moved.insert(key, vector);
        vector
    }

    /// Sets the next value of each vector of the state. That may add vectors of the state, in other orders.
    fn replace_state(&mut self) {
        let mut at = 0;
        let mut taken: Vec<u32> = Vec::new();
        while at < self.out.state.len() {
            let ids: Vec<Id> = self.out.state[at].numbers.iter().map(|s| self.body.next[*s as usize]).collect();
            let mut next = self.gather(&ids);
            let is_made = matches!(self.out.vectors[next as usize].make, Make::Op(_) | Make::Move(_));
            if !is_made || taken.contains(&next) {
                next = self.push(Make::Op(Op::Copy(0)), width(ids.len()), &[next], &ids);
            }
            taken.push(next);
            self.out.state[at].next = next;
            at += 1;
        }
    }

    /// Removes vectors that no other vector needs.
    fn needed(mut self) -> Packed {
        let count = self.out.vectors.len();
        let mut needed = vec![false; count];
        self.out.state.iter().for_each(|state| needed[state.next as usize] = true);
        let mut pending: Vec<usize> = (0..count).filter(|at| needed[*at]).collect();
        while let Some(at) = pending.pop() {
            for of in self.out.vectors[at].of().to_vec() {
                if !std::mem::replace(&mut needed[of as usize], true) {
                    pending.push(of as usize);
                }
            }
        }
        // The old numbers of the state stay as leaves, whether they are read or not.
        self.out.state.iter().for_each(|state| needed[state.old as usize] = true);
        let mut place = vec![0u32; count];
        let mut vectors = Vec::with_capacity(count);
        for (at, mut vector) in self.out.vectors.into_iter().enumerate() {
            if needed[at] {
                let operands = vector.operands as usize;
                vector.of[..operands].iter_mut().for_each(|of| *of = place[*of as usize]);
                place[at] = vectors.len() as u32;
                vectors.push(vector);
            }
        }
        for state in &mut self.out.state {
            (state.next, state.old) = (place[state.next as usize], place[state.old as usize]);
        }
        Packed { vectors, state: self.out.state }
    }
}

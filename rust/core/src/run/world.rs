//! A prepared real-time loop over arrays that belong to somebody else.

use super::{Machine, Model, group::Group, stage::Clock};
use crate::error::Error;

struct Share {
    group: Box<dyn Group>,
    first: usize,
    count: usize,
}

/// Everything that a step needs, made once; a step allocates nothing and checks nothing.
pub struct World {
    clock: Clock,
    shares: Vec<Share>,
    members: usize,
    sizes: (usize, usize),
    carries: bool,
    /// What was last written, if the method carries something else than v: if the arrays differ, somebody moved the bodies.
    written: Option<(Vec<f64>, Vec<f64>)>,
    step: i64,
}

/// How often a world is stepped: nobody knows, but it is made for that.
const MANY: f64 = f64::INFINITY;

fn load(array: &[f64], members: usize, share: (usize, usize), slot: &mut [f64], lanes: usize) {
    let (first, count) = share;
    for (row, slot) in array.chunks_exact(members).zip(slot.chunks_exact_mut(lanes)) {
        slot[..count].copy_from_slice(&row[first..first + count]);
        let last = slot[count - 1];
        slot[count..].fill(last);
    }
}

fn store(array: &mut [f64], members: usize, share: (usize, usize), slot: &[f64], lanes: usize) {
    let (first, count) = share;
    for (row, slot) in array.chunks_exact_mut(members).zip(slot.chunks_exact(lanes)) {
        row[first..first + count].copy_from_slice(&slot[..count]);
    }
}

fn same(array: &[f64], written: &[f64]) -> bool {
    array.iter().zip(written).all(|(a, w)| a.to_bits() == w.to_bits())
}

impl World {
    /// Prepares the groups of all members.
    pub fn new(model: &Model, clock: Clock, machine: Machine, members: usize, step: i64) -> Result<Self, Error> {
        let traced = model.traced()?;
        let mut shares = Vec::new();
        let mut first = 0;
        while first < members {
            let whole = members - first >= model.lanes(&traced, machine, members, MANY)?;
            let mut group = model.group(&traced, machine, if whole { members } else { members - first }, &clock, MANY)?;
            let count = (members - first).min(group.lanes());
            group.prepare(&model.spec, first, count);
            group.settle();
            shares.push(Share { group, first, count });
            first += count;
        }
        let sizes = (traced.shape.v * members, traced.shape.y * members);
        Ok(World { clock, shares, members, sizes, carries: traced.carries, written: None, step })
    }

    /// How many numbers each array holds.
    pub fn sizes(&self) -> (usize, usize) {
        self.sizes
    }

    /// The number of the step at which the world stands.
    pub fn step_number(&self) -> i64 {
        self.step
    }

    /// The time at which the world stands.
    pub fn time(&self) -> f64 {
        self.clock.at(self.step)
    }

    /// `n` steps, in place. `v` and `y` are rows of one number per member.
    pub fn step(&mut self, n: i64, v: &mut [f64], y: &mut [f64]) {
        let (k, until, members) = (self.step, self.step + n, self.members);
        let moved = !matches!(&self.written, Some((a, b)) if same(v, a) && same(y, b));
        for Share { group, first, count } in &mut self.shares {
            let (share, lanes) = ((*first, *count), group.lanes());
            if moved {
                let (v_slot, y_slot) = group.slots_mut();
                load(v, members, share, v_slot, lanes);
                load(y, members, share, y_slot, lanes);
            }
            if moved && self.carries {
                group.start(k);
            }
            group.advance(k, n);
            if !self.carries {
                let (v_slot, y_slot) = group.slots();
                store(v, members, share, v_slot, lanes);
                store(y, members, share, y_slot, lanes);
            }
        }
        if self.carries {
            self.publish(until, v, y);
        }
        self.step = until;
    }

    /// Writes velocities of a method that carries something else, and remembers what was written.
    fn publish(&mut self, k: i64, v: &mut [f64], y: &mut [f64]) {
        let (mut old_v, mut old_y) = self.written.take().unwrap_or_else(|| (vec![0.0; v.len()], vec![0.0; y.len()]));
        for Share { group, first, count } in &mut self.shares {
            let (share, lanes) = ((*first, *count), group.lanes());
            // The array of what was written last serves to keep what is carried meanwhile.
            let carried = &mut old_v[*first..];
            let rows = group.slots().0.len() / lanes;
            for r in 0..rows {
                carried[r * self.members..][..*count].copy_from_slice(&group.slots().0[r * lanes..][..*count]);
            }
            group.finish(k);
            let (v_slot, y_slot) = group.slots();
            store(v, self.members, share, v_slot, lanes);
            store(y, self.members, share, y_slot, lanes);
            for r in 0..rows {
                let kept = &carried[r * self.members..][..*count];
                let slot = &mut group.slots_mut().0[r * lanes..][..lanes];
                slot[..*count].copy_from_slice(kept);
                slot[*count..].fill(kept[*count - 1]);
            }
        }
        old_v.copy_from_slice(v);
        old_y.copy_from_slice(y);
        self.written = Some((old_v, old_y));
    }
}

//! How many cycles a step of one member takes, by a model of a CPU that executes out of order.
//!
//! Each operation begins when its operands are there and a unit for it is free. Several steps are gone through, since a step
//! begins before the one before it has ended. On Zen 4 the numbers are within 5 % of what the kernels take.

use std::{cmp::Reverse, collections::BinaryHeap};

use super::packed::{Make, Move, Packed};
use crate::kernel::timing::{Timing, UNITS, Unit, timing};

/// Operations that a CPU begins in a cycle.
const ISSUED: usize = 6;
/// Operations under way at once.
const WINDOW: usize = 256;
/// Steps that are gone through, and after how many of them the count begins; and the same of steps so long that hardly two of
/// them are under way at once.
const STEPS: [usize; 2] = [6, 3];
const LONG_STEPS: [usize; 2] = [3, 1];
const LONG: usize = 2 * WINDOW;

/// The times of an operation; none of a value that is known before the step.
pub(crate) fn time_of(make: &Make) -> Option<Timing> {
    let latency = match make {
        Make::State(_) | Make::Fixed(_) | Make::Now(_) => return None,
        Make::Op(op) => return Some(timing(*op)),
        Make::Move(Move::Pick(_)) => 1,
        Make::Move(Move::Join) => 2,
        Make::Move(Move::High) => 3,
        Make::Move(Move::Permute(_)) => 4,
    };
    Some(Timing::quick(Unit::Moves, latency))
}

/// Cycles in which units are busy.
struct Occupied {
    busy: Vec<u8>,
    units: u8,
    /// No request will start before this cycle: operations ask in the order in which they are ready.
    from: u64,
}

impl Occupied {
    /// The first cycle from `ready` on at which a unit is free for so long, which it then is not any more.
    fn take(&mut self, ready: u64, cycles: u64) -> u64 {
        self.from = self.from.max(ready);
        let mut start = self.from;
        loop {
            let end = (start + cycles) as usize;
            if self.busy.len() < end {
                self.busy.resize(end + 64, 0);
            }
            match (start as usize..end).rev().find(|cycle| self.busy[*cycle] >= self.units) {
                Some(full) => start = full as u64 + 1,
                None => {
                    self.busy[start as usize..end].iter_mut().for_each(|cycle| *cycle += 1);
                    while self.busy.get(self.from as usize).is_some_and(|cycle| *cycle >= self.units) {
                        self.from += 1;
                    }
                    return start;
                }
            }
        }
    }
}

/// Cycles of a step, with the units that there are (`limited`) or with as many as there are operations.
pub(crate) fn cycles(packed: &Packed, limited: bool) -> f64 {
    let count = packed.vectors.len();
    let [steps, warm] = if count > LONG { LONG_STEPS } else { STEPS };
    let timings: Vec<_> = packed.vectors.iter().map(|vector| time_of(&vector.make)).collect();
    let made: Vec<usize> = (0..count).filter(|at| timings[*at].is_some()).collect();
    let mut users: Vec<Vec<usize>> = vec![Vec::new(); count];
    let mut waits: Vec<u32> = vec![0; count];
    for (at, vector) in packed.vectors.iter().enumerate() {
        vector.of().iter().for_each(|of| users[*of as usize].push(at));
        waits[at] = vector.of().len() as u32;
    }
    // What a vector is after it replaced one of the state, in the step behind; and what enters the window when it leaves that.
    let mut later: Vec<Vec<usize>> = vec![Vec::new(); count];
    packed.state.iter().for_each(|state| later[state.next as usize].push(state.old as usize));
    let mut waits: Vec<u32> = std::iter::repeat_n(waits, steps).flatten().collect();
    packed.state.iter().for_each(|state| (1..steps).for_each(|step| waits[step * count + state.old as usize] += 1));
    let mut ready: Vec<u64> = vec![0; steps * count];
    let order: Vec<usize> = (0..steps).flat_map(|step| made.iter().map(move |at| step * count + at)).collect();
    let mut place = vec![0; steps * count];
    for (n, node) in order.iter().enumerate().filter(|_| limited) {
        place[*node] = n;
        ready[*node] = (n / ISSUED) as u64;
        waits[*node] += u32::from(n >= WINDOW);
    }
    let mut units = UNITS.map(|unit| Occupied { busy: Vec::new(), units: unit.count(), from: 0 });
    let mut next: BinaryHeap<Reverse<(u64, usize)>> =
        (0..steps * count).filter(|node| waits[*node] == 0).map(|node| Reverse((ready[node], node))).collect();
    let mut ends = vec![0u64; steps];
    while let Some(Reverse((time, node))) = next.pop() {
        let (step, at) = (node / count, node % count);
        let done = match timings[at] {
            Some(Timing { unit, latency, busy, .. }) if limited => {
                units[unit as usize].take(time, busy.into()) + u64::from(latency)
            }
            Some(timing) => time + u64::from(timing.latency),
            None => time,
        };
        ends[step] = ends[step].max(done);
        let behind = later[at].iter().filter(|_| step + 1 < steps).map(|old| (step + 1) * count + old);
        let window = (limited && timings[at].is_some()).then(|| order.get(place[node] + WINDOW).copied()).flatten();
        for user in users[at].iter().map(|user| step * count + user).chain(behind).chain(window) {
            ready[user] = ready[user].max(done);
            waits[user] -= 1;
            if waits[user] == 0 {
                next.push(Reverse((ready[user], user)));
            }
        }
    }
    (ends[steps - 1] - ends[warm - 1].min(ends[steps - 1])) as f64 / (steps - warm) as f64
}

/// After how many cycles a vector is there, when what it is made of is.
pub(crate) fn wait(make: &Make) -> u64 {
    time_of(make).map_or(0, |timing| timing.latency.into())
}

//! Several systems side by side: a lane is a system.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use super::{
    law::{phi, pull},
    meeting,
};
use crate::isa::Task;

pub(super) struct SideBySide<'a, const D: usize, const LAW: u8, const ENERGY: bool, const L: usize> {
    pub(super) n: usize,
    pub(super) groups: &'a [(usize, Option<usize>)],
    pub(super) y: &'a [[f64; L]],
    pub(super) strength: &'a [[f64; L]],
    pub(super) soft: &'a [f64; L],
    pub(super) after: &'a mut [[f64; L]],
    pub(super) before: &'a mut [[f64; L]],
    pub(super) potential: &'a mut [[f64; L]],
    pub(super) out: &'a mut [[f64; L]],
}

/// What a body collects from one partner after the other.
struct Sums<const D: usize, const L: usize> {
    place: [[f64; L]; D],
    strength: [f64; L],
    pull: [[f64; L]; D],
    well: [f64; L],
}

impl<const D: usize, const L: usize> Sums<D, L> {
    /// Meets one partner, whose sum of what came from before is `less`.
    #[inline(always)]
    fn meet<const LAW: u8, const ENERGY: bool>(
        &mut self,
        place: &[[f64; L]; D],
        strength: &[f64; L],
        soft: &[f64; L],
        less: &mut [[f64; L]; D],
    ) {
        let mut d = [[0.0; L]; D];
        let mut r2 = [0.0; L];
        for l in 0..L {
            d[0][l] = place[0][l] - self.place[0][l];
            r2[l] = d[0][l] * d[0][l];
        }
        for c in 1..D {
            for l in 0..L {
                d[c][l] = place[c][l] - self.place[c][l];
                r2[l] += d[c][l] * d[c][l];
            }
        }
        let (mut to_i, mut to_j, mut more) = ([0.0; L], [0.0; L], [0.0; L]);
        for l in 0..L {
            let r2 = r2[l] + soft[l];
            let pull = pull::<LAW>(r2);
            to_i[l] = pull * strength[l];
            to_j[l] = pull * self.strength[l];
            more[l] = if ENERGY { phi::<LAW>(r2, pull, strength[l], to_i[l]) } else { 0.0 };
        }
        let mut row = *less;
        for c in 0..D {
            for l in 0..L {
                self.pull[c][l] += d[c][l] * to_i[l];
                row[c][l] -= d[c][l] * to_j[l];
            }
        }
        *less = row;
        if ENERGY {
            for l in 0..L {
                self.well[l] += more[l];
            }
        }
    }
}

impl<const D: usize, const LAW: u8, const ENERGY: bool, const L: usize> Task for SideBySide<'_, D, LAW, ENERGY, L> {
    #[inline(always)]
    fn run(self) {
        let Self { n, groups, y, strength, soft, after, before, potential, out } = self;
        let (y, _) = y.as_chunks::<D>();
        let (after, _) = after.as_chunks_mut::<D>();
        let (before, _) = before.as_chunks_mut::<D>();
        after.fill([[0.0; L]; D]);
        before.fill([[0.0; L]; D]);
        if ENERGY {
            potential.fill([0.0; L]);
        }
        for &(first, second) in groups {
            let count = meeting(n, first);
            let (far, other) = second.map_or((0, 0), |k| (k, meeting(n, k)));
            for i in 0..count {
                let well = if ENERGY { potential[i] } else { [0.0; L] };
                let mut sums = Sums { place: y[i], strength: strength[i], pull: after[i], well };
                let j = if i + first < n { i + first } else { i + first - n };
                sums.meet::<LAW, ENERGY>(&y[j], &strength[j], soft, &mut before[i + first]);
                if i < other {
                    let j = if i + far < n { i + far } else { i + far - n };
                    sums.meet::<LAW, ENERGY>(&y[j], &strength[j], soft, &mut before[i + far]);
                }
                after[i] = sums.pull;
                if ENERGY {
                    potential[i] = sums.well;
                }
            }
        }
        let (out, _) = out.as_chunks_mut::<D>();
        let (low, high) = before.split_at(n);
        for (((out, after), low), high) in out.iter_mut().zip(after).zip(low).zip(high) {
            let mut row = [[0.0; L]; D];
            for c in 0..D {
                for l in 0..L {
                    row[c][l] = after[c][l] + (low[c][l] + high[c][l]);
                }
            }
            *out = row;
        }
    }
}

//! Several systems side by side: a lane is a system.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use super::{
    SIDE,
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

/// One body, or what it collects from those after it and, as a partner, from those before it.
type Row<const D: usize, const L: usize> = [[f64; L]; D];

/// Body i meets its partner j; if they are the `FIRST` that both meet, the sums begin here.
///
/// One loop over the lanes around all of it, from memory to memory: it becomes straight vector code at every level.
#[inline(always)]
fn meet<const D: usize, const LAW: u8, const ENERGY: bool, const FIRST: bool, const L: usize>(
    [y_i, y_j]: [&Row<D, L>; 2],
    [strength_i, strength_j]: [&[f64; L]; 2],
    soft: &[f64; L],
    after: &mut Row<D, L>,
    before: &mut Row<D, L>,
    well: &mut [f64; L],
) {
    for l in 0..L {
        let mut d = [0.0; D];
        for c in 0..D {
            d[c] = y_j[c][l] - y_i[c][l];
        }
        let mut r2 = d[0] * d[0];
        for c in 1..D {
            r2 += d[c] * d[c];
        }
        let r2 = r2 + soft[l];
        let pull = pull::<LAW>(r2);
        let (to_i, to_j) = (pull * strength_j[l], pull * strength_i[l]);
        for c in 0..D {
            after[c][l] = if FIRST { 0.0 } else { after[c][l] } + d[c] * to_i;
            before[c][l] = if FIRST { 0.0 } else { before[c][l] } - d[c] * to_j;
        }
        if ENERGY {
            well[l] = if FIRST { 0.0 } else { well[l] } + phi::<LAW>(r2, pull, strength_j[l], to_i);
        }
    }
}

impl<const D: usize, const LAW: u8, const ENERGY: bool, const L: usize> SideBySide<'_, D, LAW, ENERGY, L> {
    /// Every body meets its partner at one distance.
    ///
    /// The indices are checked, and that is well: a loop over bodies without a way out would be taken several bodies at a time,
    /// with gathers and scatters.
    #[inline(always)]
    fn round<const FIRST: bool>(&mut self, k: usize) {
        let n = self.n;
        let (y, strength) = (&self.y.as_chunks::<D>().0[..n], &self.strength[..n]);
        let (after, before) = (self.after.as_chunks_mut::<D>().0, self.before.as_chunks_mut::<D>().0);
        let (after, before) = (&mut after[..n], &mut before[..2 * n]);
        let mut none = [0.0; L];
        for i in 0..meeting(n, k) {
            let well = if ENERGY { &mut self.potential[i] } else { &mut none };
            let j = if i + k < n { i + k } else { i + k - n };
            let (pair, strengths) = ([&y[i], &y[j]], [&strength[i], &strength[j]]);
            meet::<D, LAW, ENERGY, FIRST, L>(pair, strengths, self.soft, &mut after[i], &mut before[i + k], well);
        }
    }

    /// Every body meets its partners from one distance to another, `SIDE` apart, before the next body does.
    #[inline(always)]
    fn rounds(&mut self, near: usize, last: usize) {
        let n = self.n;
        let (y, strength) = (&self.y.as_chunks::<D>().0[..n], &self.strength[..n]);
        let (after, before) = (self.after.as_chunks_mut::<D>().0, self.before.as_chunks_mut::<D>().0);
        let (after, before) = (&mut after[..n], &mut before[..2 * n]);
        let mut none = [0.0; L];
        for i in 0..meeting(n, near) {
            let well = if ENERGY { &mut self.potential[i] } else { &mut none };
            let mut k = near;
            while k <= last && i < meeting(n, k) {
                let j = if i + k < n { i + k } else { i + k - n };
                let (pair, strengths) = ([&y[i], &y[j]], [&strength[i], &strength[j]]);
                meet::<D, LAW, ENERGY, false, L>(pair, strengths, self.soft, &mut after[i], &mut before[i + k], well);
                k += SIDE;
            }
        }
    }
}

impl<const D: usize, const LAW: u8, const ENERGY: bool, const L: usize> Task for SideBySide<'_, D, LAW, ENERGY, L> {
    #[inline(always)]
    fn run(mut self) {
        // A first round with one partner each writes most sums; only the others have to be cleared. It matters to few bodies.
        let (one, groups) = match self.groups {
            [(1, None), groups @ ..] => (true, groups),
            groups => (false, groups),
        };
        let written = if one { meeting(self.n, 1) } else { 0 };
        self.after[written * D..].fill([0.0; L]);
        self.before[..D].fill([0.0; L]);
        self.before[(written + 1) * D..].fill([0.0; L]);
        if ENERGY {
            self.potential[written..].fill([0.0; L]);
        }
        if one {
            self.round::<true>(1);
        }
        for &(near, last) in groups {
            match last {
                None => self.round::<false>(near),
                Some(last) => self.rounds(near, last),
            }
        }
        // Flat, or the loop would be taken over bodies, with one gather and one scatter for each number of a body.
        let (low, high) = self.before.as_flattened().split_at(self.n * D * L);
        let sums = self.after.as_flattened().iter().zip(low).zip(high);
        for (out, ((after, low), high)) in self.out.as_flattened_mut().iter_mut().zip(sums) {
            *out = after + (low + high);
        }
    }
}

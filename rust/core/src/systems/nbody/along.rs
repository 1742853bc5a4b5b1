//! One system: several of its bodies side by side.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use super::{
    SIDE,
    law::{phi, pull},
    meeting,
};
use crate::isa::Task;

type Chunk = [f64; SIDE];

#[inline(always)]
fn load(from: &[f64], at: usize) -> Chunk {
    let mut chunk = [0.0; SIDE];
    chunk.copy_from_slice(&from[at..at + SIDE]);
    chunk
}
pub(super) struct Along<'a, const D: usize, const LAW: u8, const ENERGY: bool, const L: usize> {
    pub(super) n: usize,
    pub(super) groups: &'a [(usize, Option<usize>)],
    pub(super) y: &'a [f64],
    pub(super) places: &'a mut [Vec<f64>],
    pub(super) partners: &'a [f64],
    pub(super) bodies: &'a [f64],
    pub(super) soft: f64,
    pub(super) after: &'a mut [f64],
    pub(super) before: &'a mut [f64],
    pub(super) potential: &'a mut [f64],
    pub(super) out: &'a mut [f64],
}

/// Partners that move along with the bodies: their places, strengths and sums.
#[derive(Clone, Copy)]
struct Partner<const D: usize> {
    place: [Chunk; D],
    strength: Chunk,
    sum: [Chunk; D],
}

impl<const D: usize, const LAW: u8, const ENERGY: bool> Along<'_, D, LAW, ENERGY, 1> {
    #[inline(always)]
    fn partner(&self, stride: usize, at: usize) -> Partner<D> {
        Partner {
            place: std::array::from_fn(|c| load(&self.places[c], at)),
            strength: load(self.partners, at),
            sum: std::array::from_fn(|c| load(self.before, c * stride + at)),
        }
    }

    /// One chunk of bodies meets one of partners; `met` of them do.
    #[inline(always)]
    fn pairs(&self, place: &[Chunk; D], body: &Chunk, met: usize, p: &mut Partner<D>, sum: &mut [Chunk; D], well: &mut Chunk) {
        let mut d = [[0.0; SIDE]; D];
        let mut r2 = [0.0; SIDE];
        for c in 0..D {
            for l in 0..SIDE {
                d[c][l] = p.place[c][l] - place[c][l];
                r2[l] = if c == 0 { d[c][l] * d[c][l] } else { r2[l] + d[c][l] * d[c][l] };
            }
        }
        let (mut to_i, mut to_j, mut more) = ([0.0; SIDE], [0.0; SIDE], [0.0; SIDE]);
        for l in 0..SIDE {
            let r2 = r2[l] + self.soft;
            let pull = pull::<LAW>(r2);
            to_i[l] = pull * p.strength[l];
            to_j[l] = pull * body[l];
            if ENERGY {
                more[l] = phi::<LAW>(r2, pull, p.strength[l], to_i[l]);
            }
        }
        if met < SIDE {
            // Past the last that meets: adding nothing changes no sum.
            for l in met..SIDE {
                (to_i[l], to_j[l], more[l]) = (0.0, 0.0, 0.0);
            }
        }
        for c in 0..D {
            for l in 0..SIDE {
                sum[c][l] += d[c][l] * to_i[l];
                p.sum[c][l] -= d[c][l] * to_j[l];
            }
        }
        if ENERGY {
            for l in 0..SIDE {
                well[l] += more[l];
            }
        }
    }

    #[inline(always)]
    fn meet(&mut self) {
        let (n, width, stride) = (self.n, self.potential.len(), self.partners.len());
        let (bodies, _) = self.y.as_chunks::<D>();
        for c in 0..D {
            let row = &mut self.places[c];
            for (place, body) in row.iter_mut().zip(bodies) {
                *place = body[c];
            }
            for i in n..stride {
                row[i] = row[i - n];
            }
        }
        self.after.fill(0.0);
        self.before.fill(0.0);
        self.potential.fill(0.0);
        for &(first, second) in self.groups {
            let count = meeting(n, first);
            let other = second.map_or(0, |k| meeting(n, k));
            // The far partners of a chunk are the near ones of the next: they stay in registers, and so do their sums.
            let mut near = self.partner(stride, first);
            for start in (0..count).step_by(SIDE) {
                let place: [Chunk; D] = std::array::from_fn(|c| load(&self.places[c], start));
                let body = load(self.bodies, start);
                let mut sum: [Chunk; D] = std::array::from_fn(|c| load(self.after, c * width + start));
                let mut well = load(self.potential, start);
                self.pairs(&place, &body, count - start, &mut near, &mut sum, &mut well);
                for c in 0..D {
                    self.before[c * stride + start + first..][..SIDE].copy_from_slice(&near.sum[c]);
                }
                near = self.partner(stride, start + first + SIDE);
                if start < other {
                    self.pairs(&place, &body, other - start, &mut near, &mut sum, &mut well);
                }
                for c in 0..D {
                    self.after[c * width + start..][..SIDE].copy_from_slice(&sum[c]);
                }
                if ENERGY {
                    self.potential[start..][..SIDE].copy_from_slice(&well);
                }
            }
            let end = count.next_multiple_of(SIDE) + first;
            for c in 0..D {
                self.before[c * stride + end..][..SIDE].copy_from_slice(&near.sum[c]);
            }
        }
        let (out, _) = self.out.as_chunks_mut::<D>();
        for c in 0..D {
            let (after, before) = (&self.after[c * width..][..n], &self.before[c * stride..][..2 * n]);
            let (low, high) = before.split_at(n);
            for (((out, after), low), high) in out.iter_mut().zip(after).zip(low).zip(high) {
                out[c] = after + (low + high);
            }
        }
    }
}

impl<const D: usize, const LAW: u8, const ENERGY: bool> Task for Along<'_, D, LAW, ENERGY, 1> {
    #[inline(always)]
    fn run(mut self) {
        self.meet();
    }
}

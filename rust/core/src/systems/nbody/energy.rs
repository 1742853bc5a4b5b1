//! The energy of bodies, and what keeps it: a push on the velocities, or a way back to it after a step.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use super::SIDE;
use crate::{
    control::{EnergyControl, Projection, Way},
    isa::Task,
};

/// Σ over the bodies, body i in part i mod `SIDE`, then part after part.
///
/// `SIDE` bodies are taken at once, so that one system has a vector of them, as several have one of lanes.
#[inline(always)]
pub(super) fn total<const L: usize>(n: usize, value: impl Fn(usize, usize) -> f64) -> [f64; L] {
    let mut parts = [[0.0; L]; SIDE];
    let used = n.min(SIDE);
    for (i, part) in parts[..used].iter_mut().enumerate() {
        for l in 0..L {
            part[l] = value(i, l);
        }
    }
    let whole = n - n % SIDE;
    for first in (SIDE..whole).step_by(SIDE) {
        let mut more = [[0.0; L]; SIDE];
        for i in 0..SIDE {
            for l in 0..L {
                more[i][l] = value(first + i, l);
            }
        }
        for i in 0..SIDE {
            for l in 0..L {
                parts[i][l] += more[i][l];
            }
        }
    }
    for i in whole.max(SIDE)..n {
        for l in 0..L {
            parts[i - whole][l] += value(i, l);
        }
    }
    let mut sum = parts[0];
    for part in &parts[1..used] {
        for l in 0..L {
            sum[l] += part[l];
        }
    }
    sum
}

/// |v|² of a body in a lane.
#[inline(always)]
fn square<const L: usize, const D: usize>(v: &[[[f64; L]; D]], i: usize, l: usize) -> f64 {
    let mut square = v[i][0][l] * v[i][0][l];
    for c in 1..D {
        square += v[i][c][l] * v[i][c][l];
    }
    square
}

/// h times the kinetic and h times the whole energy.
#[inline(always)]
pub(super) fn energies<const L: usize, const D: usize>(
    n: usize,
    mass: &[[f64; L]],
    half: &[[f64; L]],
    potential: &[[f64; L]],
    v: &[[f64; L]],
) -> ([f64; L], [f64; L]) {
    // Of one length each: the loops need not ask.
    let (mass, half, potential, v) = (&mass[..n], &half[..n], &potential[..n], &v.as_chunks::<D>().0[..n]);
    let kinetic = total(n, |i, l| half[i][l] * square(v, i, l));
    let potential = total::<L>(n, |i, l| mass[i][l] * potential[i][l]);
    let mut energy = kinetic;
    for l in 0..L {
        energy[l] += potential[l];
    }
    (kinetic, energy)
}

/// Sets a state back onto its energy.
pub(super) struct Back<'a, const D: usize, const L: usize> {
    pub(super) n: usize,
    pub(super) h: f64,
    pub(super) projection: &'a Projection<L>,
    pub(super) mass: &'a [[f64; L]],
    pub(super) half: &'a [[f64; L]],
    pub(super) potential: &'a [[f64; L]],
    pub(super) dv: &'a [[f64; L]],
    pub(super) v: &'a mut [[f64; L]],
    pub(super) y: &'a mut [[f64; L]],
    /// Gains h times what it changes of the energy.
    pub(super) work: &'a mut [f64; L],
}

impl<const D: usize, const L: usize> Task for Back<'_, D, L> {
    #[inline(always)]
    fn run(self) {
        let Self { n, h, projection, mass, half, potential, dv, v, y, work } = self;
        let (kinetic, energy) = energies::<L, D>(n, mass, half, potential, v);
        let off = projection.off(&energy);
        if projection.way == Way::Scaling {
            let factor = projection.factor(&kinetic, &off);
            for l in 0..L {
                work[l] += (factor[l] * factor[l] - 1.0) * kinetic[l];
            }
            for row in v {
                for l in 0..L {
                    row[l] *= factor[l];
                }
            }
            return;
        }
        // The gradient: m·v in the velocities, −m·a in the coordinates.
        let along = |row: &[[f64; L]], over: f64, r: usize, l: usize| mass[r / D][l] * (row[r][l] / over);
        let length = |row: &[[f64; L]], over: f64, i: usize, l: usize| {
            let mut square = along(row, over, D * i, l) * along(row, over, D * i, l);
            for r in D * i + 1..D * (i + 1) {
                square += along(row, over, r, l) * along(row, over, r, l);
            }
            square
        };
        let norm = total::<L>(n, |i, l| length(v, 1.0, i, l) + length(dv, h, i, l));
        let mut step = [0.0; L];
        for l in 0..L {
            step[l] = (off[l] / h) / norm[l];
            work[l] -= off[l];
        }
        for r in 0..n * D {
            for l in 0..L {
                y[r][l] += step[l] * along(dv, h, r, l);
                v[r][l] -= step[l] * along(v, 1.0, r, l);
            }
        }
    }
}

/// Adds −g·v to an increment, of the energy that was found beside the force.
pub(super) struct Push<'a, const D: usize, const L: usize> {
    pub(super) n: usize,
    pub(super) control: &'a EnergyControl<L>,
    pub(super) mass: &'a [[f64; L]],
    pub(super) half: &'a [[f64; L]],
    pub(super) potential: &'a [[f64; L]],
    pub(super) v: &'a [[f64; L]],
    pub(super) out: &'a mut [[f64; L]],
    /// Gains h times what the push alone would change of the energy.
    pub(super) work: &'a mut [f64; L],
}

impl<const D: usize, const L: usize> Task for Push<'_, D, L> {
    #[inline(always)]
    fn run(self) {
        let (kinetic, energy) = energies::<L, D>(self.n, self.mass, self.half, self.potential, self.v);
        let g = self.control.push(&kinetic, &energy);
        for l in 0..L {
            self.work[l] -= (g[l] * (2.0 - g[l])) * kinetic[l];
        }
        for (out, v) in self.out.iter_mut().zip(self.v) {
            for l in 0..L {
                out[l] -= g[l] * v[l];
            }
        }
    }
}

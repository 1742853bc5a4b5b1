//! The energy of bodies, and what keeps it: a push on the velocities, or a way back to it after a step.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use super::SIDE;
use crate::{
    control::{EnergyControl, Projection, Way},
    isa::Task,
};

/// Σ of values of the bodies' weights and something of theirs: body i in part i mod `SIDE`, then part after part.
///
/// `SIDE` bodies are taken at once, so that one system has a vector of them, as several have one of lanes.
#[inline(always)]
pub(super) fn total<const L: usize, B>(
    weights: &[[f64; L]],
    bodies: &[B],
    value: impl Fn(usize, &[f64; L], &B, usize) -> f64,
) -> [f64; L] {
    let mut parts = [[0.0; L]; SIDE];
    let ((chunks, some), (of, more)) = (weights.as_chunks::<SIDE>(), bodies.as_chunks::<SIDE>());
    for (chunk, (weights, bodies)) in chunks.iter().zip(of).enumerate() {
        let mut values = [[0.0; L]; SIDE];
        for i in 0..SIDE {
            for l in 0..L {
                values[i][l] = value(SIDE * chunk + i, &weights[i], &bodies[i], l);
            }
        }
        for i in 0..SIDE {
            for l in 0..L {
                parts[i][l] = if chunk == 0 { values[i][l] } else { parts[i][l] + values[i][l] };
            }
        }
    }
    for (i, (weight, body)) in some.iter().zip(more).enumerate() {
        for l in 0..L {
            let value = value(SIDE * chunks.len() + i, weight, body, l);
            parts[i][l] = if chunks.is_empty() { value } else { parts[i][l] + value };
        }
    }
    let mut sum = parts[0];
    for part in &parts[1..weights.len().clamp(1, SIDE)] {
        for l in 0..L {
            sum[l] += part[l];
        }
    }
    sum
}

/// |v|² of a body in a lane.
#[inline(always)]
fn square<const L: usize, const D: usize>(v: &[[f64; L]; D], l: usize) -> f64 {
    let mut square = v[0][l] * v[0][l];
    for c in 1..D {
        square += v[c][l] * v[c][l];
    }
    square
}

/// h times the kinetic and h times the whole energy.
#[inline(always)]
pub(super) fn energies<const L: usize, const D: usize>(
    mass: &[[f64; L]],
    half: &[[f64; L]],
    potential: &[[f64; L]],
    v: &[[f64; L]],
) -> ([f64; L], [f64; L]) {
    let kinetic = total::<L, [[f64; L]; D]>(half, v.as_chunks().0, |_, half, v, l| half[l] * square(v, l));
    let potential = total(mass, potential, |_, mass, potential, l| mass[l] * potential[l]);
    let mut energy = kinetic;
    for l in 0..L {
        energy[l] += potential[l];
    }
    (kinetic, energy)
}

/// Sets a state back onto its energy.
pub(super) struct Back<'a, const D: usize, const L: usize> {
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
        let Self { h, projection, mass, half, potential, dv, v, y, work } = self;
        let (kinetic, energy) = energies::<L, D>(mass, half, potential, v);
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
        let norm = total(mass, mass, |i, _, _, l| length(v, 1.0, i, l) + length(dv, h, i, l));
        let mut step = [0.0; L];
        for l in 0..L {
            step[l] = (off[l] / h) / norm[l];
            work[l] -= off[l];
        }
        for r in 0..v.len() {
            for l in 0..L {
                y[r][l] += step[l] * along(dv, h, r, l);
                v[r][l] -= step[l] * along(v, 1.0, r, l);
            }
        }
    }
}

/// Adds −g·v to an increment, of the energy that was found beside the force.
pub(super) struct Push<'a, const D: usize, const L: usize> {
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
        let (kinetic, energy) = energies::<L, D>(self.mass, self.half, self.potential, self.v);
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

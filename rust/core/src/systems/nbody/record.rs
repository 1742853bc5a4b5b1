//! What can be recorded beside a state: quantities that the motion keeps, and how near two bodies are.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use super::{
    SIDE,
    energy::{energies, total},
};
use crate::isa::Task;

/// A quantity of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// Kinetic and potential energy together.
    Energy,
    /// Σ m·v, a vector.
    Momentum,
    /// Σ m·(y × v): a number in the plane, a vector in space.
    Spin,
    /// The least distance of two bodies.
    Closest,
}

impl Quantity {
    /// The quantity of that name.
    pub(super) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "energy" => Quantity::Energy,
            "momentum" => Quantity::Momentum,
            "angular_momentum" => Quantity::Spin,
            "closest" => Quantity::Closest,
            _ => return None,
        })
    }

    /// How many numbers it has.
    pub(super) fn size(self, dim: usize) -> usize {
        match self {
            Quantity::Energy | Quantity::Closest => 1,
            Quantity::Momentum => dim,
            Quantity::Spin => 2 * dim - 3,
        }
    }
}

/// Fills rows with quantities, one after the other.
pub(super) struct Record<'a, const D: usize, const L: usize> {
    pub(super) h: f64,
    pub(super) what: &'a [Quantity],
    pub(super) mass: &'a [[f64; L]],
    pub(super) half: &'a [[f64; L]],
    /// h times the potential of each body, of these places.
    pub(super) potential: &'a [[f64; L]],
    pub(super) v: &'a [[f64; L]],
    pub(super) y: &'a [[f64; L]],
    pub(super) rows: &'a mut [[f64; L]],
}

impl<const D: usize, const L: usize> Task for Record<'_, D, L> {
    #[inline(always)]
    fn run(self) {
        let Self { h, what, mass, half, potential, v, y, rows } = self;
        let ((places, _), (speeds, _)) = (y.as_chunks::<D>(), v.as_chunks::<D>());
        let mut at = 0;
        for quantity in what {
            let rows = &mut rows[at..at + quantity.size(D)];
            at += rows.len();
            match quantity {
                Quantity::Energy => {
                    let (_, energy) = energies::<L, D>(mass, half, potential, v);
                    rows[0] = energy.map(|e| e / h);
                }
                Quantity::Momentum => {
                    for (c, row) in rows.iter_mut().enumerate() {
                        *row = total(mass, speeds, |_, m, v, l| m[l] * v[c][l]);
                    }
                }
                Quantity::Spin => {
                    for (c, row) in rows.iter_mut().enumerate() {
                        let (a, b) = if D == 2 { (0, 1) } else { ((c + 1) % 3, (c + 2) % 3) };
                        *row = total(mass, speeds, |i, m, v, l| m[l] * (places[i][a][l] * v[b][l] - places[i][b][l] * v[a][l]));
                    }
                }
                Quantity::Closest => rows[0] = closest(mass.len(), D, y),
            }
        }
    }
}

/// The least distance. The order in which pairs are looked at changes nothing.
#[inline(always)]
fn closest<const L: usize>(n: usize, dim: usize, y: &[[f64; L]]) -> [f64; L] {
    let mut least = [f64::INFINITY; L];
    if L > 1 {
        for i in 0..n {
            for j in i + 1..n {
                for l in 0..L {
                    let mut r2 = 0.0;
                    for c in 0..dim {
                        let d = y[dim * j + c][l] - y[dim * i + c][l];
                        r2 = if c == 0 { d * d } else { r2 + d * d };
                    }
                    least[l] = if r2 < least[l] { r2 } else { least[l] };
                }
            }
        }
        return least.map(f64::sqrt);
    }
    // One system: eight partners at a time. Bodies that are not there are nowhere, which is never near.
    let along = n.next_multiple_of(SIDE) + SIDE;
    let places: Vec<f64> = (0..3 * along).map(|r| (r / along, r % along)).map(|(c, i)| place(n, dim, y, c, i)).collect();
    let (x, rest) = places.split_at(along);
    let (y, z) = rest.split_at(along);
    let mut parts = [f64::INFINITY; SIDE];
    for i in 0..n {
        for start in (i + 1..n).step_by(SIDE) {
            let (xs, ys, zs) = (&x[start..start + SIDE], &y[start..start + SIDE], &z[start..start + SIDE]);
            for l in 0..SIDE {
                let (dx, dy, dz) = (xs[l] - x[i], ys[l] - y[i], zs[l] - z[i]);
                let r2 = (dx * dx + dy * dy) + dz * dz;
                parts[l] = if r2 < parts[l] { r2 } else { parts[l] };
            }
        }
    }
    let least = parts.into_iter().fold(f64::INFINITY, |least, part| if part < least { part } else { least });
    [least.sqrt(); L]
}

fn place<const L: usize>(n: usize, dim: usize, y: &[[f64; L]], c: usize, i: usize) -> f64 {
    match (i < n, c < dim) {
        (true, true) => y[dim * i + c][0],
        (true, false) => 0.0,
        _ => f64::NAN,
    }
}

//! Quantities that can be recorded of a state: invariants of the motion, and the least distance of two bodies.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use crate::{
    bodies::LANES,
    isa::{Level, Task, with_isa},
};

/// Bodies that are taken side by side, and parts in which sums over bodies are kept.
pub(super) const SIDE: usize = LANES;

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
    fn size(self, dim: usize) -> usize {
        match self {
            Quantity::Energy | Quantity::Closest => 1,
            Quantity::Momentum => dim,
            Quantity::Spin => 2 * dim - 3,
        }
    }
}

/// Σ over bodies of what is made of two things of each: body i in part i mod `SIDE`, then part after part.
#[inline(always)]
pub(super) fn total<A, B>(one: &[A], other: &[B], value: impl Fn(usize, &A, &B) -> f64) -> f64 {
    let mut parts = [0.0; SIDE];
    let ((chunks, some), (of, more)) = (one.as_chunks::<SIDE>(), other.as_chunks::<SIDE>());
    for (chunk, (a, b)) in chunks.iter().zip(of).enumerate() {
        let mut values = [0.0; SIDE];
        for l in 0..SIDE {
            values[l] = value(SIDE * chunk + l, &a[l], &b[l]);
        }
        for l in 0..SIDE {
            parts[l] = if chunk == 0 { values[l] } else { parts[l] + values[l] };
        }
    }
    for (l, (a, b)) in some.iter().zip(more).enumerate() {
        let value = value(SIDE * chunks.len() + l, a, b);
        parts[l] = if chunks.is_empty() { value } else { parts[l] + value };
    }
    let mut sum = parts[0];
    for part in &parts[1..one.len().clamp(1, SIDE)] {
        sum += part;
    }
    sum
}

/// The square of a vector's length.
#[inline(always)]
pub(super) fn square<const D: usize>(v: &[f64; D]) -> f64 {
    let mut square = v[0] * v[0];
    for c in 1..D {
        square += v[c] * v[c];
    }
    square
}

/// h times the kinetic energy.
pub(super) fn kinetic(dim: usize, half: &[f64], v: &[f64]) -> f64 {
    match dim {
        2 => total(half, v.as_chunks::<2>().0, |_, half, v| half * square(v)),
        _ => total(half, v.as_chunks::<3>().0, |_, half, v| half * square(v)),
    }
}

/// Fills rows with quantities, one after the other.
pub(super) struct Record<'a> {
    /// The instruction set of the search for the nearest two. The others are sums over bodies, which take little beside a force.
    pub(super) level: Level,
    pub(super) h: f64,
    pub(super) what: &'a [Quantity],
    /// For each body with mass: the mass, ½·h·m, and h times the potential at these places.
    pub(super) mass: &'a [f64],
    pub(super) half: &'a [f64],
    pub(super) potential: &'a [f64],
    /// Of all bodies, those with mass first.
    pub(super) v: &'a [f64],
    pub(super) y: &'a [f64],
    pub(super) rows: &'a mut [f64],
}

impl Record<'_> {
    /// Fills the rows, in `D` directions.
    pub(super) fn fill<const D: usize>(self) {
        let Self { level, h, what, mass, half, potential, v, y, rows } = self;
        let (places, speeds) = (y.as_chunks::<D>().0, &v.as_chunks::<D>().0[..mass.len()]);
        let mut at = 0;
        for quantity in what {
            let rows = &mut rows[at..at + quantity.size(D)];
            at += rows.len();
            match quantity {
                Quantity::Energy => {
                    let wells = total(mass, potential, |_, mass, potential| mass * potential);
                    rows[0] = (total(half, speeds, |_, half, v| half * square(v)) + wells) / h;
                }
                Quantity::Momentum => {
                    for (c, row) in rows.iter_mut().enumerate() {
                        *row = total(mass, speeds, |_, m, v| m * v[c]);
                    }
                }
                Quantity::Spin => {
                    for (c, row) in rows.iter_mut().enumerate() {
                        let (a, b) = if D == 2 { (0, 1) } else { ((c + 1) % 3, (c + 2) % 3) };
                        *row = total(mass, speeds, |i, m, v| m * (places[i][a] * v[b] - places[i][b] * v[a]));
                    }
                }
                Quantity::Closest => {
                    with_isa!(level, |isa| isa.run(Closest { massive: mass.len(), bodies: places, least: &mut rows[0] }))
                }
            }
        }
    }
}

/// The least distance between a massive body and another, eight partners at a time. The order of the pairs does not matter.
struct Closest<'a, const D: usize> {
    massive: usize,
    /// All bodies, massive ones first.
    bodies: &'a [[f64; D]],
    least: &'a mut f64,
}

impl<const D: usize> Task for Closest<'_, D> {
    #[inline(always)]
    fn run(self) {
        let bodies = self.bodies;
        let n = bodies.len();
        // Padding has NaN coordinates, which are never the nearest.
        let along = n.next_multiple_of(SIDE) + SIDE;
        let row = |c: usize| -> Vec<f64> { (0..along).map(|i| bodies.get(i).map_or(f64::NAN, |body| body[c])).collect() };
        let rows: [Vec<f64>; D] = std::array::from_fn(row);
        let mut parts = [f64::INFINITY; SIDE];
        for (i, body) in bodies[..self.massive].iter().enumerate() {
            for start in (i + 1..n).step_by(SIDE) {
                let mut r2 = [0.0; SIDE];
                for c in 0..D {
                    let partners = &rows[c][start..start + SIDE];
                    for l in 0..SIDE {
                        let d = partners[l] - body[c];
                        r2[l] = if c == 0 { d * d } else { r2[l] + d * d };
                    }
                }
                for l in 0..SIDE {
                    parts[l] = if r2[l] < parts[l] { r2[l] } else { parts[l] };
                }
            }
        }
        *self.least = parts.into_iter().fold(f64::INFINITY, |least, part| if part < least { part } else { least }).sqrt();
    }
}

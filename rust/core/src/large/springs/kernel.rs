//! The forces of a net: the loops.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use super::order::{MARGIN, Order, SIDE};
use crate::{aligned::Aligned, isa::Task};

type Vector = [f64; SIDE];

/// The bit of the sign, which is −0.
const SIGN: u64 = 1 << 63;

/// The bits of each set of lanes: all of those of a lane that is in it.
const LANES: [[u64; SIDE]; 1 << SIDE] = {
    let mut all = [[0; SIDE]; 1 << SIDE];
    let mut set = 0;
    while set < all.len() {
        let mut lane = 0;
        while lane < SIDE {
            all[set][lane] = if set >> lane & 1 == 1 { u64::MAX } else { 0 };
            lane += 1;
        }
        set += 1;
    }
    all
};

/// The numbers of a net: a row for each direction of what is a vector.
pub(crate) struct Rows {
    /// The length of a row of particles.
    pub particles: usize,
    /// The length of a row of forces.
    pub springs: usize,
    /// Places.
    pub y: Aligned,
    /// Velocities, if there is damping.
    pub v: Aligned,
    /// The stiffness of springs, in the order in which they are computed.
    pub stiffness: Aligned,
    /// k·ℓ₀
    pub held: Aligned,
    /// The damping, empty if there is none.
    pub damping: Aligned,
    /// Forces on first ends, with a margin before and behind them.
    pub forces: Aligned,
    /// h/m
    pub by_mass: Aligned,
    /// h/m·drag, or nothing.
    pub slowing: Aligned,
    /// h·g, or nothing.
    pub fall: Vec<f64>,
}

#[inline(always)]
fn load(from: &[f64], at: usize) -> Vector {
    let mut vector = [0.0; SIDE];
    vector.copy_from_slice(&from[at..at + SIDE]);
    vector
}

/// Takes the rows of a block apart.
#[inline(always)]
fn apart<const D: usize>(block: &[f64], rows: &mut [f64], length: usize) {
    let (vectors, rest) = block.as_chunks::<D>().0.as_chunks::<SIDE>();
    for (vector, particles) in vectors.iter().enumerate() {
        for c in 0..D {
            let row = &mut rows[c * length + SIDE * vector..][..SIDE];
            for l in 0..SIDE {
                row[l] = particles[l][c];
            }
        }
    }
    for (i, particle) in rest.iter().enumerate() {
        for c in 0..D {
            rows[c * length + SIDE * vectors.len() + i] = particle[c];
        }
    }
}

/// The rate of v from the state, in D directions.
pub(crate) struct Forces<'a, const D: usize, const DAMPED: bool> {
    pub order: &'a Order,
    pub rows: &'a mut Rows,
    pub v: &'a [f64],
    pub y: &'a [f64],
    pub out: &'a mut [f64],
}

/// Both ends of a vector of springs.
struct Ends<const D: usize> {
    y: [[Vector; D]; 2],
    v: [[Vector; D]; 2],
}

impl<const D: usize> Ends<D> {
    const NONE: Self = Ends { y: [[[0.0; SIDE]; D]; 2], v: [[[0.0; SIDE]; D]; 2] };
}

/// The forces of a vector of springs.
#[inline(always)]
fn pull<const D: usize, const DAMPED: bool>(ends: &Ends<D>, [stiffness, held, damping]: [Vector; 3]) -> [Vector; D] {
    let (mut d, mut square, mut along) = ([[0.0; SIDE]; D], [0.0; SIDE], [0.0; SIDE]);
    for c in 0..D {
        for l in 0..SIDE {
            d[c][l] = ends.y[1][c][l] - ends.y[0][c][l];
            let product = d[c][l] * d[c][l];
            square[l] = if c == 0 { product } else { square[l] + product };
            if DAMPED {
                let product = (ends.v[1][c][l] - ends.v[0][c][l]) * d[c][l];
                along[l] = if c == 0 { product } else { along[l] + product };
            }
        }
    }
    let mut pull = [0.0; SIDE];
    for l in 0..SIDE {
        let length = square[l].sqrt();
        // Bits, not a choice, which would become eight branches.
        let some = u64::from(0.0 < length).wrapping_neg();
        let divisor = f64::from_bits(length.to_bits() & some | 1.0f64.to_bits() & !some);
        let push = if DAMPED {
            let inverse = 1.0 / divisor;
            (held[l] - (damping[l] * along[l]) * inverse) * inverse
        } else {
            held[l] / divisor
        };
        pull[l] = stiffness[l] - push;
    }
    for c in 0..D {
        for l in 0..SIDE {
            d[c][l] *= pull[l];
        }
    }
    d
}

impl<const D: usize, const DAMPED: bool> Forces<'_, D, DAMPED> {
    /// The forces of the springs from a place on.
    #[inline(always)]
    fn compute(rows: &mut Rows, at: usize, ends: &Ends<D>) {
        let damping = if DAMPED { load(&rows.damping, at) } else { [0.0; SIDE] };
        let forces = pull::<D, DAMPED>(ends, [load(&rows.stiffness, at), load(&rows.held, at), damping]);
        let length = rows.springs;
        for c in 0..D {
            rows.forces[c * length + MARGIN + at..][..SIDE].copy_from_slice(&forces[c]);
        }
    }

    /// Ends side by side, from these particles on.
    #[inline(always)]
    fn beside(rows: &Rows, first: [u32; 2]) -> Ends<D> {
        let mut ends = Ends::NONE;
        for end in 0..2 {
            for c in 0..D {
                let at = c * rows.particles + first[end] as usize;
                ends.y[end][c] = load(&rows.y, at);
                if DAMPED {
                    ends.v[end][c] = load(&rows.v, at);
                }
            }
        }
        ends
    }

    /// The ends of springs anywhere.
    #[inline(always)]
    fn anywhere(y: &[[f64; D]], v: &[[f64; D]], numbers: &[[u32; SIDE]; 2]) -> Ends<D> {
        let mut ends = Ends::NONE;
        for end in 0..2 {
            for l in 0..SIDE {
                let i = numbers[end][l] as usize;
                let (place, speed) = (&y[i], if DAMPED { &v[i] } else { &[0.0; D] });
                for c in 0..D {
                    ends.y[end][c][l] = place[c];
                    ends.v[end][c][l] = speed[c];
                }
            }
        }
        ends
    }

    /// The sums of the forces on the `count` particles from `first` on, one by one.
    #[inline(always)]
    fn sums_of_singles(order: &Order, rows: &Rows, first: usize, count: usize) -> [Vector; D] {
        let mut sums = [[-0.0; SIDE]; D];
        let mut from = if first == 0 { 0 } else { order.until_single[first - 1] as usize };
        for l in 0..count.min(SIDE) {
            let until = order.until_single[first + l] as usize;
            let mut sum = [-0.0; D];
            for single in &order.singles[from..until] {
                let turned = u64::from(single.is_second) << 63;
                for c in 0..D {
                    let force = rows.forces[c * rows.springs + single.at as usize];
                    sum[c] += f64::from_bits(force.to_bits() ^ turned);
                }
            }
            for c in 0..D {
                sums[c][l] = sum[c];
            }
            from = until;
        }
        sums
    }

    /// The sums of the forces on a vector of particles.
    #[inline(always)]
    fn sums(order: &Order, rows: &Rows, vector: usize) -> [Vector; D] {
        let from = if vector == 0 { 0 } else { order.until[vector - 1] };
        let mut sums = [[-0.0; SIDE]; D];
        for addend in &order.addends[from as usize..order.until[vector] as usize] {
            let takes = &LANES[addend.takes as usize];
            for c in 0..D {
                let forces = load(&rows.forces, c * rows.springs + addend.at as usize);
                match (addend.takes, addend.is_second) {
                    (u8::MAX, false) => (0..SIDE).for_each(|l| sums[c][l] += forces[l]),
                    (u8::MAX, true) => (0..SIDE).for_each(|l| sums[c][l] -= forces[l]),
                    (_, is_second) => {
                        let turned = if is_second { SIGN } else { 0 };
                        for l in 0..SIDE {
                            let force = (forces[l].to_bits() ^ turned) & takes[l] | SIGN & !takes[l];
                            sums[c][l] += f64::from_bits(force);
                        }
                    }
                }
            }
        }
        sums
    }
}

impl<const D: usize, const DAMPED: bool> Forces<'_, D, DAMPED> {
    /// Writes the rates of the particles from `at` on, from the sums of their forces.
    #[inline(always)]
    fn finish(rows: &Rows, at: usize, sums: [Vector; D], speeds: &[[f64; D]], out: &mut [[f64; D]]) {
        let by_mass = load(&rows.by_mass, at);
        let mut rates = sums;
        for c in 0..D {
            for l in 0..SIDE {
                rates[c][l] *= by_mass[l];
            }
            if let Some(fall) = rows.fall.get(c) {
                for l in 0..SIDE {
                    rates[c][l] += fall;
                }
            }
        }
        if !rows.slowing.is_empty() {
            let slowing = load(&rows.slowing, at);
            for (l, v) in speeds[at..].iter().take(SIDE).enumerate() {
                for c in 0..D {
                    rates[c][l] -= slowing[l] * v[c];
                }
            }
        }
        if let Ok(whole) = <&mut [[f64; D]; SIDE]>::try_from(&mut *out) {
            for l in 0..SIDE {
                for c in 0..D {
                    whole[l][c] = rates[c][l];
                }
            }
        } else {
            for (l, out) in out.iter_mut().enumerate() {
                for c in 0..D {
                    out[c] = rates[c][l];
                }
            }
        }
    }
}

impl<const D: usize, const DAMPED: bool> Task for Forces<'_, D, DAMPED> {
    #[inline(always)]
    fn run(self) {
        let Forces { order, rows, v, y, out } = self;
        let length = rows.particles;
        apart::<D>(y, &mut rows.y, length);
        if DAMPED {
            apart::<D>(v, &mut rows.v, length);
        }
        let ((places, _), (speeds, _)) = (y.as_chunks::<D>(), v.as_chunks::<D>());
        for run in &order.runs {
            let ends = Self::beside(rows, run.ends);
            Self::compute(rows, run.at as usize, &ends);
        }
        for (vector, numbers) in order.others.iter().enumerate() {
            let ends = Self::anywhere(places, speeds, numbers);
            Self::compute(rows, order.first_other + SIDE * vector, &ends);
        }
        let (out, _) = out[..y.len()].as_chunks_mut::<D>();
        for (vector, out) in out.chunks_mut(SIDE).enumerate() {
            let at = SIDE * vector;
            let before = if at == 0 { 0 } else { order.until_single[at - 1] };
            if order.until_single[at + out.len() - 1] > before {
                Self::finish(rows, at, Self::sums_of_singles(order, rows, at, out.len()), speeds, out);
            } else {
                Self::finish(rows, at, Self::sums(order, rows, vector), speeds, out);
            }
        }
    }
}

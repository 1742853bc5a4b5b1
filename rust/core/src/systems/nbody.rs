//! Bodies that attract each other (Appendix C, D): v̇ᵢ = Σⱼ G·mⱼ·(yⱼ − yᵢ)·f(r² + ε²), each pair computed once.
//!
//! | force | f | potential of a pair |
//! |---|---|---|
//! | `logarithmic` | 1/r² | G·m·m·ln r |
//! | `newton` | 1/r³ | −G·m·m/r |
//! | `printed` | 1/r² | −G·m·m/r, which belongs to the other force |
//!
//! Body i meets body i + k for k = 1 … n/2, counted round the circle, so every pair comes once and a run of bodies meets a run of
//! partners. What a body gets from partners after it and before it is summed apart, the latter over two rounds, so that no index
//! wraps. The order of these sums is the reference's (`partners`), whatever the kernel: three bodies in a lane tile, several systems
//! side by side, or one large system with eight bodies at a time.
//!
//! Sizes: bodies, dimensions (2 or 3). Options: the force; then `control:printed`, `control:limited`, `project:scaling` or
//! `project:nacozy`. Parameters: G·m of each body, m of each body, ε; then the target energy, and the gain of a control.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use nalgebra::SVector;

use crate::{
    control::{EnergyControl, Projection, Way},
    error::Error,
    group::{Clock, Group, Spec, Width},
    isa::{Level, Task, with_isa},
    log::log,
    rows::{self, Large, Rows, lanes, lanes_mut, zeros},
    stepper::{Needs, Stepper},
    system::System,
    tile::{self, INPUTS, Small, View},
};

const LOGARITHMIC: u8 = 0;
const NEWTON: u8 = 1;
const PRINTED: u8 = 2;

/// Bodies that are taken side by side in a large system, and parts in which sums over bodies are kept.
const SIDE: usize = 8;

/// f(r²)
#[inline(always)]
fn pull<const LAW: u8>(r2: f64) -> f64 {
    if LAW == NEWTON { 1.0 / (r2 * r2.sqrt()) } else { 1.0 / r2 }
}

/// The potential, per mass, that a partner of this strength makes; `to_i` is pull·strength.
#[inline(always)]
fn phi<const LAW: u8>(r2: f64, pull: f64, strength: f64, to_i: f64) -> f64 {
    match LAW {
        LOGARITHMIC => (0.5 * log(r2)) * strength,
        NEWTON => -(r2 * to_i),
        _ => -(pull.sqrt() * strength),
    }
}

/// The distances k, in the order in which they are summed; two of them `SIDE` apart are taken together while both are there.
fn partners(n: usize) -> Vec<(usize, Option<usize>)> {
    let (mut groups, mut k) = (Vec::new(), 1);
    while n / 2 + 1 >= 2 * SIDE + k {
        groups.extend((k..k + SIDE).map(|k| (k, Some(k + SIDE))));
        k += 2 * SIDE;
    }
    groups.extend((k..n / 2 + 1).map(|k| (k, None)));
    groups
}

/// How many bodies meet a partner at this distance: all, but opposite ones meet once.
fn meeting(n: usize, k: usize) -> usize {
    if 2 * k == n { k } else { n }
}

// ---- three bodies in a lane tile

/// Three bodies, scaled to the step.
pub struct ThreeBodies<const D: usize, const LAW: u8> {
    strength: [f64; 3],
    soft: f64,
    h: f64,
}

impl<const D: usize, const LAW: u8> ThreeBodies<D, LAW> {
    /// What bodies i and j get from each other.
    #[inline(always)]
    fn pair(&self, y: &[f64], i: usize, j: usize) -> ([f64; D], [f64; D]) {
        let mut d = [0.0; D];
        for c in 0..D {
            d[c] = y[D * j + c] - y[D * i + c];
        }
        let mut r2 = d[0] * d[0];
        for c in 1..D {
            r2 += d[c] * d[c];
        }
        let pull = pull::<LAW>(r2 + self.soft);
        let (to_i, to_j) = (pull * self.strength[j], pull * self.strength[i]);
        (d.map(|d| d * to_i), d.map(|d| d * to_j))
    }
}

macro_rules! three_bodies {
    ($dim:literal, $numbers:literal) => {
        impl<const LAW: u8> System for ThreeBodies<$dim, LAW> {
            type V = SVector<f64, $numbers>;
            type Y = SVector<f64, $numbers>;

            #[inline(always)]
            fn dv(&mut self, _t: f64, _v: &Self::V, y: &Self::Y, out: &mut Self::V) {
                // Written out: a loop over pairs loses the vector instructions.
                let y = y.as_slice();
                let (after_0, before_1) = self.pair(y, 0, 1);
                let (after_1, before_2) = self.pair(y, 1, 2);
                let (after_2, before_0) = self.pair(y, 2, 0);
                for c in 0..$dim {
                    // (0 + after) + (first round + second round), as the sums of any number of bodies.
                    out[c] = (0.0 + after_0[c]) + (0.0 + (0.0 - before_0[c]));
                    out[$dim + c] = (0.0 + after_1[c]) + ((0.0 - before_1[c]) + 0.0);
                    out[2 * $dim + c] = (0.0 + after_2[c]) + ((0.0 - before_2[c]) + 0.0);
                }
            }

            #[inline(always)]
            fn dy(&mut self, _t: f64, v: &Self::V, _y: &Self::Y, out: &mut Self::Y) {
                for i in 0..$numbers {
                    out[i] = self.h * v[i];
                }
            }

            #[inline(always)]
            fn velocity(&mut self, d: &Self::Y, out: &mut Self::V) {
                for i in 0..$numbers {
                    out[i] = d[i] / self.h;
                }
            }
        }

        impl<const LAW: u8> Small<$numbers, $numbers, 7> for Three<$dim, LAW> {
            type Member<'a, const L: usize> = ThreeBodies<$dim, LAW>;

            fn constants(&self, h: f64, [a, b, c, _, _, _, soft]: [f64; 7]) -> [f64; 7] {
                [h * a, h * b, h * c, 0.0, 0.0, 0.0, soft * soft]
            }

            #[inline(always)]
            fn member<'a, const L: usize>(
                h: f64,
                [a, b, c, _, _, _, soft]: [f64; 7],
                _: &[View<'a, L>; INPUTS],
                _: usize,
            ) -> Self::Member<'a, L> {
                ThreeBodies { strength: [a, b, c], soft, h }
            }
        }
    };
}

struct Three<const D: usize, const LAW: u8>;
three_bodies!(2, 6);
three_bodies!(3, 9);

// ---- what larger systems share

/// Which kernel meets the bodies: chosen once, called for each force.
#[derive(Clone, Copy)]
struct Kind {
    law: u8,
    dim: usize,
    level: Level,
}

/// Runs a kernel at the CPU level at hand. It is compiled once for each law and dimension, not once in every method.
macro_rules! at {
    ($kind:expr, $task:ident, $dim:literal, $law:expr, $energy:literal, $fields:tt) => {
        with_isa!($kind.level, |isa| isa.run(at!(@ $task, $dim, $law, $energy, $fields)))
    };
    (@ $task:ident, $dim:literal, $law:expr, $energy:literal, { $($field:tt)* }) => {
        $task::<$dim, { $law }, $energy, _> { $($field)* }
    };
}

/// Runs a kernel for the law and the dimensions at hand.
macro_rules! meet {
    ($kind:expr, $energy:expr, $task:ident $fields:tt) => {
        match ($kind.dim, $kind.law, $energy) {
            (2, NEWTON, false) => at!($kind, $task, 2, NEWTON, false, $fields),
            (2, _, false) => at!($kind, $task, 2, LOGARITHMIC, false, $fields),
            (_, NEWTON, false) => at!($kind, $task, 3, NEWTON, false, $fields),
            (_, _, false) => at!($kind, $task, 3, LOGARITHMIC, false, $fields),
            (2, LOGARITHMIC, true) => at!($kind, $task, 2, LOGARITHMIC, true, $fields),
            (2, NEWTON, true) => at!($kind, $task, 2, NEWTON, true, $fields),
            (2, _, true) => at!($kind, $task, 2, PRINTED, true, $fields),
            (_, LOGARITHMIC, true) => at!($kind, $task, 3, LOGARITHMIC, true, $fields),
            (_, NEWTON, true) => at!($kind, $task, 3, NEWTON, true, $fields),
            (_, _, true) => at!($kind, $task, 3, PRINTED, true, $fields),
        }
    };
}

/// Σ over the bodies, body i in part i mod `SIDE`, then part after part.
#[inline(always)]
fn total<const L: usize>(n: usize, value: impl Fn(usize, usize) -> f64) -> [f64; L] {
    let mut parts = [[0.0; L]; SIDE];
    let used = n.min(SIDE);
    for i in 0..n {
        for l in 0..L {
            let value = value(i, l);
            parts[i % SIDE][l] = if i < SIDE { value } else { parts[i % SIDE][l] + value };
        }
    }
    let mut whole = parts[0];
    for part in &parts[1..used] {
        for l in 0..L {
            whole[l] += part[l];
        }
    }
    whole
}

/// Bodies of `L` members, scaled to the step.
pub struct Bodies<const L: usize> {
    n: usize,
    kind: Kind,
    h: f64,
    groups: Vec<(usize, Option<usize>)>,
    /// h·G·m, m and ½·h·m of each body.
    strength: Vec<[f64; L]>,
    mass: Vec<[f64; L]>,
    half: Vec<[f64; L]>,
    soft: [f64; L],
    after: Vec<[f64; L]>,
    before: Vec<[f64; L]>,
    potential: Vec<[f64; L]>,
    /// For one system: places, h·G·m of partners, and h·G·m of bodies, along the bodies, for two rounds and more.
    places: Vec<Vec<f64>>,
    partners: Vec<f64>,
    bodies: Vec<f64>,
    control: Option<EnergyControl<L>>,
    projection: Option<Projection<L>>,
    /// h·v̇ of the state that is projected.
    dv: Rows<L>,
}

/// |v|² of a body in a lane.
#[inline(always)]
fn square<const L: usize>(v: &[[f64; L]], dim: usize, i: usize, l: usize) -> f64 {
    let mut square = v[dim * i][l] * v[dim * i][l];
    for v in &v[dim * i + 1..dim * (i + 1)] {
        square += v[l] * v[l];
    }
    square
}

/// h times the kinetic and h times the whole energy.
#[inline(always)]
fn energies<const L: usize>(
    n: usize,
    dim: usize,
    mass: &[[f64; L]],
    half: &[[f64; L]],
    potential: &[[f64; L]],
    v: &[[f64; L]],
) -> ([f64; L], [f64; L]) {
    let kinetic = total(n, |i, l| half[i][l] * square(v, dim, i, l));
    let potential = total::<L>(n, |i, l| mass[i][l] * potential[i][l]);
    let mut energy = kinetic;
    for l in 0..L {
        energy[l] += potential[l];
    }
    (kinetic, energy)
}

/// Sets a state back onto its energy.
struct Back<'a, const L: usize> {
    n: usize,
    dim: usize,
    h: f64,
    projection: &'a Projection<L>,
    mass: &'a [[f64; L]],
    half: &'a [[f64; L]],
    potential: &'a [[f64; L]],
    dv: &'a [[f64; L]],
    v: &'a mut [[f64; L]],
    y: &'a mut [[f64; L]],
}

impl<const L: usize> Task for Back<'_, L> {
    #[inline(always)]
    fn run(self) {
        let Self { n, dim, h, projection, mass, half, potential, dv, v, y } = self;
        let (kinetic, energy) = energies(n, dim, mass, half, potential, v);
        let off = projection.off(&energy);
        if projection.way == Way::Scaling {
            let factor = projection.factor(&kinetic, &off);
            for row in v {
                for l in 0..L {
                    row[l] *= factor[l];
                }
            }
            return;
        }
        // The gradient: m·v in the velocities, −m·a in the coordinates.
        let along = |row: &[[f64; L]], over: f64, r: usize, l: usize| mass[r / dim][l] * (row[r][l] / over);
        let length = |row: &[[f64; L]], over: f64, i: usize, l: usize| {
            let mut square = along(row, over, dim * i, l) * along(row, over, dim * i, l);
            for r in dim * i + 1..dim * (i + 1) {
                square += along(row, over, r, l) * along(row, over, r, l);
            }
            square
        };
        let norm = total::<L>(n, |i, l| length(v, 1.0, i, l) + length(dv, h, i, l));
        let mut step = [0.0; L];
        for l in 0..L {
            step[l] = (off[l] / h) / norm[l];
        }
        for r in 0..n * dim {
            for l in 0..L {
                y[r][l] += step[l] * along(dv, h, r, l);
                v[r][l] -= step[l] * along(v, 1.0, r, l);
            }
        }
    }
}

/// Adds −g·v to an increment, of the energy that was found beside the force.
struct Push<'a, const L: usize> {
    n: usize,
    dim: usize,
    control: &'a EnergyControl<L>,
    mass: &'a [[f64; L]],
    half: &'a [[f64; L]],
    potential: &'a [[f64; L]],
    v: &'a [[f64; L]],
    out: &'a mut [[f64; L]],
}

impl<const L: usize> Task for Push<'_, L> {
    #[inline(always)]
    fn run(self) {
        let (kinetic, energy) = energies(self.n, self.dim, self.mass, self.half, self.potential, self.v);
        let g = self.control.push(&kinetic, &energy);
        for (out, v) in self.out.iter_mut().zip(self.v) {
            for l in 0..L {
                out[l] -= g[l] * v[l];
            }
        }
    }
}

impl<const L: usize> Bodies<L> {
    fn push(&self, v: &Rows<L>, out: &mut Rows<L>) {
        let Some(control) = &self.control else { return };
        let task = Push {
            n: self.n,
            dim: self.kind.dim,
            control,
            mass: &self.mass,
            half: &self.half,
            potential: &self.potential,
            v: lanes(v),
            out: lanes_mut(out),
        };
        with_isa!(self.kind.level, |isa| isa.run(task));
    }

    fn back(&mut self, v: &mut Rows<L>, y: &mut Rows<L>) {
        let Some(projection) = &self.projection else { return };
        let task = Back {
            n: self.n,
            dim: self.kind.dim,
            h: self.h,
            projection,
            mass: &self.mass,
            half: &self.half,
            potential: &self.potential,
            dv: lanes(&self.dv),
            v: lanes_mut(v),
            y: lanes_mut(y),
        };
        with_isa!(self.kind.level, |isa| isa.run(task));
    }
}

// ---- several systems side by side

struct SideBySide<'a, const D: usize, const LAW: u8, const ENERGY: bool, const L: usize> {
    n: usize,
    groups: &'a [(usize, Option<usize>)],
    y: &'a [[f64; L]],
    strength: &'a [[f64; L]],
    soft: &'a [f64; L],
    after: &'a mut [[f64; L]],
    before: &'a mut [[f64; L]],
    potential: &'a mut [[f64; L]],
    out: &'a mut [[f64; L]],
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

// ---- one system, several bodies side by side

type Chunk = [f64; SIDE];

#[inline(always)]
fn load(from: &[f64], at: usize) -> Chunk {
    let mut chunk = [0.0; SIDE];
    chunk.copy_from_slice(&from[at..at + SIDE]);
    chunk
}

struct Along<'a, const D: usize, const LAW: u8, const ENERGY: bool, const L: usize> {
    n: usize,
    groups: &'a [(usize, Option<usize>)],
    y: &'a [f64],
    places: &'a mut [Vec<f64>],
    partners: &'a [f64],
    bodies: &'a [f64],
    soft: f64,
    after: &'a mut [f64],
    before: &'a mut [f64],
    potential: &'a mut [f64],
    out: &'a mut [f64],
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

// ---- the systems

/// h·ẏ, its inverse, and the projection, the same for any number of lanes.
macro_rules! straight {
    () => {
        #[inline(always)]
        fn dy(&mut self, _t: f64, v: &Self::V, _y: &Self::Y, out: &mut Self::Y) {
            for (out, v) in out.as_mut_slice().iter_mut().zip(v.as_slice()) {
                *out = self.h * *v;
            }
        }

        #[inline(always)]
        fn velocity(&mut self, d: &Self::Y, out: &mut Self::V) {
            for (out, d) in out.as_mut_slice().iter_mut().zip(d.as_slice()) {
                *out = *d / self.h;
            }
        }

        #[inline(always)]
        fn settle(&mut self, v: &mut Self::V, y: &mut Self::Y) {
            if self.projection.is_some() {
                let mut dv = std::mem::replace(&mut self.dv, zeros(0));
                self.meet(true, y, &mut dv);
                self.dv = dv;
                self.back(v, y);
            }
        }
    };
}

impl System for Bodies<{ rows::LANES }> {
    type V = Rows<{ rows::LANES }>;
    type Y = Rows<{ rows::LANES }>;

    #[inline(always)]
    fn dv(&mut self, _t: f64, v: &Self::V, y: &Self::Y, out: &mut Self::V) {
        self.meet(self.control.is_some(), y, out);
        self.push(v, out);
    }

    straight!();
}

impl Bodies<{ rows::LANES }> {
    // Never inlined: the kernels stand once in the core, not once in every stage of every method.
    #[inline(never)]
    fn meet(&mut self, energy: bool, y: &Rows<{ rows::LANES }>, out: &mut Rows<{ rows::LANES }>) {
        meet!(self.kind, energy, SideBySide {
            n: self.n,
            groups: &self.groups,
            y: lanes(y),
            strength: &self.strength,
            soft: &self.soft,
            after: &mut self.after,
            before: &mut self.before,
            potential: &mut self.potential,
            out: lanes_mut(out),
        });
    }
}

impl System for Bodies<1> {
    type V = Rows<1>;
    type Y = Rows<1>;

    #[inline(always)]
    fn dv(&mut self, _t: f64, v: &Self::V, y: &Self::Y, out: &mut Self::V) {
        self.meet(self.control.is_some(), y, out);
        self.push(v, out);
    }

    straight!();
}

impl Bodies<1> {
    // Never inlined: the kernels stand once in the core, not once in every stage of every method.
    #[inline(never)]
    fn meet(&mut self, energy: bool, y: &Rows<1>, out: &mut Rows<1>) {
        meet!(self.kind, energy, Along {
            n: self.n,
            groups: &self.groups,
            y: y.as_slice(),
            places: &mut self.places,
            partners: &self.partners,
            bodies: &self.bodies,
            soft: self.soft[0],
            after: self.after.as_flattened_mut(),
            before: self.before.as_flattened_mut(),
            potential: self.potential.as_flattened_mut(),
            out: out.as_mut_slice(),
        });
    }
}

impl<const L: usize> Bodies<L> {
    fn new(spec: &Spec, clock: &Clock, member: impl Fn(usize) -> usize) -> Self {
        let (n, dim, h) = (spec.size(0), spec.size(1), clock.h);
        let law = match spec.options.first() {
            Some(&"newton") => NEWTON,
            Some(&"printed") => PRINTED,
            _ => LOGARITHMIC,
        };
        let row = |at: usize, scale: &dyn Fn(f64) -> f64| -> [f64; L] { std::array::from_fn(|l| scale(spec.at(at, member(l)))) };
        let strength: Vec<[f64; L]> = (0..n).map(|i| row(i, &|m| h * m)).collect();
        // One system: two rounds of partners and what a chunk may reach beyond them, and whole chunks of bodies.
        let (rounds, chunks) = if L == 1 { (2 * n + 4 * SIDE, n.next_multiple_of(SIDE)) } else { (2 * n, n) };
        let along = |i: usize| strength.get(i).map_or(0.0, |row| row[0]);
        let keeps = spec.options.get(1).copied().unwrap_or_default();
        let control = keeps.starts_with("control:").then(|| EnergyControl::new(spec, keeps == "control:limited", 2 * n + 1, h, &member));
        let way = if keeps == "project:nacozy" { Way::Nacozy } else { Way::Scaling };
        let projection = keeps.starts_with("project:").then(|| Projection::new(spec, way, 2 * n + 1, h, &member));
        Bodies {
            n,
            kind: Kind { law, dim, level: clock.level },
            h,
            groups: partners(n),
            mass: (0..n).map(|i| row(n + i, &|m| m)).collect(),
            half: (0..n).map(|i| row(n + i, &|m| (0.5 * h) * m)).collect(),
            soft: row(2 * n, &|e| e * e),
            after: vec![[0.0; L]; dim * chunks],
            before: vec![[0.0; L]; dim * rounds],
            potential: vec![[0.0; L]; chunks],
            places: vec![vec![0.0; rounds]; dim],
            partners: (0..rounds).map(|i| along(i % n)).collect(),
            bodies: (0..chunks).map(along).collect(),
            dv: zeros(if projection.is_some() { n * dim } else { 0 }),
            control,
            projection,
            strength,
        }
    }
}

impl Large<{ rows::LANES }> for Bodies<{ rows::LANES }> {
    fn shape(spec: &Spec) -> (usize, usize) {
        (spec.size(0) * spec.size(1), spec.size(0) * spec.size(1))
    }

    fn prepare(spec: &Spec, clock: &Clock, member: impl Fn(usize) -> usize) -> Self {
        Bodies::new(spec, clock, member)
    }
}

impl Large<1> for Bodies<1> {
    fn shape(spec: &Spec) -> (usize, usize) {
        (spec.size(0) * spec.size(1), spec.size(0) * spec.size(1))
    }

    fn prepare(spec: &Spec, clock: &Clock, member: impl Fn(usize) -> usize) -> Self {
        Bodies::new(spec, clock, member)
    }
}

/// A group of N-body systems.
pub fn group<St: Stepper>(spec: &Spec, clock: &Clock, width: Width) -> Result<Box<dyn Group>, Error> {
    let (&[n, dim @ (2 | 3)], [law, control @ ..]) = (spec.sizes.as_slice(), spec.options.as_slice()) else {
        return Err(spec.unknown_options());
    };
    let more = match control {
        [] => Some(0),
        ["control:printed" | "control:limited"] => Some(2),
        ["project:scaling" | "project:nacozy"] => Some(1),
        _ => None,
    };
    let known = ["logarithmic", "newton", "printed"].contains(law) && more.is_some();
    let expected = 2 * n + 1 + more.unwrap_or(0);
    if !known || n == 0 {
        return Err(spec.unknown_options());
    }
    if spec.rows.len() != expected {
        return Err(Error::Shape { what: "parameters", expected, got: spec.rows.len() });
    }
    if St::RECORD.needs == Needs::Acceleration && !control.is_empty() {
        return Err(Error::VelocityDependent { method: St::RECORD.name, system: "nbody", term: "energy control" });
    }
    // Lanes: what was fastest when tried.
    Ok(match (n, dim, *law, control.len()) {
        (3, 2, "newton", 0) => tile::group::<_, St, 6, 6, 7, 8, 8, 1>(Three::<2, NEWTON>, clock, width),
        (3, 2, _, 0) => tile::group::<_, St, 6, 6, 7, 32, 16, 1>(Three::<2, LOGARITHMIC>, clock, width),
        (3, 3, "newton", 0) => tile::group::<_, St, 9, 9, 7, 8, 8, 1>(Three::<3, NEWTON>, clock, width),
        _ => rows::group::<Bodies<{ rows::LANES }>, Bodies<1>, St>(spec, clock, width),
    })
}

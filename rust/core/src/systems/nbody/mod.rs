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
//! wraps. The order of these sums is the reference's (`partners`), whatever the kernel: two or three bodies in a lane tile, several systems
//! side by side, or one large system with eight bodies at a time.
//!
//! Sizes: bodies, dimensions (2 or 3). Options: the force; then `control:printed`, `control:limited`, `project:scaling` or
//! `project:nacozy`. Recorded: `energy`, `momentum`, `angular_momentum`, `closest`. Parameters: G·m of each body, m of each body, ε; then the target energy, and the gain of a control.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

mod along;
mod beside;
mod energy;
mod few;
mod law;
mod record;
mod share;

use std::thread;

use self::{
    along::{Along, Round, Sums},
    beside::SideBySide,
    energy::{Back, Push},
    few::Few,
    law::{LOGARITHMIC, NEWTON, PRINTED},
    record::{Quantity, Record},
    share::{Share, add, share},
};
use crate::{
    block::at_a_line,
    control::{EnergyControl, Projection, Way},
    error::Error,
    group::{Clock, Group, Spec, Width},
    isa::{Level, with_isa},
    rows::{self, Large, Rows, lanes, lanes_mut, zeros},
    stepper::{Needs, Stepper},
    system::System,
    tile,
};

/// Bodies that are taken side by side in a large system, and parts in which sums over bodies are kept.
const SIDE: usize = 8;
/// Distances k from one to another, `SIDE` apart, or one alone. Each chunk of bodies meets all of a group before the next does.
type Distances = (usize, Option<usize>);
/// Bodies from which on a chunk meets all of a slab's distances that are `SIDE` apart, instead of two.
const LONG: usize = 64;
/// Bodies for each slab, and how many slabs there are at most.
const SLAB: usize = 256;
const SLABS: usize = 16;
/// Bodies from which on threads pay, which are started anew for each force: that takes some hundredths of a millisecond.
const THREADED: usize = 1024;

/// The distances k in groups, and the groups in slabs with sums of their own, in the order in which they are summed. It depends on
/// the number of bodies alone, so that any number of threads may share the slabs.
fn partners(n: usize) -> Vec<Vec<Distances>> {
    if n < LONG {
        let pairs = n / 2 / (2 * SIDE) * (2 * SIDE);
        let long = (1..pairs + 1).step_by(2 * SIDE).flat_map(|k| (k..k + SIDE).map(|k| (k, Some(k + SIDE))));
        return vec![long.chain((pairs + 1..n / 2 + 1).map(|k| (k, None))).collect()];
    }
    let all = (n - 1) / 2;
    let length = all.div_ceil((n / SLAB).clamp(1, SLABS)).next_multiple_of(SIDE);
    let slab = |first: usize| {
        let last = all.min(first + length - 1);
        (first..last.min(first + SIDE - 1) + 1).map(|k| (k, Some(last - (last - k) % SIDE))).collect()
    };
    let mut slabs: Vec<Vec<Distances>> = (1..all + 1).step_by(length).map(slab).collect();
    if let (Some(last), 0) = (slabs.last_mut(), n % 2) {
        last.push((n / 2, None));
    }
    slabs
}

/// How many bodies meet a partner at this distance: all, but opposite ones meet once.
fn meeting(n: usize, k: usize) -> usize {
    if 2 * k == n { k } else { n }
}

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
/// Bodies of `L` members, scaled to the step.
pub struct Bodies<const L: usize> {
    n: usize,
    kind: Kind,
    h: f64,
    slabs: Vec<Vec<Distances>>,
    /// h·G·m, m and ½·h·m of each body.
    strength: Vec<[f64; L]>,
    mass: Vec<[f64; L]>,
    half: Vec<[f64; L]>,
    soft: [f64; L],
    after: Vec<[f64; L]>,
    before: Vec<[f64; L]>,
    potential: Vec<[f64; L]>,
    /// What a slab after the first brings.
    slab: (Rows<L>, Vec<[f64; L]>),
    /// For one system: the bodies along the lanes, and what they collect.
    round: Round,
    /// One for each thread.
    sums: Vec<Sums>,
    /// One for each slab, if there are several threads.
    shares: Vec<Share>,
    control: Option<EnergyControl<L>>,
    projection: Option<Projection<L>>,
    /// What to record of a state.
    record: Vec<Quantity>,
    /// Σ over the evaluations of h times what the push takes from the energy, or h times what the projection took.
    work: [f64; L],
    /// Places whose forces and potentials are at hand, until others are asked for: a state that is projected or recorded, at
    /// which the next step begins.
    at_hand: bool,
    y: Rows<L>,
    dv: Rows<L>,
}
impl<const L: usize> Bodies<L> {
    fn push(&mut self, v: &Rows<L>, out: &mut Rows<L>) {
        match self.kind.dim {
            2 => self.push_in::<2>(v, out),
            _ => self.push_in::<3>(v, out),
        }
    }

    fn push_in<const D: usize>(&mut self, v: &Rows<L>, out: &mut Rows<L>) {
        let Some(control) = &self.control else { return };
        let task = Push::<D, L> {
            control,
            mass: &self.mass,
            half: &self.half,
            potential: &self.potential,
            v: lanes(v),
            out: lanes_mut(out),
            work: &mut self.work,
        };
        with_isa!(self.kind.level, |isa| isa.run(task));
    }

    /// Whether the forces and potentials of these places are at hand.
    fn has(&self, y: &Rows<L>) -> bool {
        self.at_hand && y.as_slice().iter().zip(self.y.as_slice()).all(|(a, b)| a.to_bits() == b.to_bits())
    }

    fn record_in<const D: usize>(&self, v: &Rows<L>, y: &Rows<L>, rows: &mut [f64]) {
        let task = Record::<D, L> {
            h: self.h,
            what: &self.record,
            mass: &self.mass,
            half: &self.half,
            potential: &self.potential,
            v: lanes(v),
            y: lanes(y),
            rows: rows.as_chunks_mut().0,
        };
        with_isa!(self.kind.level, |isa| isa.run(task));
    }

    fn back(&mut self, v: &mut Rows<L>, y: &mut Rows<L>) {
        match self.kind.dim {
            2 => self.back_in::<2>(v, y),
            _ => self.back_in::<3>(v, y),
        }
    }

    fn back_in<const D: usize>(&mut self, v: &mut Rows<L>, y: &mut Rows<L>) {
        let Some(projection) = &self.projection else { return };
        let task = Back::<D, L> {
            h: self.h,
            projection,
            mass: &self.mass,
            half: &self.half,
            potential: &self.potential,
            dv: lanes(&self.dv),
            v: lanes_mut(v),
            y: lanes_mut(y),
            work: &mut self.work,
        };
        with_isa!(self.kind.level, |isa| isa.run(task));
    }
}

/// Everything but the kernel, the same for any number of lanes.
macro_rules! bodies {
    ($lanes:expr) => {
        impl System for Bodies<{ $lanes }> {
            type V = Rows<{ $lanes }>;
            type Y = Rows<{ $lanes }>;

            #[inline(always)]
            fn dv(&mut self, _t: f64, v: &Self::V, y: &Self::Y, out: &mut Self::V) {
                if self.has(y) {
                    out.copy_from(&self.dv);
                } else {
                    self.at_hand = false;
                    self.meet(self.control.is_some(), y, out);
                }
                self.push(v, out);
            }

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
                    self.foresee(y);
                    self.back(v, y);
                }
            }

            #[inline(always)]
            fn foresee(&mut self, y: &Self::Y) {
                if !self.has(y) {
                    let mut dv = std::mem::replace(&mut self.dv, zeros(0));
                    self.meet(true, y, &mut dv);
                    (self.dv, self.at_hand) = (dv, true);
                    self.y.copy_from(y);
                }
            }

            fn record(&mut self, v: &Self::V, y: &Self::Y, rows: &mut [f64]) {
                match self.kind.dim {
                    2 => self.record_in::<2>(v, y, rows),
                    _ => self.record_in::<3>(v, y, rows),
                }
            }

            fn tally(&self) -> &[f64] {
                &self.work
            }

            fn tally_mut(&mut self) -> &mut [f64] {
                &mut self.work
            }
        }

        impl Large<{ $lanes }> for Bodies<{ $lanes }> {
            fn shape(spec: &Spec) -> (usize, usize) {
                (spec.size(0) * spec.size(1), spec.size(0) * spec.size(1))
            }

            fn prepare(spec: &Spec, clock: &Clock, member: impl Fn(usize) -> usize) -> Self {
                Bodies::new(spec, clock, member)
            }

            fn recorded(spec: &Spec) -> usize {
                quantities(spec).fold(0, |numbers, q| numbers + q.size(spec.size(1)))
            }
        }
    };
}

/// What a spec asks to record.
fn quantities(spec: &Spec) -> impl Iterator<Item = Quantity> {
    spec.record.iter().filter_map(|name| Quantity::named(name))
}

bodies!(rows::LANES);
bodies!(1);

impl Bodies<{ rows::LANES }> {
    // Never inlined: the kernels stand once in the core, not once in every stage of every method.
    #[inline(never)]
    fn meet(&mut self, energy: bool, y: &Rows<{ rows::LANES }>, out: &mut Rows<{ rows::LANES }>) {
        for (i, groups) in self.slabs.iter().enumerate() {
            let (force, potential) = if i == 0 { (&mut *out, &mut self.potential) } else { (&mut self.slab.0, &mut self.slab.1) };
            meet!(
                self.kind,
                energy,
                SideBySide {
                    n: self.n,
                    groups,
                    y: lanes(y),
                    strength: &self.strength,
                    soft: &self.soft,
                    after: &mut self.after,
                    before: &mut self.before,
                    potential,
                    out: lanes_mut(force),
                }
            );
            if i > 0 {
                add(out.as_mut_slice(), self.slab.0.as_slice(), true);
            }
            if i > 0 && energy {
                add(self.potential.as_flattened_mut(), self.slab.1.as_flattened(), true);
            }
        }
    }
}

impl Bodies<1> {
    // Never inlined: the kernels stand once in the core, not once in every stage of every method.
    #[inline(never)]
    fn meet(&mut self, energy: bool, y: &Rows<1>, out: &mut Rows<1>) {
        match self.kind.dim {
            2 => self.round.fill::<2>(y.as_slice()),
            _ => self.round.fill::<3>(y.as_slice()),
        }
        let (n, kind, round) = (self.n, self.kind, &self.round);
        let (out, potential) = (out.as_mut_slice(), self.potential.as_flattened_mut());
        if let [sums] = &mut self.sums[..] {
            for (i, groups) in self.slabs.iter().enumerate() {
                meet!(kind, energy, Along { n, groups, round, sums, more: i > 0, potential, out });
            }
            return;
        }
        share(&self.slabs, &mut self.shares, &mut self.sums, |groups, share, sums| {
            let (potential, out) = (&mut share.potential[..], &mut share.force[..]);
            meet!(kind, energy, Along { n, groups, round, sums, more: false, potential, out });
        });
        // Slab after slab, whichever was ready first.
        for (i, share) in self.shares.iter().enumerate() {
            add(out, &share.force, i > 0);
            if energy {
                add(potential, &share.potential, i > 0);
            }
        }
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
        let cleared = |n: usize| at_a_line(|| vec![[0.0; L]; n], |rows| rows.as_flattened());
        let row = |at: usize, scale: &dyn Fn(f64) -> f64| -> [f64; L] { std::array::from_fn(|l| scale(spec.at(at, member(l)))) };
        let mut strength = cleared(n);
        strength.iter_mut().enumerate().for_each(|(i, strength)| *strength = row(i, &|m| h * m));
        let slabs = partners(n);
        // One system: two rounds of partners and what a chunk may reach beyond them, and whole chunks of bodies.
        let (rounds, chunks) = if L == 1 { (2 * n + 4 * SIDE, n.next_multiple_of(SIDE)) } else { (0, 0) };
        let along = |i: usize| strength.get(i).map_or(0.0, |row| row[0]);
        let round = Round {
            places: vec![vec![0.0; rounds]; dim],
            partners: (0..rounds).map(|i| along(i % n)).collect(),
            bodies: (0..chunks).map(along).collect(),
            soft: row(2 * n, &|e| e * e)[0],
        };
        let threads = match clock.threads {
            _ if L > 1 || n < THREADED => 1,
            0 => thread::available_parallelism().map_or(1, usize::from),
            given => given,
        };
        let threads = threads.min(slabs.len());
        let sums = (0..threads).map(|_| Sums::new(&round)).collect();
        let shares = if threads > 1 { slabs.iter().map(|_| Share::new(n, dim)).collect() } else { Vec::new() };
        let beside = if L == 1 { 0 } else { n };
        let again = if slabs.len() > 1 { beside } else { 0 };
        let keeps = spec.options.get(1).copied().unwrap_or_default();
        let control =
            keeps.starts_with("control:").then(|| EnergyControl::new(spec, keeps == "control:limited", 2 * n + 1, h, &member));
        let way = if keeps == "project:nacozy" { Way::Nacozy } else { Way::Scaling };
        let projection = keeps.starts_with("project:").then(|| Projection::new(spec, way, 2 * n + 1, h, &member));
        let kept = if projection.is_some() || !spec.record.is_empty() { n * dim } else { 0 };
        Bodies {
            n,
            kind: Kind { law, dim, level: clock.level },
            h,
            slabs,
            mass: (0..n).map(|i| row(n + i, &|m| m)).collect(),
            half: (0..n).map(|i| row(n + i, &|m| (0.5 * h) * m)).collect(),
            soft: row(2 * n, &|e| e * e),
            after: cleared(dim * beside),
            before: cleared(2 * dim * beside),
            potential: cleared(n),
            slab: (zeros(dim * again), cleared(again)),
            round,
            sums,
            record: quantities(spec).collect(),
            work: [0.0; L],
            at_hand: false,
            y: zeros(kept),
            dv: zeros(kept),
            shares,
            control,
            projection,
            strength,
        }
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
    if let Some(unknown) = spec.record.iter().find(|name| Quantity::named(name).is_none()) {
        return Err(Error::Options { system: spec.system.to_owned(), options: format!("record {unknown}") });
    }
    if St::RECORD.needs == Needs::Acceleration && !control.is_empty() {
        return Err(Error::VelocityDependent { method: St::RECORD.name, system: "nbody", term: "energy control" });
    }
    // Lanes: what was fastest when tried.
    Ok(match (n, dim, *law, control.len() + spec.record.len()) {
        (2, 2, "newton", 0) => tile::group::<_, St, 4, 4, 5, 16, 8, 1, 16, 1>(Few::<2, 2, NEWTON>, clock, width),
        (2, 3, "newton", 0) => tile::group::<_, St, 6, 6, 5, 16, 8, 1, 16, 1>(Few::<2, 3, NEWTON>, clock, width),
        (3, 2, "newton", 0) => tile::group::<_, St, 6, 6, 7, 8, 8, 1, 8, 1>(Few::<3, 2, NEWTON>, clock, width),
        (3, 2, _, 0) => tile::group::<_, St, 6, 6, 7, 32, 16, 1, 16, 1>(Few::<3, 2, LOGARITHMIC>, clock, width),
        (3, 3, "newton", 0) => tile::group::<_, St, 9, 9, 7, 16, 8, 1, 8, 1>(Few::<3, 3, NEWTON>, clock, width),
        _ => rows::group::<Bodies<{ rows::LANES }>, Bodies<1>, St>(spec, clock, width),
    })
}

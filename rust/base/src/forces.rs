//! The forces: several bodies side by side, a lane each.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use std::{
    marker::PhantomData,
    sync::atomic::{AtomicBool, Ordering::Relaxed},
};

use crate::{
    aligned::Aligned,
    bodies::{LANES as SIDE, Law, Rounding, meeting},
    isa::{Isa, Level, Task, with_isa},
};

/// A group of distances k, from one to another, `LANES` apart. All pairs of a chunk of bodies in a group are computed before
/// those of the next chunk.
pub type Distances = (usize, usize);

pub(crate) type Chunk = [f64; SIDE];

#[inline(always)]
fn load(from: &[f64], at: usize) -> Chunk {
    let mut chunk = [0.0; SIDE];
    chunk.copy_from_slice(&from[at..at + SIDE]);
    chunk
}

#[inline(always)]
fn store(to: &mut [f64], at: usize, chunk: &Chunk) {
    to[at..at + SIDE].copy_from_slice(chunk);
}

/// Adds products to sums, each rounded once: all, or what the mask has bits for.
///
/// Where a fused multiply-add is a function's, so is this: the calls of one lane after the other would be most of the kernels.
#[inline(always)]
pub(crate) fn fuse<I: Isa>(sums: &mut Chunk, a: &Chunk, b: &Chunk, met: Option<&[u64; SIDE]>) {
    #[inline(always)]
    fn each(sums: &mut Chunk, a: &Chunk, b: &Chunk, met: Option<&[u64; SIDE]>) {
        for l in 0..SIDE {
            let sum = Rounding::Once.plus(sums[l], a[l], b[l]);
            sums[l] = met.map_or(sum, |met| f64::from_bits(sum.to_bits() & met[l] | sums[l].to_bits() & !met[l]));
        }
    }
    #[inline(never)]
    fn by_function(sums: &mut Chunk, a: &Chunk, b: &Chunk, met: Option<&[u64; SIDE]>) {
        each(sums, a, b, met);
    }
    if I::FUSES { each(sums, a, b, met) } else { by_function(sums, a, b, met) }
}

/// d·d + ε²: see [`Rounding::softened`].
#[inline(always)]
pub(crate) fn softened<I: Isa, const D: usize, const FUSED: bool>(d: &[Chunk; D], soft: f64) -> Chunk {
    let mut r2 = [soft; SIDE];
    if FUSED {
        d.iter().for_each(|d| fuse::<I>(&mut r2, d, d, None));
        return r2;
    }
    for l in 0..SIDE {
        let mut length = d[0][l] * d[0][l];
        for c in 1..D {
            length += d[c][l] * d[c][l];
        }
        r2[l] += length;
    }
    r2
}

/// f(r²) of the law of that number.
#[inline(always)]
pub(crate) fn pulls<I: Isa, const LAW: u8, const FUSED: bool>(r2: &Chunk) -> Chunk {
    #[inline(never)]
    fn by_function(r2: &Chunk) -> Chunk {
        r2.map(|r2| Law::Newton.pull(Rounding::Once, r2))
    }
    if FUSED && LAW == NEWTON && !I::FUSES {
        return by_function(r2);
    }
    let mut pull = [0.0; SIDE];
    for l in 0..SIDE {
        pull[l] = const { law(LAW) }.pull(const { Rounding::of(FUSED) }, r2[l]);
    }
    pull
}

/// Places and masses of the bodies as rows, repeated for two rounds and more.
pub struct Round {
    /// Places, one row as long as that of the partners for each direction.
    places: Aligned,
    /// h·G·m of partners.
    partners: Aligned,
    /// h·G·m of bodies; zero for what fills the last chunk.
    bodies: Aligned,
    /// ε²
    pub soft: f64,
}

impl Round {
    /// An array for `n` bodies: two rounds of partners and what a chunk may read beyond them, and whole chunks of bodies.
    pub fn new(n: usize, dim: usize) -> Self {
        let rounds = (2 * n + 4 * SIDE).next_multiple_of(SIDE);
        Round {
            places: Aligned::new(dim * rounds),
            partners: Aligned::new(rounds),
            bodies: Aligned::new(n.next_multiple_of(SIDE)),
            soft: 0.0,
        }
    }

    /// Takes h·G·m of each body, and ε².
    pub fn take(&mut self, n: usize, strength: impl Fn(usize) -> f64, soft: f64) {
        for i in 0..n {
            self.bodies[i] = strength(i);
        }
        for (i, partner) in self.partners.iter_mut().enumerate() {
            *partner = self.bodies[i % n];
        }
        self.soft = soft;
    }

    /// Takes the places of one round and repeats them.
    pub fn fill<const D: usize>(&mut self, y: &[f64]) {
        let (bodies, _) = y.as_chunks::<D>();
        let n = bodies.len();
        let rounds = self.partners.len();
        for (c, row) in self.places.chunks_exact_mut(rounds).enumerate() {
            let (low, high) = row.split_at_mut(n);
            for (place, body) in low.iter_mut().zip(bodies) {
                *place = body[c];
            }
            for part in high.chunks_mut(n) {
                part.copy_from_slice(&low[..part.len()]);
            }
        }
    }
}

/// Sums of the forces on bodies from the partners after them and before them, the latter over two rounds, and their potential.
pub struct Sums {
    after: Aligned,
    before: Aligned,
    potential: Aligned,
}

impl Sums {
    /// Room for the bodies of a round.
    pub fn new(round: &Round) -> Self {
        let (width, stride) = (round.bodies.len(), round.partners.len());
        let dim = round.places.len() / stride;
        Sums { after: Aligned::new(dim * width), before: Aligned::new(dim * stride), potential: Aligned::new(width) }
    }
}

/// The bodies meet at the distances of one slab.
struct Along<'a, I, const D: usize, const LAW: u8, const ENERGY: bool, const FUSED: bool> {
    level: PhantomData<I>,
    meeting: Meeting<'a>,
}

/// A chunk of bodies, with what they collect.
#[derive(Clone, Copy)]
struct Bodies<const D: usize> {
    place: [Chunk; D],
    strength: Chunk,
    pull: [Chunk; D],
    well: Chunk,
}

/// A chunk of partners, with what they collect.
struct Partners<const D: usize> {
    place: [Chunk; D],
    strength: Chunk,
    pull: [Chunk; D],
}

impl<const D: usize> Bodies<D> {
    /// Adds the forces of a chunk of partners; `met` is a mask, with no bits for pairs that do not count.
    #[inline(always)]
    fn meet<I: Isa, const LAW: u8, const ENERGY: bool, const FUSED: bool>(
        &mut self,
        p: &mut Partners<D>,
        soft: f64,
        met: Option<&[u64; SIDE]>,
    ) {
        let mut d = [[0.0; SIDE]; D];
        for c in 0..D {
            for l in 0..SIDE {
                d[c][l] = p.place[c][l] - self.place[c][l];
            }
        }
        let r2 = softened::<I, D, FUSED>(&d, soft);
        let pull = pulls::<I, LAW, FUSED>(&r2);
        if ENERGY {
            let mut more = [0.0; SIDE];
            for l in 0..SIDE {
                more[l] = const { law(LAW) }.potential(r2[l], pull[l], p.strength[l]);
            }
            add(&mut self.well, more, met);
        }
        let (mut to_i, mut to_j) = ([0.0; SIDE], [0.0; SIDE]);
        for l in 0..SIDE {
            to_i[l] = pull[l] * p.strength[l];
            to_j[l] = pull[l] * self.strength[l];
        }
        // Written out: as a loop it is so long that the compiler leaves it one, and gathers its vectors from three directions.
        self.pull_along::<I, FUSED>(0, p, &d, [&to_i, &to_j], met);
        self.pull_along::<I, FUSED>(1, p, &d, [&to_i, &to_j], met);
        if D == 3 {
            self.pull_along::<I, FUSED>(2, p, &d, [&to_i, &to_j], met);
        }
    }

    /// Adds the forces in one direction.
    #[inline(always)]
    fn pull_along<I: Isa, const FUSED: bool>(
        &mut self,
        c: usize,
        p: &mut Partners<D>,
        d: &[Chunk; D],
        to: [&Chunk; 2],
        met: Option<&[u64; SIDE]>,
    ) {
        if FUSED {
            fuse::<I>(&mut self.pull[c], &d[c], to[0], met);
            fuse::<I>(&mut p.pull[c], &d[c], to[1], met);
            return;
        }
        let (mut of_i, mut of_j) = ([0.0; SIDE], [0.0; SIDE]);
        for l in 0..SIDE {
            of_i[l] = d[c][l] * to[0][l];
            of_j[l] = d[c][l] * to[1][l];
        }
        add(&mut self.pull[c], of_i, met);
        add(&mut p.pull[c], of_j, met);
    }
}

/// Adds to sums what counts: all of it, or what the mask has bits for.
#[inline(always)]
fn add(sums: &mut Chunk, mut more: Chunk, met: Option<&[u64; SIDE]>) {
    if let Some(met) = met {
        for l in 0..SIDE {
            // Adding −0 changes no sum. Bits, not a choice, which would become eight branches.
            more[l] = f64::from_bits(more[l].to_bits() & met[l] | (-0.0f64).to_bits() & !met[l]);
        }
    }
    for l in 0..SIDE {
        sums[l] += more[l];
    }
}

/// The slices that the hot loop goes through, taken once.
struct Hot<'a, I, const D: usize, const LAW: u8, const ENERGY: bool, const FUSED: bool> {
    level: PhantomData<I>,
    places: &'a [f64],
    partners: &'a [f64],
    bodies: &'a [f64],
    soft: f64,
    after: &'a mut [f64],
    before: &'a mut [f64],
    wells: &'a mut [f64],
}

impl<I: Isa, const D: usize, const LAW: u8, const ENERGY: bool, const FUSED: bool> Hot<'_, I, D, LAW, ENERGY, FUSED> {
    /// The chunks of bodies from `A` to `B`, of those that are held, meet the chunk of partners at `at`.
    #[inline(always)]
    fn partner<const A: usize, const B: usize, const U: usize>(
        &mut self,
        held: &mut [Bodies<D>; U],
        at: usize,
        met: Option<&[u64; SIDE]>,
    ) {
        let stride = self.partners.len();
        let strength = load(self.partners, at);
        let mut p = Partners { place: [[0.0; SIDE]; D], strength, pull: [[0.0; SIDE]; D] };
        for c in 0..D {
            p.place[c] = load(self.places, c * stride + at);
            p.pull[c] = load(self.before, c * stride + at);
        }
        for t in A..B {
            held[t].meet::<I, LAW, ENERGY, FUSED>(&mut p, self.soft, if t == U - 1 { met } else { None });
        }
        for c in 0..D {
            store(self.before, c * stride + at, &p.pull[c]);
        }
    }

    /// One or two chunks of bodies, held in registers, meet their partners at `many` distances from `first`, `SIDE` apart. What
    /// the first of two meets at one distance the second meets at the distance before.
    #[inline(always)]
    fn hold<const U: usize>(&mut self, start: usize, first: usize, many: usize, met: Option<&[u64; SIDE]>) {
        let (width, stride) = (self.bodies.len(), self.partners.len());
        let mut held = [Bodies { place: [[0.0; SIDE]; D], strength: [0.0; SIDE], pull: [[0.0; SIDE]; D], well: [0.0; SIDE] }; U];
        for t in 0..U {
            let at = start + SIDE * t;
            for c in 0..D {
                held[t].place[c] = load(self.places, c * stride + at);
                held[t].pull[c] = load(self.after, c * width + at);
            }
            held[t].strength = load(self.bodies, at);
            if ENERGY {
                held[t].well = load(self.wells, at);
            }
        }
        let from = start + first;
        if U == 2 {
            self.partner::<0, 1, U>(&mut held, from, met);
        }
        for q in U - 1..many {
            self.partner::<0, U, U>(&mut held, from + SIDE * q, met);
        }
        if U == 2 {
            self.partner::<1, U, U>(&mut held, from + SIDE * many, met);
        }
        for t in 0..U {
            let at = start + SIDE * t;
            for c in 0..D {
                store(self.after, c * width + at, &held[t].pull[c]);
            }
            if ENERGY {
                store(self.wells, at, &held[t].well);
            }
        }
    }

    /// The bodies from `start` to `end` meet their partners.
    #[inline(always)]
    fn sweep(&mut self, mut start: usize, end: usize, first: usize, many: usize) {
        // Chunk by chunk where a fused multiply-add is a function: that takes all of the time.
        while (I::FUSES || !FUSED) && start + 2 * SIDE <= end {
            self.hold::<2>(start, first, many, None);
            start += 2 * SIDE;
        }
        // What is left, chunk by chunk: the order of every sum is the same.
        while start < end {
            let mut met = [0; SIDE];
            met[..SIDE.min(end - start)].fill(u64::MAX);
            self.hold::<1>(start, first, many, Some(&met));
            start += SIDE;
        }
    }
}

impl<'a, I: Isa, const D: usize, const LAW: u8, const ENERGY: bool, const FUSED: bool> Along<'a, I, D, LAW, ENERGY, FUSED> {
    fn on(_: I, meeting: Meeting<'a>) -> Self {
        Along { level: PhantomData, meeting }
    }

    #[inline(always)]
    fn meet(&mut self) {
        let Meeting { n, groups, round, sums, more, stop, potential: potentials, out } = &mut self.meeting;
        let (n, more) = (*n, *more);
        let (width, stride) = (round.bodies.len(), round.partners.len());
        let Sums { after, before, potential } = &mut **sums;
        let mut hot = Hot::<I, D, LAW, ENERGY, FUSED> {
            level: PhantomData,
            places: &round.places,
            partners: &round.partners,
            bodies: &round.bodies,
            soft: round.soft,
            after,
            before,
            wells: potential,
        };
        hot.after.fill(-0.0);
        hot.before.fill(-0.0);
        if ENERGY {
            hot.wells.fill(0.0);
        }
        for &(first, last) in groups.iter() {
            if stop.load(Relaxed) {
                return;
            }
            let many = (last - first) / SIDE + 1;
            // The others meet at all distances but the last. This is for 32 bodies only, so `count` is whole chunks. A loop, so
            // that the sweep is compiled once.
            let count = meeting(n, last);
            let (mut start, mut end, mut distances) = (0, count, many);
            while start < end && distances > 0 {
                hot.sweep(start, end, first, distances);
                (start, end, distances) = (end, n, many - 1);
            }
        }
        let (out, _) = out.as_chunks_mut::<D>();
        for c in 0..D {
            let (after, before) = (&hot.after[c * width..][..n], &hot.before[c * stride..][..2 * n]);
            let (low, high) = before.split_at(n);
            let sums = after.iter().zip(low).zip(high).map(|((after, low), high)| after - (low + high));
            if more {
                out.iter_mut().zip(sums).for_each(|(out, sum)| out[c] += sum);
            } else {
                out.iter_mut().zip(sums).for_each(|(out, sum)| out[c] = sum);
            }
        }
        if ENERGY {
            for (out, well) in potentials.iter_mut().zip(hot.wells.iter()) {
                *out = if more { *out + well } else { *well };
            }
        }
    }
}

impl<I: Isa, const D: usize, const LAW: u8, const ENERGY: bool, const FUSED: bool> Task for Along<'_, I, D, LAW, ENERGY, FUSED> {
    #[inline(always)]
    fn run(mut self) {
        self.meet();
    }
}

/// The law of that number: kernels are made for numbers.
pub(crate) const fn law(number: u8) -> Law {
    match number {
        LOGARITHMIC => Law::Logarithmic,
        NEWTON => Law::Newton,
        _ => Law::Printed,
    }
}
pub(crate) const LOGARITHMIC: u8 = 0;
pub(crate) const NEWTON: u8 = 1;
const PRINTED: u8 = 2;

/// The kernel that meets the bodies: chosen once, called for each force.
#[derive(Clone, Copy, Debug)]
pub struct Kernel {
    /// The force.
    pub law: Law,
    /// How often its products are rounded.
    pub rounding: Rounding,
    /// 2 or 3.
    pub dim: usize,
    /// The instruction set.
    pub level: Level,
}

/// The input and output of a kernel: the bodies meet at the distances of one slab.
pub struct Meeting<'a> {
    /// How many bodies.
    pub n: usize,
    /// The distances at which they meet.
    pub groups: &'a [Distances],
    /// The places of the bodies.
    pub round: &'a Round,
    /// Buffers for the sums of each body.
    pub sums: &'a mut Sums,
    /// Whether to add to these sums, or to replace them.
    pub more: bool,
    /// When set, the kernel returns early with unfinished sums.
    pub stop: &'a AtomicBool,
    /// h times the potential of each body.
    pub potential: &'a mut [f64],
    /// h times the acceleration of each body.
    pub out: &'a mut [f64],
}

impl Kernel {
    /// Computes the forces, and with `energy` the potential too.
    pub fn meet(self, energy: bool, meeting: Meeting) {
        match (self.dim, self.law, energy) {
            (2, Law::Newton, false) => self.by::<2, NEWTON, false>(meeting),
            (2, _, false) => self.by::<2, LOGARITHMIC, false>(meeting),
            (_, Law::Newton, false) => self.by::<3, NEWTON, false>(meeting),
            (_, _, false) => self.by::<3, LOGARITHMIC, false>(meeting),
            (2, Law::Logarithmic, true) => self.by::<2, LOGARITHMIC, true>(meeting),
            (2, Law::Newton, true) => self.by::<2, NEWTON, true>(meeting),
            (2, Law::Printed, true) => self.by::<2, PRINTED, true>(meeting),
            (_, Law::Logarithmic, true) => self.by::<3, LOGARITHMIC, true>(meeting),
            (_, Law::Newton, true) => self.by::<3, NEWTON, true>(meeting),
            (_, Law::Printed, true) => self.by::<3, PRINTED, true>(meeting),
        }
    }

    fn by<const D: usize, const LAW: u8, const ENERGY: bool>(self, meeting: Meeting) {
        match self.rounding {
            Rounding::Twice => {
                with_isa!(self.level, |isa| isa.run(Along::<_, D, LAW, ENERGY, false>::on(isa, meeting)))
            }
            // Without the instruction a fused multiply-add takes a hundred times as long, so the best of the machine is taken.
            Rounding::Once => {
                with_isa!(self.level.of_loops(), |isa| isa.run(Along::<_, D, LAW, ENERGY, true>::on(isa, meeting)))
            }
        }
    }
}

//! The lane tile: small systems, many members.
//!
//! A tile holds `L` members, one number of every member to a row: `[[f64; L]; N]`. The innermost loop runs over the lanes and
//! calls the fully inlined step on nalgebra vectors of one member; the compiler turns it into vector instructions, and a tile
//! that fits stays in registers for as many steps as are taken at once.

use std::{array::from_fn, marker::PhantomData};

use nalgebra::{SMatrix, SVector};

use crate::{
    abreast::Abreast,
    block::Work,
    group::{Clock, Group, Row, Spec, Table, Width},
    isa::{Baseline, Isa, Task, with_isa},
    pace::{self, NUMBERS, Pace, Stretched, Trial},
    stepper::Stepper,
    system::System,
    trig,
};

/// A family of small systems: `P` velocities, `Q` coordinates, `C` parameters and as many constants.
pub trait Small<const P: usize, const Q: usize, const C: usize>: Send + Sync + 'static {
    /// The system of one member. It may look into the sampled inputs.
    type Member<'a, const L: usize>: System<V = SVector<f64, P>, Y = SVector<f64, Q>>;

    /// A member's constants: its parameters, scaled to the step.
    fn constants(&self, h: f64, parameters: [f64; C]) -> [f64; C];

    /// The factor that scales a member's `i`-th sampled input to the step.
    fn input_factor(&self, _h: f64, _parameters: [f64; C], _i: usize) -> f64 {
        1.0
    }

    /// Frequency and phase of a sinusoid that all members have in common; it then stands after the sampled inputs.
    fn beat(&self, _spec: &Spec) -> Option<(f64, f64)> {
        None
    }

    /// A member's system from its constants.
    fn member<'a, const L: usize>(
        h: f64,
        constants: [f64; C],
        inputs: &[View<'a, L>; INPUTS],
        lane: usize,
    ) -> Self::Member<'a, L>;
}

/// A sampled input over the lanes of a group; or without samples, a sinusoid of the frequency `start` and the phase `interval`.
#[derive(Clone, Debug)]
pub struct Samples<const L: usize> {
    rows: Vec<[f64; L]>,
    start: f64,
    interval: f64,
}

/// A sample's instant may be missed by the rounding of t = t₀ + k·h; a time this fraction of an interval before it counts as it.
pub const HOLD_SLACK: f64 = 1e-6;

impl<const L: usize> Samples<L> {
    /// The samples of the lanes' members, each times its lane's factor.
    pub fn new(table: &Table, factor: impl Fn(usize) -> f64, member: impl Fn(usize) -> usize) -> Self {
        let over_lanes = |row: &Row| -> [f64; L] { from_fn(|l| factor(l) * row.at(member(l))) };
        Samples { rows: table.samples.iter().map(over_lanes).collect(), start: table.start, interval: table.interval }
    }

    /// All of a spec's, of the members from a first one on; lanes past the `count`-th repeat the last.
    #[inline(never)]
    fn all(spec: &Spec, factors: &[[f64; L]; INPUTS], first: usize, count: usize) -> Vec<Self> {
        let made = spec.tables.iter().zip(factors);
        made.map(|(table, factors)| Self::new(table, |l| factors[l], |l| first + l.min(count - 1))).collect()
    }

    /// Takes a member's samples into a lane.
    #[inline(never)]
    fn set(&mut self, lane: usize, table: &Table, factor: f64, member: usize) {
        for (row, sample) in self.rows.iter_mut().zip(&table.samples) {
            row[lane] = factor * sample.at(member);
        }
    }

    /// A sinusoid for all lanes, of this frequency and phase.
    fn of_beat((omega, phase): (f64, f64)) -> Self {
        Samples { rows: Vec::new(), start: omega, interval: phase }
    }

    /// The same samples, to look into.
    #[inline(always)]
    pub fn view(&self) -> View<'_, L> {
        View { rows: &self.rows, start: self.start, interval: self.interval }
    }
}

/// How many sampled inputs a small system may have.
pub const INPUTS: usize = 2;

/// A sampled input to look into.
#[derive(Clone, Copy, Debug)]
pub struct View<'a, const L: usize> {
    rows: &'a [[f64; L]],
    start: f64,
    interval: f64,
}

impl<'a, const L: usize> View<'a, L> {
    /// The views of a group's inputs; an input that is not there has no samples.
    #[inline(always)]
    fn all(inputs: &'a [Samples<L>]) -> [Self; INPUTS] {
        from_fn(|i| inputs.get(i).map_or(View { rows: &[], start: 0.0, interval: 1.0 }, Samples::view))
    }

    /// The lanes' values at time `t`: the last sample not after it, or the first or last one outside.
    ///
    /// Written without a branch, so that a loop over the lanes can look once for all of them.
    #[inline(always)]
    pub fn at(&self, t: f64) -> &'a [f64; L] {
        // A cast of a negative number gives 0, of a large one the largest: both are what holding means.
        let i = ((t - self.start) / self.interval + HOLD_SLACK).floor() as usize;
        self.rows.get(i).or(self.rows.last()).unwrap_or(&[f64::NAN; L])
    }

    /// The sine of a sinusoid that all lanes have in common, which a loop over the lanes computes once for all of them.
    #[inline(always)]
    pub fn beat(&self, t: f64) -> f64 {
        trig::sin(self.start * t + self.interval)
    }
}

/// Numbers that begin at a cache line. A vector that lies across two lines takes two reads: without this, the same kernel was a fifth
/// slower or not, as the allocator and the stack had it.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct AtALine<T>(T);

struct Tile<S, St, I, const P: usize, const Q: usize, const C: usize, const L: usize, const W: usize, const PACED: bool> {
    clock: Clock,
    isa: I,
    family: S,
    constants: AtALine<[[f64; L]; C]>,
    inputs: Vec<Samples<L>>,
    v: AtALine<[[f64; L]; P]>,
    y: AtALine<[[f64; L]; Q]>,
    stepper: PhantomData<fn() -> St>,
}

/// The numbers of a lane.
#[inline(always)]
fn column<const R: usize, const L: usize>(rows: &[[f64; L]; R], lane: usize) -> SVector<f64, R> {
    SVector::from_fn(|i, _| rows[i][lane])
}

/// Puts them back.
#[inline(always)]
fn put<const R: usize, const L: usize>(rows: &mut [[f64; L]; R], lane: usize, numbers: &SVector<f64, R>) {
    for i in 0..R {
        rows[i][lane] = numbers[i];
    }
}

/// One step of a system.
#[inline(always)]
fn step<M: System, St: Stepper>(mut s: M, t: f64, h: f64, v: &mut M::V, y: &mut M::Y) {
    let mut work = Work::new(St::RECORD.evaluations, v, y);
    St::step(&mut s, t, h, v, y, &mut work);
    s.settle(v, y);
}

/// The kernel: `n` steps of every lane.
struct Steps<'a, S, St, const P: usize, const Q: usize, const C: usize, const L: usize, const W: usize> {
    clock: Clock,
    k: i64,
    n: i64,
    constants: &'a AtALine<[[f64; L]; C]>,
    inputs: &'a [Samples<L>],
    v: &'a mut AtALine<[[f64; L]; P]>,
    y: &'a mut AtALine<[[f64; L]; Q]>,
    family: PhantomData<fn() -> (S, St)>,
}

impl<S, St, const P: usize, const Q: usize, const C: usize, const L: usize, const W: usize> Task
    for Steps<'_, S, St, P, Q, C, L, W>
where
    S: Small<P, Q, C>,
    St: Stepper,
{
    #[inline(always)]
    fn run(self) {
        // Copies: the compiler can prove that nothing else looks at them, and keeps small ones in registers over all steps.
        let (constants, mut v, mut y) = (self.constants, *self.v, *self.y);
        let (h, inputs) = (self.clock.h, View::all(self.inputs));
        for k in self.k..self.k + self.n {
            let t = self.clock.at(k);
            let member = |l: usize| S::member(h, from_fn(|c| constants.0[c][l]), &inputs, l);
            if const { W == 1 } {
                for l in 0..L {
                    let (mut vl, mut yl) = (column(&v.0, l), column(&y.0, l));
                    step::<_, St>(member(l), t, h, &mut vl, &mut yl);
                    put(&mut v.0, l, &vl);
                    put(&mut y.0, l, &yl);
                }
                continue;
            }
            // Lane l goes with l + L/W, l + 2·L/W and so on: neighbours stay neighbours, and are one vector.
            const { assert!(L.is_multiple_of(W)) };
            for l in 0..L / W {
                let lane = |w: usize| l + w * (L / W);
                let mut vl = SMatrix::<f64, P, W>::from_columns(&from_fn::<_, W, _>(|w| column(&v.0, lane(w))));
                let mut yl = SMatrix::<f64, Q, W>::from_columns(&from_fn::<_, W, _>(|w| column(&y.0, lane(w))));
                step::<_, St>(Abreast(from_fn(|w| member(lane(w)))), t, h, &mut vl, &mut yl);
                for w in 0..W {
                    put(&mut v.0, lane(w), &vl.column(w).into_owned());
                    put(&mut y.0, lane(w), &yl.column(w).into_owned());
                }
            }
        }
        (*self.v, *self.y) = (v, y);
    }
}

/// The kernel of steps of chosen length: so many attempts of every lane.
struct Attempts<'a, S, St, const P: usize, const Q: usize, const C: usize, const L: usize> {
    paces: &'a mut [[f64; L]; NUMBERS],
    budget: f64,
    attempts: u32,
    constants: &'a AtALine<[[f64; L]; C]>,
    inputs: &'a [Samples<L>],
    v: &'a mut AtALine<[[f64; L]; P]>,
    y: &'a mut AtALine<[[f64; L]; Q]>,
    family: PhantomData<fn() -> (S, St)>,
}

impl<S, St, const P: usize, const Q: usize, const C: usize, const L: usize> Task for Attempts<'_, S, St, P, Q, C, L>
where
    S: Small<P, Q, C>,
    St: Stepper,
{
    #[inline(always)]
    fn run(self) {
        let (constants, mut paces, mut v, mut y) = (self.constants, *self.paces, *self.v, *self.y);
        let inputs = View::all(self.inputs);
        for _ in 0..self.attempts {
            for l in 0..L {
                let mut s = Stretched::new(S::member(1.0, from_fn(|c| constants.0[c][l]), &inputs, l));
                let (mut vl, mut yl) = (column(&v.0, l), column(&y.0, l));
                let mut trial = Trial::new(St::RECORD.evaluations, &vl, &yl);
                let mut pace = Pace::load(&paces, l);
                pace::attempt::<S::Member<'_, L>, St>(&mut pace, self.budget, &mut s, &mut vl, &mut yl, &mut trial);
                put(&mut v.0, l, &vl);
                put(&mut y.0, l, &yl);
                for (row, number) in paces.iter_mut().zip(pace.numbers()) {
                    row[l] = number;
                }
            }
        }
        (*self.paces, *self.v, *self.y) = (paces, v, y);
    }
}

impl<S, St, I, const P: usize, const Q: usize, const C: usize, const L: usize, const W: usize, const PACED: bool>
    Tile<S, St, I, P, Q, C, L, W, PACED>
where
    S: Small<P, Q, C>,
    St: Stepper,
    I: Isa,
{
    /// Whether it has the kernel for steps of chosen length, and then no other.
    const ADAPTS: bool = PACED && St::RECORD.error_order.is_some();

    fn boxed(family: S, isa: I, clock: &Clock) -> Box<dyn Group> {
        Box::new(Self {
            clock: *clock,
            isa,
            family,
            constants: AtALine([[0.0; L]; C]),
            inputs: Vec::new(),
            v: AtALine([[0.0; L]; P]),
            y: AtALine([[0.0; L]; Q]),
            stepper: PhantomData,
        })
    }

    /// Calls `f` with each lane's system and blocks, and keeps the `v` that it leaves.
    #[inline(always)]
    fn each_v(
        &mut self,
        f: impl for<'a> Fn(&mut S::Member<'a, L>, &mut SVector<f64, P>, &SVector<f64, Q>, &mut Work<S::Member<'a, L>>),
    ) {
        let inputs = View::all(&self.inputs);
        for l in 0..L {
            let mut s = S::member(self.clock.h, from_fn(|c| self.constants.0[c][l]), &inputs, l);
            let (mut v, y) = (column(&self.v.0, l), column(&self.y.0, l));
            let mut work = Work::new(St::RECORD.evaluations, &v, &y);
            f(&mut s, &mut v, &y, &mut work);
            put(&mut self.v.0, l, &v);
        }
    }
}

impl<S, St, I, const P: usize, const Q: usize, const C: usize, const L: usize, const W: usize, const PACED: bool> Group
    for Tile<S, St, I, P, Q, C, L, W, PACED>
where
    S: Small<P, Q, C>,
    St: Stepper,
    I: Isa,
{
    fn lanes(&self) -> usize {
        L
    }

    fn pays_for(&self, members: usize, lanes: usize) -> bool {
        // A lane of a narrow group is a sixth as fast as one of a wide one, or faster.
        members <= L || 6 * members.next_multiple_of(L) <= lanes
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        prepare(&self.family, self.clock.h, spec, (first, count), &mut self.constants.0, &mut self.inputs);
    }

    fn adapts(&self) -> bool {
        Self::ADAPTS
    }

    fn prepare_lane(&mut self, spec: &Spec, lane: usize, member: usize) {
        prepare_lane(&self.family, spec, lane, member, &mut self.constants.0, &mut self.inputs);
    }

    fn adapt(&mut self, paces: &mut [f64], budget: f64, attempts: u32) {
        if const { Self::ADAPTS }
            && let Ok(paces) = paces.as_chunks_mut().0.try_into()
        {
            self.isa.run(Attempts::<S, St, P, Q, C, L> {
                paces,
                budget,
                attempts,
                constants: &self.constants,
                inputs: &self.inputs,
                v: &mut self.v,
                y: &mut self.y,
                family: PhantomData,
            });
        }
    }

    fn slots(&self) -> (&[f64], &[f64]) {
        (self.v.0.as_flattened(), self.y.0.as_flattened())
    }

    fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        (self.v.0.as_flattened_mut(), self.y.0.as_flattened_mut())
    }

    fn start(&mut self, k: i64) {
        if const { PACED || St::RECORD.carry.is_none() } {
            return;
        }
        let (t, choice) = (self.clock.at(k), self.clock.start);
        self.each_v(|s, v, y, work| St::start(s, choice, t, v, y, work));
    }

    fn advance(&mut self, k: i64, n: i64) {
        if const { PACED } {
            return;
        }
        self.isa.run(Steps::<S, St, P, Q, C, L, W> {
            clock: self.clock,
            k,
            n,
            constants: &self.constants,
            inputs: &self.inputs,
            v: &mut self.v,
            y: &mut self.y,
            family: PhantomData,
        });
    }

    fn finish(&mut self, k: i64) {
        if const { PACED || St::RECORD.carry.is_none() } {
            return;
        }
        let (t, choice) = (self.clock.at(k), self.clock.start);
        self.each_v(|s, v, y, work| St::finish(s, choice, t, v, y, work));
    }
}

// What follows is not part of a kernel. It stands apart so that there is one of it for each family and number of lanes, and not one
// for each method and CPU level: two thirds of the core were such copies.

/// Takes the constants and the inputs of the members from a first one on.
#[inline(never)]
fn prepare<S: Small<P, Q, C>, const P: usize, const Q: usize, const C: usize, const L: usize>(
    family: &S,
    h: f64,
    spec: &Spec,
    (first, count): (usize, usize),
    constants: &mut [[f64; L]; C],
    inputs: &mut Vec<Samples<L>>,
) {
    let mut parameters = [[0.0; L]; C];
    for (lanes, row) in parameters.iter_mut().zip(&spec.rows) {
        row.fill(first, count, lanes);
    }
    let mut factors = [[1.0; L]; INPUTS];
    for l in 0..L {
        let parameters = from_fn(|i| parameters[i][l]);
        for (row, c) in constants.iter_mut().zip(family.constants(h, parameters)) {
            row[l] = c;
        }
        for (i, row) in factors.iter_mut().enumerate().take(spec.tables.len()) {
            row[l] = family.input_factor(h, parameters, i);
        }
    }
    *inputs = Samples::all(spec, &factors, first, count);
    inputs.extend(family.beat(spec).map(Samples::of_beat));
}

/// Takes the constants and the inputs of a member into a lane, scaled to a step of 1.
#[inline(never)]
fn prepare_lane<S: Small<P, Q, C>, const P: usize, const Q: usize, const C: usize, const L: usize>(
    family: &S,
    spec: &Spec,
    lane: usize,
    member: usize,
    constants: &mut [[f64; L]; C],
    inputs: &mut Vec<Samples<L>>,
) {
    let beat = family.beat(spec).map(Samples::of_beat);
    if inputs.len() != spec.tables.len() + usize::from(beat.is_some()) {
        *inputs = Samples::all(spec, &[[0.0; L]; INPUTS], member, 1);
        inputs.extend(beat);
    }
    let parameters = from_fn(|i| spec.at(i, member));
    for (row, c) in constants.iter_mut().zip(family.constants(1.0, parameters)) {
        row[lane] = c;
    }
    for (i, (samples, table)) in inputs.iter_mut().zip(&spec.tables).enumerate() {
        samples.set(lane, table, family.input_factor(1.0, parameters, i), member);
    }
}

/// A group of a family of small systems: `WIDE` lanes under AVX-512, so many of them `ABREAST`, `HALF` below it, a narrow one of
/// `FEW`, or `OWN` lanes that go at a pace of their own each. An attempt is long, so a vector or two of those keep the machine busy.
pub fn group<
    S,
    St,
    const P: usize,
    const Q: usize,
    const C: usize,
    const WIDE: usize,
    const HALF: usize,
    const FEW: usize,
    const OWN: usize,
    const ABREAST: usize,
>(
    family: S,
    clock: &Clock,
    width: Width,
) -> Box<dyn Group>
where
    S: Small<P, Q, C>,
    St: Stepper,
{
    if const { St::RECORD.error_order.is_some() } {
        match width {
            // One member has few numbers to put side by side: no level brought more than a tenth when tried.
            Width::Lone => return Tile::<S, St, _, P, Q, C, 1, 1, true>::boxed(family, Baseline, clock),
            Width::Paced => {
                return with_isa!(clock.level, |isa| Tile::<S, St, _, P, Q, C, OWN, 1, true>::boxed(family, isa, clock));
            }
            _ => {}
        }
    }
    match width {
        Width::Wide => with_isa!(
            clock.level,
            |isa| Tile::<S, St, _, P, Q, C, WIDE, ABREAST, false>::boxed(family, isa, clock),
            Tile::<S, St, _, P, Q, C, HALF, 1, false>::boxed(family, isa, clock)
        ),
        _ => with_isa!(clock.level, |isa| Tile::<S, St, _, P, Q, C, FEW, 1, false>::boxed(family, isa, clock)),
    }
}

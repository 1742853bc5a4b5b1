//! The lane tile: small systems, many members.
//!
//! A tile holds `L` members, one number of every member to a row: `[[f64; L]; N]`. The innermost loop runs over the lanes and
//! calls the fully inlined step on nalgebra vectors of one member; the compiler turns it into vector instructions, and a tile
//! that fits stays in registers for as many steps as are taken at once.

use std::{array::from_fn, marker::PhantomData};

use nalgebra::SVector;

use crate::{
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

struct Tile<S, St, I, const P: usize, const Q: usize, const C: usize, const L: usize, const PACED: bool> {
    clock: Clock,
    isa: I,
    family: S,
    constants: [[f64; L]; C],
    inputs: Vec<Samples<L>>,
    v: [[f64; L]; P],
    y: [[f64; L]; Q],
    stepper: PhantomData<fn() -> St>,
}

/// The kernel: `n` steps of every lane.
struct Steps<'a, S, St, const P: usize, const Q: usize, const C: usize, const L: usize> {
    clock: Clock,
    k: i64,
    n: i64,
    constants: &'a [[f64; L]; C],
    inputs: &'a [Samples<L>],
    v: &'a mut [[f64; L]; P],
    y: &'a mut [[f64; L]; Q],
    family: PhantomData<fn() -> (S, St)>,
}

impl<S, St, const P: usize, const Q: usize, const C: usize, const L: usize> Task for Steps<'_, S, St, P, Q, C, L>
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
            for l in 0..L {
                let mut s = S::member(h, from_fn(|c| constants[c][l]), &inputs, l);
                let mut vl = SVector::from_fn(|i, _| v[i][l]);
                let mut yl = SVector::from_fn(|i, _| y[i][l]);
                let mut work = Work::new(St::RECORD.evaluations, &vl, &yl);
                St::step(&mut s, t, h, &mut vl, &mut yl, &mut work);
                s.settle(&mut vl, &mut yl);
                for i in 0..P {
                    v[i][l] = vl[i];
                }
                for i in 0..Q {
                    y[i][l] = yl[i];
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
    constants: &'a [[f64; L]; C],
    inputs: &'a [Samples<L>],
    v: &'a mut [[f64; L]; P],
    y: &'a mut [[f64; L]; Q],
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
                let mut s = Stretched::new(S::member(1.0, from_fn(|c| constants[c][l]), &inputs, l));
                let mut vl = SVector::from_fn(|i, _| v[i][l]);
                let mut yl = SVector::from_fn(|i, _| y[i][l]);
                let mut trial = Trial::new(St::RECORD.evaluations, &vl, &yl);
                let mut pace = Pace::load(&paces, l);
                pace::attempt::<S::Member<'_, L>, St>(&mut pace, self.budget, &mut s, &mut vl, &mut yl, &mut trial);
                for i in 0..P {
                    v[i][l] = vl[i];
                }
                for i in 0..Q {
                    y[i][l] = yl[i];
                }
                for (row, number) in paces.iter_mut().zip(pace.numbers()) {
                    row[l] = number;
                }
            }
        }
        (*self.paces, *self.v, *self.y) = (paces, v, y);
    }
}

impl<S, St, I, const P: usize, const Q: usize, const C: usize, const L: usize, const PACED: bool>
    Tile<S, St, I, P, Q, C, L, PACED>
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
            constants: [[0.0; L]; C],
            inputs: Vec::new(),
            v: [[0.0; L]; P],
            y: [[0.0; L]; Q],
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
            let mut s = S::member(self.clock.h, from_fn(|c| self.constants[c][l]), &inputs, l);
            let mut v = SVector::from_fn(|i, _| self.v[i][l]);
            let y = SVector::from_fn(|i, _| self.y[i][l]);
            let mut work = Work::new(St::RECORD.evaluations, &v, &y);
            f(&mut s, &mut v, &y, &mut work);
            for i in 0..P {
                self.v[i][l] = v[i];
            }
        }
    }
}

impl<S, St, I, const P: usize, const Q: usize, const C: usize, const L: usize, const PACED: bool> Group
    for Tile<S, St, I, P, Q, C, L, PACED>
where
    S: Small<P, Q, C>,
    St: Stepper,
    I: Isa,
{
    fn lanes(&self) -> usize {
        L
    }

    fn pays_for(&self, members: usize) -> bool {
        members <= L
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        prepare(&self.family, self.clock.h, spec, (first, count), &mut self.constants, &mut self.inputs);
    }

    fn adapts(&self) -> bool {
        Self::ADAPTS
    }

    fn prepare_lane(&mut self, spec: &Spec, lane: usize, member: usize) {
        prepare_lane(&self.family, spec, lane, member, &mut self.constants, &mut self.inputs);
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
        (self.v.as_flattened(), self.y.as_flattened())
    }

    fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        (self.v.as_flattened_mut(), self.y.as_flattened_mut())
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
        self.isa.run(Steps::<S, St, P, Q, C, L> {
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

/// A group of a family of small systems: `WIDE` lanes under AVX-512, `HALF` below it, a narrow one of `FEW`, or `OWN` lanes that go at
/// a pace of their own each. An attempt is long, so a vector or two of those keep the machine busy.
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
            Width::Lone => return Tile::<S, St, _, P, Q, C, 1, true>::boxed(family, Baseline, clock),
            Width::Paced => {
                return with_isa!(clock.level, |isa| Tile::<S, St, _, P, Q, C, OWN, true>::boxed(family, isa, clock));
            }
            _ => {}
        }
    }
    match width {
        Width::Wide => with_isa!(
            clock.level,
            |isa| Tile::<S, St, _, P, Q, C, WIDE, false>::boxed(family, isa, clock),
            Tile::<S, St, _, P, Q, C, HALF, false>::boxed(family, isa, clock)
        ),
        _ => with_isa!(clock.level, |isa| Tile::<S, St, _, P, Q, C, FEW, false>::boxed(family, isa, clock)),
    }
}

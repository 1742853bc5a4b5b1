//! Rows of lanes: systems of any size.
//!
//! The blocks are nalgebra matrices of `L` lanes × n rows on the heap. The same steps run over them; the lane loop is inside
//! every operation instead of around the step. One lane serves a single large system, whose operations then run along its
//! rows.

use std::marker::PhantomData;

use nalgebra::{Const, Dyn, OMatrix};

use crate::{
    block::{Block, Work, at_a_line},
    group::{Clock, Group, Spec, Width},
    isa::{Isa, Task, with_isa},
    pace::{self, NUMBERS, Pace, Stretched, Trial},
    stepper::Stepper,
    system::System,
};

/// Rows of `L` lanes each: one column per row of numbers.
pub type Rows<const L: usize> = OMatrix<f64, Const<L>, Dyn>;

/// Lanes of a group of several large members.
pub const LANES: usize = 8;

/// `n` rows of `L` lanes, all zero.
pub fn zeros<const L: usize>(n: usize) -> Rows<L> {
    at_a_line(|| Rows::<L>::zeros_generic(Const::<L>, Dyn(n)), |rows| rows.as_slice())
}

/// The rows as arrays of lanes.
#[inline(always)]
pub fn lanes<const L: usize>(rows: &Rows<L>) -> &[[f64; L]] {
    rows.as_slice().as_chunks().0
}

/// The rows as arrays of lanes, to write.
#[inline(always)]
pub fn lanes_mut<const L: usize>(rows: &mut Rows<L>) -> &mut [[f64; L]] {
    rows.as_mut_slice().as_chunks_mut().0
}

/// A system of any size over `L` lanes.
pub trait Large<const L: usize>: System<V = Rows<L>, Y = Rows<L>> + Send + Sync + 'static {
    /// The system of the members that `member` names for each lane, scaled to the step.
    fn prepare(spec: &Spec, clock: &Clock, member: impl Fn(usize) -> usize) -> Self;

    /// How many velocities and coordinates a member has.
    fn shape(spec: &Spec) -> (usize, usize);

    /// How many numbers of a member it records.
    fn recorded(_spec: &Spec) -> usize {
        0
    }
}

struct RowGroup<S: Large<L>, St, I, const L: usize> {
    clock: Clock,
    isa: I,
    system: Option<S>,
    v: Rows<L>,
    y: Rows<L>,
    work: Work<S>,
    recorded: usize,
    trial: Option<Trial<S>>,
    stepper: PhantomData<fn() -> St>,
}

struct Steps<'a, S: System, St> {
    clock: Clock,
    k: i64,
    n: i64,
    system: &'a mut S,
    v: &'a mut S::V,
    y: &'a mut S::Y,
    work: &'a mut Work<S>,
    stepper: PhantomData<fn() -> St>,
}

impl<S: System, St: Stepper> Task for Steps<'_, S, St> {
    #[inline(always)]
    fn run(self) {
        for k in self.k..self.k + self.n {
            St::step(self.system, self.clock.at(k), self.clock.h, self.v, self.y, self.work);
            self.system.settle(self.v, self.y);
        }
    }
}

/// So many attempts of a single member.
struct Attempts<'a, S: System, St> {
    pace: &'a mut Pace,
    budget: f64,
    attempts: u32,
    system: &'a mut Stretched<S>,
    v: &'a mut S::V,
    y: &'a mut S::Y,
    trial: &'a mut Trial<S>,
    stepper: PhantomData<fn() -> St>,
}

impl<S: System, St: Stepper> Task for Attempts<'_, S, St> {
    #[inline(always)]
    fn run(self) {
        for _ in 0..self.attempts {
            if self.pace.runs(self.budget) {
                pace::attempt::<S, St>(self.pace, self.budget, self.system, self.v, self.y, self.trial);
            }
        }
    }
}

impl<S: Large<L>, St: Stepper, I: Isa, const L: usize> RowGroup<S, St, I, L> {
    fn boxed(isa: I, clock: &Clock, spec: &Spec) -> Box<dyn Group> {
        let (p, q) = S::shape(spec);
        let (v, y) = (zeros(p), zeros(q));
        let work = Work::new(St::RECORD.evaluations, &v, &y);
        let recorded = S::recorded(spec);
        Box::new(Self { clock: *clock, isa, system: None, v, y, work, recorded, trial: None, stepper: PhantomData::<fn() -> St> })
    }
}

impl<S: Large<L>, St: Stepper, I: Isa, const L: usize> Group for RowGroup<S, St, I, L>
where
    Work<S>: Send + Sync,
{
    fn lanes(&self) -> usize {
        L
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        self.system = Some(prepared(spec, &self.clock, first, count));
    }

    fn slots(&self) -> (&[f64], &[f64]) {
        (self.v.numbers(), self.y.numbers())
    }

    fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        (self.v.numbers_mut(), self.y.numbers_mut())
    }

    fn start(&mut self, k: i64) {
        if let Some(s) = &mut self.system {
            St::start(s, self.clock.start, self.clock.at(k), &mut self.v, &self.y, &mut self.work);
        }
    }

    fn advance(&mut self, k: i64, n: i64) {
        if let Some(system) = &mut self.system {
            self.isa.run(Steps::<S, St> {
                clock: self.clock,
                k,
                n,
                system,
                v: &mut self.v,
                y: &mut self.y,
                work: &mut self.work,
                stepper: PhantomData,
            });
        }
    }

    fn finish(&mut self, k: i64) {
        if let Some(s) = &mut self.system {
            if self.recorded > 0 {
                s.foresee(&self.y);
            }
            St::finish(s, self.clock.start, self.clock.at(k), &mut self.v, &self.y, &mut self.work);
        }
    }

    // Lanes of one block share the time at which a system is asked for its rates, so only a lone member has a pace of its own.
    fn adapts(&self) -> bool {
        L == 1 && St::RECORD.error_order.is_some()
    }

    fn prepare_lane(&mut self, spec: &Spec, _lane: usize, member: usize) {
        self.prepare(spec, member, 1);
    }

    fn adapt(&mut self, paces: &mut [f64], budget: f64, attempts: u32) {
        if L == 1
            && St::RECORD.error_order.is_some()
            && let Ok(rows) = <&mut [[f64; 1]; NUMBERS]>::try_from(paces.as_chunks_mut().0)
            && let Some(system) = self.system.take()
        {
            let mut pace = Pace::load(rows, 0);
            let mut system = Stretched::new(system);
            let trial = self.trial.get_or_insert_with(|| Trial::new(St::RECORD.evaluations, &self.v, &self.y));
            self.isa.run(Attempts::<S, St> {
                pace: &mut pace,
                budget,
                attempts,
                system: &mut system,
                v: &mut self.v,
                y: &mut self.y,
                trial,
                stepper: PhantomData,
            });
            *rows = pace.numbers().map(|n| [n]);
            self.system = Some(system.system);
        }
    }

    fn recorded(&self) -> usize {
        self.recorded
    }

    fn record(&mut self, rows: &mut [f64]) {
        if let Some(s) = &mut self.system {
            s.foresee(&self.y);
            s.record(&self.v, &self.y, rows);
        }
    }

    fn tally(&self) -> &[f64] {
        self.system.as_ref().map_or(&[], |s| s.tally())
    }

    fn tally_mut(&mut self) -> &mut [f64] {
        self.system.as_mut().map_or(&mut [], |s| s.tally_mut())
    }
}

/// The system of the members from a first one on: one function for each system, not one for each method and CPU level.
#[inline(never)]
fn prepared<S: Large<L>, const L: usize>(spec: &Spec, clock: &Clock, first: usize, count: usize) -> S {
    S::prepare(spec, clock, |l| first + l.min(count - 1))
}

fn at_level<S: Large<L>, St: Stepper, const L: usize>(clock: &Clock, spec: &Spec) -> Box<dyn Group>
where
    Work<S>: Send + Sync,
{
    with_isa!(clock.level, |isa| RowGroup::<S, St, _, L>::boxed(isa, clock, spec))
}

/// A group of a system of any size: `Many` lanes for several members, `One` for a single one.
pub fn group<Many, One, St>(spec: &Spec, clock: &Clock, width: Width) -> Box<dyn Group>
where
    Many: Large<LANES>,
    One: Large<1>,
    St: Stepper,
    Work<Many>: Send + Sync,
    Work<One>: Send + Sync,
{
    match width {
        Width::Wide => at_level::<Many, St, LANES>(clock, spec),
        _ => at_level::<One, St, 1>(clock, spec),
    }
}

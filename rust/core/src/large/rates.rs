//! Rates of large systems, whatever computes them.

use crate::{
    model::{
        spec::{Signature, Spec},
        system::Shape,
        window::Window,
    },
    stage::{Force, Machine, Stop},
};

/// Properties of the rates on which a schedule relies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RateTraits {
    /// ẏ is v, so that h·ẏ is h·v and no rate of y is asked for.
    pub second_order: bool,
    /// v̇ depends on v.
    pub reads_v: bool,
    /// The rate of v comes times the step of an attempt, set by [`Rates::set_step`].
    pub stretched: bool,
}

/// The rates of some members, times the step for which they were made.
///
/// A block is a row for each of its numbers, each of a number for each lane. An output row may be longer, up to whole vectors of
/// eight: the numbers behind the block are padding.
pub trait Rates: Send + Sync {
    /// The wrapped rates, if this is a wrapper: they provide what it does not define.
    fn inner(&self) -> Option<&dyn Rates> {
        None
    }

    /// The wrapped rates, to change.
    fn inner_mut(&mut self) -> Option<&mut dyn Rates> {
        None
    }

    /// How many members there are.
    fn lanes(&self) -> usize {
        1
    }

    /// Properties of the rates.
    fn traits(&self) -> RateTraits;

    /// The step of the attempt that comes, for rates that depend on it.
    fn set_step(&mut self, step: f64) {
        if let Some(inner) = self.inner_mut() {
            inner.set_step(step);
        }
    }

    /// The window over which samples of inputs are averaged in what comes; at any other time they are looked up at that time.
    fn set_window(&mut self, window: Option<Window<f64>>) {
        if let Some(inner) = self.inner_mut() {
            inner.set_window(window);
        }
    }

    /// Takes the parameters of the members from `first`; lanes past the `count`-th repeat the last member.
    fn prepare(&mut self, spec: &Spec, first: usize, count: usize);

    /// Takes the force from outside for the members from `first`, of rows of a number for each of all members.
    fn set_force(&mut self, _rows: &Force, _first: usize, _count: usize) {}

    /// Sets the flag at which a rate that may take long stops early.
    fn set_stop_flag(&mut self, stop: &Stop) {
        if let Some(inner) = self.inner_mut() {
            inner.set_stop_flag(stop);
        }
    }

    /// h·v̇
    fn dv(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]);

    /// h·ẏ; not called for a second-order system.
    fn dy(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        if let Some(inner) = self.inner_mut() {
            inner.dy(t, v, y, out);
        }
    }

    /// Both rates of one state.
    fn both(&mut self, t: f64, v: &[f64], y: &[f64], [dv, dy]: [&mut [f64]; 2]) {
        self.dv(t, v, y, dv);
        self.dy(t, v, y, dy);
    }

    /// The velocity whose increment of y is `d`; not called for a second-order system.
    fn velocity(&mut self, d: &[f64], out: &mut [f64]) {
        if let Some(inner) = self.inner_mut() {
            inner.velocity(d, out);
        }
    }

    /// Takes the equations of an implicit step that starts at this state, and factors them.
    fn derive(&mut self, _t: f64, _h: f64, _v: &[f64], _y: &[f64]) {}

    /// Solves them, from right-hand sides of both blocks.
    fn solve(&mut self, _right: [&[f64]; 2]) {}

    /// The last solution, of both blocks.
    fn solution(&self) -> [&[f64]; 2] {
        [&[]; 2]
    }

    /// h times the derivatives of both rates by the time, at the state of the equations.
    fn by_time(&self) -> [&[f64]; 2] {
        [&[]; 2]
    }

    /// Projects the state after a step onto what should be constant.
    fn project(&mut self, v: &mut [f64], y: &mut [f64]) {
        if let Some(inner) = self.inner_mut() {
            inner.project(v, y);
        }
    }

    /// Computes and caches the forces at these coordinates, if the same pass gives the energy and the quantities that are needed
    /// next.
    fn cache_forces(&mut self, y: &[f64]) {
        if let Some(inner) = self.inner_mut() {
            inner.cache_forces(y);
        }
    }

    /// Fills rows with the recorded quantities of a state.
    fn record(&mut self, v: &[f64], y: &[f64], rows: &mut [f64]) {
        if let Some(inner) = self.inner_mut() {
            inner.record(v, y, rows);
        }
    }

    /// h·v̇ into `dv`, and h times the kinetic and h times the whole energy, of one member, if they are known.
    fn energies(&mut self, v: &[f64], y: &[f64], dv: &mut [f64]) -> Option<[f64; 2]> {
        self.inner_mut()?.energies(v, y, dv)
    }

    /// The gradient of the energy in both blocks and the square of its length, from h·v̇, if it is known.
    fn gradient(&mut self, v: &[f64], dv: &[f64], along: (&mut [f64], &mut [f64])) -> Option<f64> {
        self.inner_mut()?.gradient(v, dv, along)
    }

    /// The sums over the steps, such as the work of a control: a row of lanes, or nothing.
    fn tally(&self) -> &[f64] {
        self.inner().map_or(&[], |inner| inner.tally())
    }

    /// The sums of [`Rates::tally`], to write.
    fn tally_mut(&mut self) -> &mut [f64] {
        self.inner_mut().map_or(&mut [], |inner| inner.tally_mut())
    }
}

/// The request for which rates are made.
#[derive(Clone, Copy, Debug)]
pub struct RatesRequest<'a> {
    /// The system.
    pub signature: &'a Signature,
    /// How large its blocks are.
    pub shape: Shape,
    /// Quantities to record.
    pub record: &'a [String],
    /// The instruction set and threads of hot loops.
    pub machine: Machine,
    /// The step to which rates are scaled.
    pub h: f64,
    /// Whether the rates serve attempts at adaptive steps.
    pub attempts: bool,
}

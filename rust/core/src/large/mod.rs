//! Systems whose step is too long for a tape: many bodies, long chains, large matrices.
//!
//! A step of them would be a tape of hundreds of thousands of operations. So the program of the method ([`crate::program`]) is executed
//! over blocks that are long rows ([`course`], [`executor`]), and calls the rates of the system ([`Rates`]). There are two kinds of these:
//!
//! - [`tapes`]: the rates are tapes of their own, over rows of lanes, a lane for each of several members.
//! - kernels written by hand, for one member at a time, whose numbers lie side by side: [`bodies`], [`chain`], [`linear`],
//!   [`springs`]. A system names its own in its `KIND`.
//!
//! Neither knows of the methods, and no method knows of them.

pub mod adaptive;
pub mod bodies;
pub mod chain;
pub mod contact;
pub mod control;
pub mod course;
pub mod executor;
pub mod force;
pub mod group;
mod inputs;
pub mod linear;
pub mod matrix;
mod panels;
pub mod springs;
pub mod tapes;

use crate::{
    run::{Machine, stage::Force, workers::Stop},
    spec::{Given, Spec},
    system::Shape,
    window::Window,
};

/// The most operations of a step that is a single tape. Writing the code of one operation takes about a microsecond, and longer code would
/// not stay in the instruction cache.
pub const MAX_TAPE_OPERATIONS: usize = 4000;
/// Properties of the rates on which a course relies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Facts {
    /// ẏ is v, so that h·ẏ is h·v and no rate of y is asked for.
    pub second_order: bool,
    /// v̇ depends on v.
    pub reads_v: bool,
    /// The rate of v comes times the step of an attempt, which was told by [`Rates::set_step`].
    pub stretched: bool,
}

/// The rates of some members, times the step for which they were made.
///
/// A block is a row for each of its numbers, each of a number for each lane. An output row may be longer, up to whole vectors of eight:
/// the numbers behind the block are padding.
pub trait Rates: Send + Sync {
    /// How many members there are.
    fn lanes(&self) -> usize {
        1
    }

    /// What is known of the rates.
    fn facts(&self) -> Facts;

    /// The step of the attempt that comes, for rates that depend on it.
    fn set_step(&mut self, _step: f64) {}

    /// The window over which samples of inputs are averaged in what comes; at any other time they are looked up at that time.
    fn set_window(&mut self, _window: Option<Window<f64>>) {}

    /// Takes the parameters of the members from `first`; lanes past the `count`-th repeat the last member.
    fn prepare(&mut self, spec: &Spec, first: usize, count: usize);

    /// Takes the force from outside for the members from `first`, of rows of a number for each of all members.
    fn set_force(&mut self, _rows: &Force, _first: usize, _count: usize) {}

    /// Sets the flag at which a rate that may take long stops early.
    fn set_stop_flag(&mut self, _stop: &Stop) {}

    /// h·v̇
    fn dv(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]);

    /// h·ẏ; not called for a second-order system.
    fn dy(&mut self, _t: f64, _v: &[f64], _y: &[f64], _out: &mut [f64]) {}

    /// Both of one state.
    fn both(&mut self, t: f64, v: &[f64], y: &[f64], [dv, dy]: [&mut [f64]; 2]) {
        self.dv(t, v, y, dv);
        self.dy(t, v, y, dy);
    }

    /// The velocity whose increment of y is `d`; not called for a second-order system.
    fn velocity(&mut self, _d: &[f64], _out: &mut [f64]) {}

    /// Projects the state after a step onto what should be constant.
    fn project(&mut self, _v: &mut [f64], _y: &mut [f64]) {}

    /// Computes and caches the forces at these coordinates, if the same pass gives the energy and the quantities that are needed next.
    fn cache_forces(&mut self, _y: &[f64]) {}

    /// Fills rows with the recorded quantities of a state.
    fn record(&mut self, _v: &[f64], _y: &[f64], _rows: &mut [f64]) {}

    /// h·v̇ into `dv`, and h times the kinetic and h times the whole energy, of one member, if they are known.
    fn energies(&mut self, _v: &[f64], _y: &[f64], _dv: &mut [f64]) -> Option<[f64; 2]> {
        None
    }

    /// The gradient of the energy in both blocks and the square of its length, from h·v̇, if it is known.
    fn gradient(&mut self, _v: &[f64], _dv: &[f64], _along: (&mut [f64], &mut [f64])) -> Option<f64> {
        None
    }

    /// The sums over the steps, such as the work of a control: a row of lanes, or nothing.
    fn tally(&self) -> &[f64] {
        &[]
    }

    /// The same sums, to write.
    fn tally_mut(&mut self) -> &mut [f64] {
        &mut []
    }
}

/// The request for which rates are made.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// The system.
    pub given: &'a Given,
    /// How large its blocks are.
    pub shape: Shape,
    /// Quantities to record.
    pub record: &'a [String],
    /// What hot loops may use.
    pub machine: Machine,
    /// The step to which rates are scaled.
    pub h: f64,
    /// Whether they are asked for by attempts at adaptive steps.
    pub attempts: bool,
}

/// Rates of one member by a kernel that is written by hand.
#[derive(Clone, Copy)]
pub struct Long {
    /// Operations of the rates, or of a step, from which on it is faster than machine code for one number at a time.
    pub from: (usize, usize),
    /// Operations of the rates from which on it is as fast as tapes for several members side by side.
    pub from_batch: usize,
    /// Makes them, without control.
    pub make: fn(&Asked) -> Box<dyn Rates>,
}

/// Rates of one member by the kernel of the system, with the springs of surfaces, under the control and the force that are given.
pub fn single(long: Long, asked: &Asked) -> Box<dyn Rates> {
    force::wrap(control::wrap(contact::wrap((long.make)(asked), asked), asked), asked)
}

//! Steppers: what users call methods.

use crate::{
    block::{Block, Work},
    system::System,
};

/// Everything there is to say about a method. Python attributes, `__doc__`, the tables of the docs, the command line, tests,
/// charts and benches all read it.
#[derive(Debug)]
pub struct Record {
    /// The name users type.
    pub name: &'static str,
    /// The document's name, as a title.
    pub title: &'static str,
    /// Standard names of the same method.
    pub other_names: &'static [&'static str],
    /// Methods that it is easily taken for.
    pub false_friends: &'static [&'static str],
    /// Order of convergence of both blocks.
    pub order: u32,
    /// Rate evaluations per step; one is one of each block.
    pub evaluations: u32,
    /// What kind of method it is.
    pub family: &'static str,
    /// The undamped oscillator is stable for Φ = ω₀T below this; 0 means never.
    pub limit: f64,
    /// Times within a step at which the rates are asked for, as fractions of the step, ascending.
    pub nodes: &'static [f64],
    /// What it asks of a system.
    pub needs: Needs,
    /// What its `v` slot holds between steps if not `v`.
    pub carry: Option<&'static str>,
    /// Ways to start it, the default first; empty if there is nothing to choose.
    pub starts: &'static [&'static str],
    /// Order of h in which the error of a step is estimated, if the method can: the step can then be chosen to a tolerance.
    pub error_order: Option<u32>,
    /// Section of the document.
    pub section: &'static str,
    /// Where it comes from.
    pub reference: &'static str,
    /// What it does, in a few sentences.
    pub about: &'static str,
}

/// What a method asks of a system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing beyond the two increments.
    Rates,
    /// A second-order system, ÿ = a(t, y), whose forces do not depend on the velocity.
    Acceleration,
}

/// A method: how one step is made of increments and sums.
///
/// `step` is generic over the system and its blocks, and is the only place where the method is written in Rust.
pub trait Stepper: 'static {
    /// What there is to say about it.
    const RECORD: Record;

    /// One step of length `h` from time `t`, in place.
    fn step<S: System>(s: &mut S, t: f64, h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>);

    /// The estimate of the last step's error, from the increments that it left in `w`, into `w.v` and `w.y`.
    #[inline(always)]
    fn error<S: System>(w: &mut Work<S>) {
        w.v.numbers_mut().fill(f64::NAN);
    }

    /// Whether a second estimate, of lower order, corrects the first, so that both together behave as one of the method's order.
    const CORRECTED: bool = false;

    /// The second estimate, as `error`.
    #[inline(always)]
    fn coarse_error<S: System>(_w: &mut Work<S>) {}

    /// Turns the velocity in the `v` slot into what the method carries there. `choice` counts [`Record::starts`].
    #[inline(always)]
    fn start<S: System>(_s: &mut S, _choice: usize, _t: f64, _v: &mut S::V, _y: &S::Y, _w: &mut Work<S>) {}

    /// Turns what the method carries in the `v` slot back into the velocity at `t`: the inverse of `start`.
    #[inline(always)]
    fn finish<S: System>(_s: &mut S, _choice: usize, _t: f64, _v: &mut S::V, _y: &S::Y, _w: &mut Work<S>) {}
}

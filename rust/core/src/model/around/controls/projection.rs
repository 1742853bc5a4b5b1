//! Projection onto the target energy after a step: `scaling` multiplies all velocities by one factor; `nacozy` (Nacozy 1971) is
//! the least change of the state, which is along the gradient of the energy.

use std::cell::Cell;

use super::energy::factor;
use crate::{
    model::{
        spec::Parameters,
        system::{Block, System},
    },
    tape::number::Number,
};

/// A system whose states are projected onto the target energy.
pub(crate) struct Projected<N: Number> {
    system: Box<dyn System<N>>,
    h: N,
    nacozy: bool,
    /// h times the target energy.
    target: N,
    work: Cell<N>,
}

/// The factor of all velocities, and h times the energy that it adds, from h times the error of the energy and h times the
/// kinetic energy, both below zero where h is. At rest the factor is 1.
pub(crate) fn scaling<N: Number>(off: N, kinetic: N) -> (N, N) {
    let one = N::of(1.0);
    let factor = N::choose(kinetic.equals(N::of(0.0)), one, factor(one - off / kinetic));
    (factor, (factor * factor - one) * kinetic)
}

/// The length of the step along the gradient of the energy, in gradients, and h times the energy that it removes; `square` is the
/// square of the gradient. Where the gradient is zero, both are zero.
pub(crate) fn nacozy<N: Number>(off: N, h: N, square: N) -> (N, N) {
    let zero = N::of(0.0);
    let flat = square.at_most(zero);
    (N::choose(flat, zero, (off / h) / square), N::choose(flat, zero, off))
}

impl<N: Number> Projected<N> {
    /// A system with the projection of these parameters.
    pub(crate) fn new(p: &Parameters<N>, system: Box<dyn System<N>>, tally: N) -> Self {
        let (nacozy, target) = (p.signature.word("control.way") == "nacozy", p.h * p.number("control.target"));
        Projected { system, h: p.h, nacozy, target, work: Cell::new(tally) }
    }

    /// The projected state; `None` if the system has no energy.
    fn back(&self, v: &Block<N>, y: &Block<N>) -> Option<(Block<N>, Block<N>)> {
        let energies = self.system.energies(v, y)?;
        let off = energies.whole - self.target;
        if self.nacozy {
            let along = self.system.gradient(v, y, &energies)?;
            let (step, taken) = nacozy(off, self.h, along.square);
            self.work.set(self.work.get() - taken);
            return Some((v.zip_map(&along.v, |v, along| v - step * along), y.zip_map(&along.y, |y, along| y - step * along)));
        }
        let (factor, gained) = scaling(off, energies.kinetic);
        self.work.set(self.work.get() + gained);
        Some((v * factor, y.clone()))
    }
}

impl<N: Number> System<N> for Projected<N> {
    fn inner(&self) -> Option<&dyn System<N>> {
        Some(self.system.as_ref())
    }

    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.system.dv(t, v, y)
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.system.dy(t, v, y)
    }

    fn project(&self, v: Block<N>, y: Block<N>) -> (Block<N>, Block<N>) {
        let back = self.back(&v, &y);
        back.unwrap_or((v, y))
    }

    fn tally(&self) -> Option<N> {
        Some(self.work.get())
    }

    fn set_tally(&self, tally: N) {
        self.work.set(tally);
    }
}

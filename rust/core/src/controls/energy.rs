//! A push −g·v in every stage.
//!
//! As printed, g = h·C·ΔE. It overflows where C·h·K passes 1, so the limited form takes the decay of ΔE by backward Euler: the
//! velocities are scaled by the root of 1 − 2hC·ΔE/(1 + 2hC·K), held in ¼ … 4.

use std::cell::Cell;

use super::factor;
use crate::{
    number::Number,
    spec::Parameters,
    system::{Block, Energies, Gradient, System},
};

/// A system whose velocities are pushed.
pub struct Controlled<N: Number> {
    system: Box<dyn System<N>>,
    limited: bool,
    /// Whether the push comes after each step instead of in its stages.
    between: bool,
    gain: N,
    /// h times the energy to keep.
    target: N,
    work: Cell<N>,
}

/// g, the fraction by which velocities are reduced, and the energy that this removes, (1 − (1 − g)²)·K; from h times the error of the
/// energy and h times the kinetic energy.
pub fn push<N: Number>(limited: bool, gain: N, off: N, kinetic: N) -> (N, N) {
    let g = if limited {
        let (one, twice) = (N::of(1.0), N::of(2.0) * gain);
        one - factor(one - (twice * off) / (one + twice * kinetic))
    } else {
        gain * off
    };
    (g, (g * (N::of(2.0) - g)) * kinetic)
}

impl<N: Number> Controlled<N> {
    /// A system under the control that is given.
    pub fn new(p: &Parameters<N>, system: Box<dyn System<N>>, tally: N) -> Self {
        let limited = p.given.word("control.form") == "limited";
        let (gain, target) = (p.number("control.gain"), p.h * p.number("control.target"));
        Controlled { system, limited, between: super::is_between(p.given), gain, target, work: Cell::new(tally) }
    }

    /// The push for a state, noted in the tally.
    fn push(&self, energies: &Energies<N>) -> N {
        let (g, taken) = push(self.limited, self.gain, energies.whole - self.target, energies.kinetic);
        self.work.set(self.work.get() - taken);
        g
    }
}

impl<N: Number> System<N> for Controlled<N> {
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        if self.between {
            return self.system.dv(t, v, y);
        }
        let Some(energies) = self.system.energies(v, y) else { return self.system.dv(t, v, y) };
        let g = self.push(&energies);
        energies.dv.zip_map(v, |dv, v| dv - g * v)
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.system.dy(t, v, y)
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        self.system.velocity(d)
    }

    fn energies(&self, v: &Block<N>, y: &Block<N>) -> Option<Energies<N>> {
        self.system.energies(v, y)
    }

    fn gradient(&self, v: &Block<N>, y: &Block<N>, energies: &Energies<N>) -> Option<Gradient<N>> {
        self.system.gradient(v, y, energies)
    }

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        self.system.record(quantity, v, y)
    }

    fn project(&self, v: Block<N>, y: Block<N>) -> (Block<N>, Block<N>) {
        if !self.between {
            return (v, y);
        }
        let Some(energies) = self.system.energies(&v, &y) else { return (v, y) };
        let g = self.push(&energies);
        (v.map(|v| v - g * v), y)
    }

    fn tally(&self) -> Option<N> {
        Some(self.work.get())
    }
}

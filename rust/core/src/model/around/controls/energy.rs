//! A push −g·v in every stage.
//!
//! As printed, g = h·C·ΔE. It overflows where C·h·K passes 1, so the limited form takes the decay of ΔE by backward Euler: the
//! velocities are scaled by the root of 1 − 2hC·ΔE/(1 + 2hC·K), held in ¼ … 4.

use std::cell::Cell;

use crate::{
    model::{
        spec::{Parameters, Signature},
        system::{Block, Energies, System},
    },
    tape::number::Number,
};

/// A system whose velocities are pushed.
pub(crate) struct Controlled<N: Number> {
    system: Box<dyn System<N>>,
    limited: bool,
    /// Whether the push comes after each step instead of in its stages.
    between: bool,
    gain: N,
    /// h times the energy to keep.
    target: N,
    work: Cell<N>,
}

/// Whether its push comes between steps: for methods in whose stages v and y belong to different times.
pub(super) fn is_between(signature: &Signature) -> bool {
    signature.word("control.when") == "between"
}

/// √x with x clamped between ¼ and 4: a factor of velocities between ½ and 2.
pub(super) fn factor<N: Number>(square: N) -> N {
    square.clamped(0.25, 4.0).sqrt()
}

/// g, the fraction by which velocities are reduced, and the energy that this removes, (1 − (1 − g)²)·K; from h times the error of
/// the energy and h times the kinetic energy.
pub(crate) fn push<N: Number>(limited: bool, gain: N, off: N, kinetic: N) -> (N, N) {
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
    pub(crate) fn new(p: &Parameters<N>, system: Box<dyn System<N>>, tally: N) -> Self {
        let limited = p.signature.word("control.form") == "limited";
        let (gain, target) = (p.number("control.gain"), p.h * p.number("control.target"));
        Controlled { system, limited, between: is_between(p.signature), gain, target, work: Cell::new(tally) }
    }

    /// The push for a state, noted in the tally.
    fn push(&self, energies: &Energies<N>) -> N {
        let (g, taken) = push(self.limited, self.gain, energies.whole - self.target, energies.kinetic);
        self.work.set(self.work.get() - taken);
        g
    }
}

impl<N: Number> System<N> for Controlled<N> {
    fn inner(&self) -> Option<&dyn System<N>> {
        Some(self.system.as_ref())
    }

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

    fn set_tally(&self, tally: N) {
        self.work.set(tally);
    }
}

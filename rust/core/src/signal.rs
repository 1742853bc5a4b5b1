//! Inputs: what drives a system from outside, as a function of time.

use crate::{tile::View, trig};

/// An input of one member.
pub trait Signal {
    /// Its value at time `t`.
    fn at(&self, t: f64) -> f64;
}

/// amplitude · sin(omega·t + phase)
#[derive(Clone, Copy, Debug)]
pub struct Sine {
    /// In the unit of the input.
    pub amplitude: f64,
    /// In radians per unit of time.
    pub omega: f64,
    /// In radians.
    pub phase: f64,
}

impl Signal for Sine {
    #[inline(always)]
    fn at(&self, t: f64) -> f64 {
        self.amplitude * trig::sin(self.omega * t + self.phase)
    }
}

/// A sampled input, held between samples. A constant is one sample.
#[derive(Clone, Copy, Debug)]
pub struct Held<'a, const L: usize> {
    /// The samples of all lanes.
    pub samples: View<'a, L>,
    /// Which lane.
    pub lane: usize,
}

impl<const L: usize> Signal for Held<'_, L> {
    #[inline(always)]
    fn at(&self, t: f64) -> f64 {
        self.samples.at(t)[self.lane]
    }
}

/// The sum of two inputs.
#[derive(Clone, Copy, Debug)]
pub struct Both<A, B>(pub A, pub B);

impl<A: Signal, B: Signal> Signal for Both<A, B> {
    #[inline(always)]
    fn at(&self, t: f64) -> f64 {
        self.0.at(t) + self.1.at(t)
    }
}

//! Inputs: what drives a system from outside, as a function of time.

use crate::{tile::Samples, trig};

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
pub struct Held<'a> {
    /// The samples of all lanes.
    pub samples: &'a Samples,
    /// Which lane.
    pub lane: usize,
}

impl Signal for Held<'_> {
    #[inline(always)]
    fn at(&self, t: f64) -> f64 {
        let row = self.samples.at(t);
        if self.lane < row.len() { row[self.lane] } else { f64::NAN }
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

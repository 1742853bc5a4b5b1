//! Inputs: what drives a system from outside, as a function of time.

use crate::{
    group::Spec,
    tile::{Samples, View},
    trig,
};

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

/// amplitude · sin(omega·t + phase), frequency and phase those of all lanes.
#[derive(Clone, Copy, Debug)]
pub struct Beat<'a, const L: usize> {
    /// In the unit of the input.
    pub amplitude: f64,
    /// The sine.
    pub sine: View<'a, L>,
}

impl<const L: usize> Signal for Beat<'_, L> {
    #[inline(always)]
    fn at(&self, t: f64) -> f64 {
        self.amplitude * self.sine.beat(t)
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

/// An input of the members of a group of any size, chosen at run time.
pub enum Input<const L: usize> {
    /// A sinusoid.
    Sine([Sine; L]),
    /// Samples.
    Held(Samples<L>),
}

impl<const L: usize> Input<L> {
    /// The inputs that the options name, `sine` or `held` each and in order; what else is among the options is left out.
    /// Their parameters are amplitude, frequency and phase of each sinusoid, from number `first` on.
    pub fn all(spec: &Spec, first: usize, member: impl Fn(usize) -> usize) -> Vec<Self> {
        let (mut next, mut tables) = (first, spec.tables.iter());
        let mut inputs = Vec::new();
        for option in &spec.options {
            match *option {
                "sine" => {
                    let p = |i: usize, l: usize| spec.at(next + i, member(l));
                    let sine = |l| Sine { amplitude: p(0, l), omega: p(1, l), phase: p(2, l) };
                    inputs.push(Input::Sine(std::array::from_fn(sine)));
                    next += 3;
                }
                "held" => inputs.extend(tables.next().map(|table| Input::Held(Samples::new(table, |_| 1.0, &member)))),
                _ => {}
            }
        }
        inputs
    }

    /// Its values at time `t`.
    #[inline(always)]
    fn fill(&self, t: f64, row: &mut [f64; L]) {
        match self {
            Input::Sine(sines) => {
                for l in 0..L {
                    row[l] = sines[l].at(t);
                }
            }
            Input::Held(samples) => *row = *samples.view().at(t),
        }
    }

    /// The values of inputs at time `t`, a row for each.
    #[inline(always)]
    pub fn fill_all(inputs: &[Self], t: f64, rows: &mut [[f64; L]]) {
        for (input, row) in inputs.iter().zip(rows) {
            input.fill(t, row);
        }
    }
}

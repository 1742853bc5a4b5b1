//! Inputs: functions of time that drive a system.

use crate::{functions::sin, tape::number::Number};

/// An input of one member.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Signal<N: Number> {
    /// A constant.
    Constant(N),
    /// amplitude · sin(omega·t + phase)
    Sine {
        /// In the unit of the input.
        amplitude: N,
        /// In radians per unit of time.
        omega: N,
        /// In radians.
        phase: N,
    },
    /// Samples, each held until the next.
    Held {
        /// Which table.
        table: u32,
        /// Its value at a time.
        sample: fn(u32, N) -> N,
        /// The factor of its samples, if there is one.
        factor: Option<N>,
    },
    /// A polynomial between each two samples, of the time since the first of them.
    Curve {
        /// The table of its constant terms; those of higher powers follow, and then one of the times at which pieces begin.
        table: u32,
        /// Its degree.
        degree: u32,
        /// The value of a table at a time.
        sample: fn(u32, N) -> N,
        /// The factor of its samples, if there is one.
        factor: Option<N>,
    },
}

impl<N: Number> Signal<N> {
    /// Its value at time `t`.
    pub(crate) fn at(&self, t: N) -> N {
        match *self {
            Signal::Constant(value) => value,
            Signal::Sine { amplitude, omega, phase } => amplitude * sin(omega * t + phase),
            Signal::Held { table, sample, factor } => {
                let value = sample(table, t);
                factor.map_or(value, |factor| factor * value)
            }
            Signal::Curve { table, degree, sample, factor } => {
                let value = curve(table, degree, t, |table| sample(table, t));
                factor.map_or(value, |factor| factor * value)
            }
        }
    }

    /// The input, times a factor.
    #[must_use]
    pub(crate) fn scaled(&self, factor: N) -> Self {
        match *self {
            Signal::Constant(value) => Signal::Constant(factor * value),
            Signal::Sine { amplitude, omega, phase } => Signal::Sine { amplitude: factor * amplitude, omega, phase },
            Signal::Held { table, sample, .. } => Signal::Held { table, sample, factor: Some(factor) },
            Signal::Curve { table, degree, sample, .. } => Signal::Curve { table, degree, sample, factor: Some(factor) },
        }
    }
}

/// The value of a curve at a time, from its tables there.
pub(crate) fn curve<N: Number>(table: u32, degree: u32, t: N, at: impl Fn(u32) -> N) -> N {
    let since = t - at(table + degree + 1);
    (0..degree).rev().fold(at(table + degree), |value, k| value * since + at(table + k))
}

//! Inputs of one member, by number.

use crate::{
    signal::Signal,
    spec::{Parameters, Spec},
    tape::split::HOLD_SLACK,
};

/// A sampled input of one member.
struct Samples {
    values: Vec<f64>,
    start: f64,
    interval: f64,
}

impl Samples {
    /// The sample that holds at a time: the last one not after it, or the first or last one outside; the first if the time is a NaN.
    fn at(&self, t: f64) -> f64 {
        let at = ((t - self.start) / self.interval + HOLD_SLACK).floor();
        let last = self.values.len() - 1;
        self.values[if at > 0.0 { last.min(at as usize) } else { 0 }]
    }
}

/// The inputs of one member.
#[derive(Default)]
pub struct Inputs {
    signals: Vec<Signal<f64>>,
    samples: Vec<Samples>,
}

impl Inputs {
    /// Those of a member: `inputs[0]` and so on.
    pub fn new(spec: &Spec, member: usize) -> Inputs {
        let given = &spec.given;
        let numbers = spec.rows.iter().map(|row| row.at(member)).collect();
        // `fill` looks samples up in the tables, which `Parameters` does not have here.
        let p = Parameters { given, h: 1.0, numbers, sample: |_, _| f64::NAN };
        let signal = |i: usize| p.signal(&format!("inputs[{i}]")).unwrap_or(Signal::Constant(f64::NAN));
        let samples = spec.tables.iter().map(|table| Samples {
            values: table.samples.iter().map(|row| row.at(member)).collect(),
            start: table.start,
            interval: table.interval,
        });
        Inputs { signals: (0..given.whole("inputs")).map(signal).collect(), samples: samples.collect() }
    }

    /// Their values at a time.
    pub fn fill(&self, t: f64, values: &mut [f64]) {
        for (value, signal) in values.iter_mut().zip(&self.signals) {
            *value = match signal {
                Signal::Held { table, .. } => self.samples[*table as usize].at(t),
                signal => signal.at(t),
            };
        }
    }
}

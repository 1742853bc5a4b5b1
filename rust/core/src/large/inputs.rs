//! Inputs of one member, by number.

use crate::model::{
    signal::{Signal, curve},
    spec::{Parameters, Spec, holds_at},
    window::{Window, is_held, mean},
};

/// A sampled input of one member.
struct Samples {
    values: Vec<f64>,
    start: f64,
    interval: f64,
}

impl Samples {
    /// The sample that holds at a time.
    fn at(&self, t: f64) -> f64 {
        self.values[holds_at(t, self.start, self.interval, self.values.len())]
    }
}

/// The inputs of one member.
#[derive(Default)]
pub(crate) struct Inputs {
    signals: Vec<Signal<f64>>,
    samples: Vec<Samples>,
    /// For each table, whether a step averages its samples.
    held: Vec<bool>,
}

impl Inputs {
    /// The inputs of a member: `inputs[0]` and so on.
    pub(crate) fn new(spec: &Spec, member: usize) -> Inputs {
        let signature = &spec.signature;
        let numbers = spec.rows.iter().map(|row| row.at(member)).collect();
        // `fill` looks samples up in the tables, which `Parameters` does not have here.
        let p = Parameters { signature, h: 1.0, numbers, sample: |_, _| f64::NAN };
        let signal = |i: usize| p.signal(&format!("inputs[{i}]")).unwrap_or(Signal::Constant(f64::NAN));
        let samples = spec.tables.iter().map(|table| Samples {
            values: table.samples.iter().map(|row| row.at(member)).collect(),
            start: table.start,
            interval: table.interval,
        });
        let held = (0..signature.tables.len()).map(|table| is_held(signature, table)).collect();
        Inputs { signals: (0..signature.whole("inputs")).map(signal).collect(), samples: samples.collect(), held }
    }

    /// Fills in the inputs at a time, or as steps over a window average them.
    pub(crate) fn fill(&self, t: f64, window: Option<Window<f64>>, values: &mut [f64]) {
        let at = |table: u32, t: f64| self.samples[table as usize].at(t);
        for (value, signal) in values.iter_mut().zip(&self.signals) {
            *value = match (*signal, window) {
                (Signal::Held { table, .. }, Some(window @ [from, to, _])) if self.held[table as usize] => {
                    mean(window, at(table + 1, to), at(table, from), at(table, to))
                }
                (Signal::Held { table, .. }, _) => at(table, t),
                (Signal::Curve { table, degree, .. }, _) => curve(table, degree, t, |table| at(table, t)),
                (signal, _) => signal.at(t),
            };
        }
    }
}

//! The cut tapes of a step and of what is around it, for machines that the core does not write code for.

use super::Model;
use crate::{
    error::Error,
    step::tapes::{Tapes, Traced},
    tape::{
        real::{Precision, Real},
        split::Split,
    },
};

/// All parts of a run.
pub struct Stages {
    /// Numbers per member: of v and y, kept by the method (a controller's memory among them), of this memory, summed up over the
    /// steps, and recorded.
    pub sizes: [(&'static str, usize); 6],
    /// Whether the method has a carry instead of v between steps.
    pub carries: bool,
    /// Whether attempts are those of a series.
    pub is_series: bool,
    /// Each by its name: "step", and, where there is one, "start", "finish", "record", "begin", "judged", "by terms" and
    /// "extension".
    pub splits: Vec<(&'static str, Split)>,
    /// Of attempts of float32, where their rows stand: numbers of the state, sampled inputs, results of the first part, and
    /// numbers of the second before these.
    pub tried: Option<[usize; 4]>,
}

impl Model<'_> {
    /// The stages of a run, each as one tape, however long; with the continuous extension of attempts where it `extends`.
    pub fn stages(&self, extends: bool) -> Result<Stages, Error> {
        let traced = self.traced()?;
        let mut made = match self.key.precision {
            Precision::Double => stages(&traced, &*traced.tapes_of::<f64>()?),
            Precision::Single => stages(&traced, &*traced.tapes_of::<f32>()?),
        };
        if extends {
            made.splits.push(("extension", traced.extension()?.split.clone()));
        }
        Ok(made)
    }
}

fn stages<T: Real>(traced: &Traced, tapes: &Tapes<T>) -> Stages {
    let mut splits = vec![("step", tapes.step.split.clone())];
    let others = [("start", &tapes.start), ("finish", &tapes.finish), ("record", &tapes.record), ("by terms", &tapes.by_terms)];
    splits.extend(others.into_iter().filter_map(|(name, stage)| Some((name, stage.as_ref()?.split.clone()))));
    splits.extend(tapes.begin.as_ref().map(|stage| ("begin", stage.split.clone())));
    splits.extend(tapes.judged.as_ref().map(|(stage, _)| ("judged", stage.split.clone())));
    Stages {
        sizes: [
            ("v", traced.shape.v),
            ("y", traced.shape.y),
            ("kept", traced.kept),
            ("memory", traced.memory),
            ("tally", traced.tally),
            ("recorded", traced.recorded),
        ],
        carries: traced.carries,
        is_series: tapes.is_series,
        splits,
        tried: tapes.judged.as_ref().map(|(_, rows)| [rows.state, rows.tables, rows.results, rows.judged]),
    }
}

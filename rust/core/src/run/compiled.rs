//! What a step becomes on this machine, and how long that takes: for benches, tests and explanations.

use std::time::{Duration, Instant};

use super::{Machine, Model, Way};
use crate::{
    error::Error,
    tape::{Counts, split::Body},
};

/// A step that is one tape, and its kernel.
#[derive(Clone, Copy, Debug)]
pub struct Compiled {
    /// Operations as the document writes them.
    pub written: Counts,
    /// Operations that every member makes in every step.
    pub computed: Counts,
    /// Operations that are made once a run, once for each member, and once for each step.
    pub before: [usize; 3],
    /// How many members the kernel steps together.
    pub lanes: usize,
    /// How long its machine code is; zero where it is interpreted.
    pub bytes: usize,
    /// How many values it keeps beside at most, because registers do not suffice.
    pub spills: usize,
    /// How long tracing took, with cutting, and everything that is run once in a while.
    pub trace: Duration,
    /// How long writing the code took, with choosing its shape, and preparing what is interpreted before it.
    pub compile: Duration,
}

fn counts(body: &Body) -> Counts {
    let mut counts = Counts::default();
    body.ops.iter().for_each(|op| counts.note(*op));
    counts
}

impl Model<'_> {
    /// Traces and compiles the step anew, for so many members; none if it is too long for one tape.
    pub fn compiled(&self, machine: Machine, members: usize) -> Result<Option<Compiled>, Error> {
        let traced = self.traced()?;
        if !matches!(self.way(&traced, machine, members, f64::INFINITY), Way::Tape) {
            return Ok(None);
        }
        let began = Instant::now();
        let tapes = self.scene.trace()?;
        let trace = began.elapsed();
        let split = &tapes.step.split;
        let began = Instant::now();
        let kit = tapes.step.kit(machine.level, members);
        let runner = &kit.runner;
        let (bytes, spills) = runner.write().map_or((0, 0), |kernel| (kernel.bytes(), kernel.spills()));
        let compile = began.elapsed();
        Ok(Some(Compiled {
            written: tapes.written,
            computed: counts(&split.body),
            before: [&split.run, &split.member, &split.step].map(Body::work),
            lanes: runner.lanes(),
            bytes,
            spills,
            trace,
            compile,
        }))
    }
}

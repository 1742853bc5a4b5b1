//! The machine code of a step and the time to make it: for benches, tests and explanations.

use std::time::{Duration, Instant};

use super::{MIN_SOLUTIONS, Model, StepStrategy};
use crate::{
    error::Error,
    kernel::{
        Layout,
        pack::{self, Verdict},
        writer,
    },
    stage::Machine,
    step::tapes::{Tapes, Traced},
    tape::{
        Counts,
        real::{Precision, Real},
        split::{Body, Split},
    },
};

/// A step that is one tape, and its kernel.
#[derive(Clone, Debug)]
pub struct Compiled {
    /// Operations before equal ones were merged, but for those that a method does to blocks.
    pub written: Counts,
    /// Operations that every member makes in every step.
    pub computed: Counts,
    /// Operations that are made once a run, once for each member, and once for each step.
    pub before: [usize; 3],
    /// The operations themselves.
    pub split: Split,
    /// How the machine code goes through a tile, or why there is none.
    pub layout: Result<Layout, Interpreted>,
    /// How many members the kernel steps together.
    pub lanes: usize,
    /// How long its machine code is; zero where it is interpreted.
    pub bytes: usize,
    /// The most values that are spilled at once because there are not enough registers.
    pub spills: usize,
    /// Whether equal operations of a single member are lanes of one vector, and the model's verdict; none where not considered.
    pub packing: Option<(bool, Verdict)>,
    /// How long tracing took, with cutting, and everything that is run once in a while.
    pub trace: Duration,
    /// How long writing the code took, with choosing its shape, and preparing what is interpreted before it.
    pub compile: Duration,
}

/// The reason why a step is interpreted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpreted {
    /// At this level no machine code is written: this CPU has no writer, or the interpreter was requested.
    Level,
    /// The system does not let pages be executed.
    Pages,
    /// The writer has no code for this step.
    Writer,
}

impl Interpreted {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Interpreted::Level => "level",
            Interpreted::Pages => "pages",
            Interpreted::Writer => "writer",
        }
    }
}

/// Steps of the run whose step is explained: very many, unless these would be one tape for the equations of a large system,
/// whose listing has some ten thousand lines.
fn explained_steps(traced: &Traced) -> f64 {
    if traced.solves_rows { MIN_SOLUTIONS - 1.0 } else { f64::INFINITY }
}

fn counts(body: &Body) -> Counts {
    let mut counts = Counts::default();
    body.ops.iter().for_each(|op| counts.note(*op));
    counts
}

impl Model<'_> {
    /// Traces and compiles the step anew, for `members` members; none if it is too long for one tape.
    pub fn compiled(&self, machine: Machine, members: usize) -> Result<Option<Compiled>, Error> {
        let traced = self.traced()?;
        if !matches!(self.way(&traced, machine, members, explained_steps(&traced)), StepStrategy::Tape) {
            return Ok(None);
        }
        match self.key.precision {
            Precision::Double => self.compiled_for::<f64>(machine, members),
            Precision::Single => self.compiled_for::<f32>(machine, members),
        }
    }

    fn compiled_for<T: Real>(&self, machine: Machine, members: usize) -> Result<Option<Compiled>, Error> {
        let began = Instant::now();
        let tapes: Tapes<T> = self.key.trace()?;
        let trace = began.elapsed();
        let split = &tapes.step.split;
        let began = Instant::now();
        let compiled = tapes.step.compiled(machine.level, members);
        let runner = &compiled.runner;
        let written = runner.write();
        let (bytes, spills) = written.map_or((0, 0), |kernel| (kernel.bytes(), kernel.spills()));
        let layout = match (runner.layout(), written) {
            (None, _) => Err(Interpreted::Level),
            (Some(layout), Some(_)) => Ok(layout),
            (Some(_), None) if !writer::allowed() => Err(Interpreted::Pages),
            (Some(_), None) => Err(Interpreted::Writer),
        };
        let compile = began.elapsed();
        let is_packed = written.is_some_and(|kernel| kernel.packing().is_some());
        let packing =
            written.filter(|_| runner.packs()).and_then(|_| pack::best(runner.body())).map(|(verdict, _)| (is_packed, verdict));
        Ok(Some(Compiled {
            written: tapes.written,
            computed: counts(&split.body),
            before: [split.run.work(), split.member.work(), split.step.work() + split.clock.work()],
            split: split.clone(),
            layout,
            lanes: runner.lanes(),
            bytes,
            spills,
            packing,
            trace,
            compile,
        }))
    }

    /// How a step that is too long for one tape is computed, its approximate number of operations, and how many members are
    /// stepped together: by tapes of the rates ("rates"), by a hand-written kernel for one member ("hand"), or by one for
    /// products of matrices ("matrix"). None if it is one tape. `paced`: for adaptive steps.
    pub fn in_parts(&self, machine: Machine, members: usize, paced: bool) -> Result<Option<(&'static str, usize, usize)>, Error> {
        let traced = self.traced()?;
        let steps = if paced { 0.0 } else { explained_steps(&traced) };
        let mut way = self.way(&traced, machine, members, steps);
        if paced && !matches!(way, StepStrategy::Tape | StepStrategy::Matrix) {
            way = match (way, self.way(&traced, machine, 1, steps)) {
                (StepStrategy::HandWrittenRates(long), _) | (_, StepStrategy::HandWrittenRates(long)) => {
                    StepStrategy::HandWrittenRates(long)
                }
                _ => StepStrategy::Rates(1),
            };
        }
        Ok(match way {
            StepStrategy::Tape => None,
            StepStrategy::Matrix if paced => None,
            StepStrategy::Rates(lanes) => Some(("rates", traced.operations.1, lanes)),
            StepStrategy::HandWrittenRates(_) => Some(("hand", traced.operations.1, 1)),
            StepStrategy::Matrix => Some(("matrix", traced.operations.1, 1)),
        })
    }
}

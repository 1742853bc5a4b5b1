//! A body and what makes its steps: interpreted at first, written as machine code when that pays.

use std::sync::{
    OnceLock,
    atomic::{AtomicU64, Ordering::Relaxed},
};

use super::{
    Kernel,
    interpret::Interpreter,
    writer::{self, Shape},
};
use crate::{isa::Level, tape::split::Body};

/// How many members to expect: a wide tile has the throughput, a narrow one the latency.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Width {
    /// As many lanes as keep the machine busy.
    Wide,
    /// One vector of lanes, for a few members.
    Few,
    /// One member.
    One,
}

impl Width {
    /// All of them.
    pub const ALL: [Width; 3] = [Width::Wide, Width::Few, Width::One];
}

/// What is interpreted before machine code is written, in operations over one lane for each operation of the body: writing an
/// operation takes about as long as interpreting it so often.
const INTERPRETED: u64 = 4000;
/// What the interpreter pays to begin an operation over a row of lanes, in lanes.
const TO_BEGIN: usize = 10;

/// Lanes that the interpreter takes at once where nothing else sets their number: the values of a step stay in the first cache.
const INTERPRETED_LANES: [usize; 3] = [64, 8, 1];

/// Members to expect at each width.
const MEMBERS: [usize; 3] = [usize::MAX, 8, 1];

/// A body at a width.
pub struct Runner {
    body: Body,
    lanes: usize,
    interpreter: Interpreter,
    /// How it would be written; none where no machine code can be.
    shape: Option<Shape>,
    written: OnceLock<Option<Box<dyn Kernel>>>,
    /// What was done so far, as [`INTERPRETED`] counts it.
    done: AtomicU64,
}

impl Runner {
    /// For so many members as the width says.
    pub fn new(body: &Body, level: Level, width: Width) -> Runner {
        let shape = writer::choose(body, level, MEMBERS[width as usize]);
        let lanes = shape.as_ref().map_or(INTERPRETED_LANES[width as usize], Shape::lanes);
        Runner::shaped(body, level, lanes, shape)
    }

    /// For rows of so many lanes, each a number of a long block.
    pub fn long(body: &Body, level: Level, lanes: usize) -> Runner {
        Runner::shaped(body, level, lanes, writer::choose_long(body, level, lanes))
    }

    fn shaped(body: &Body, level: Level, lanes: usize, shape: Option<Shape>) -> Runner {
        let interpreter = Interpreter::new(body, lanes, level);
        Runner { body: body.clone(), lanes, interpreter, shape, written: OnceLock::new(), done: AtomicU64::new(0) }
    }

    /// How long rows are.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// What a step of the tile costs, in steps of a vector of lanes.
    pub fn cost(&self) -> usize {
        self.shape.as_ref().map_or(self.lanes.div_ceil(8), Shape::cost)
    }

    /// What it makes steps of.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// What makes so many more steps, and whether that is machine code.
    #[inline]
    pub fn kernel(&self, steps: usize) -> (&dyn Kernel, bool) {
        // Asked first: the count of what was done belongs to all threads, and to touch it takes longer than a short kernel.
        if let Some(Some(written)) = self.written.get() {
            return (written.as_ref(), true);
        }
        let coming = (steps * (self.lanes + TO_BEGIN)) as u64;
        if self.shape.is_none() || self.done.fetch_add(coming, Relaxed) + coming < INTERPRETED {
            return (&self.interpreter, false);
        }
        match self.write() {
            Some(written) => (written, true),
            None => (&self.interpreter, false),
        }
    }

    /// Writes the machine code, unless it is there or cannot be: for whoever knows that it pays.
    pub fn write(&self) -> Option<&dyn Kernel> {
        let write = || {
            let written = writer::write(&self.body, self.shape?)?;
            Some(Box::new(written) as Box<dyn Kernel>)
        };
        self.written.get_or_init(write).as_deref()
    }
}

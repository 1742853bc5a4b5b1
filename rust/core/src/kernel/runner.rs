//! A body with its kernel: interpreted at first, compiled to machine code when that is worthwhile.

use std::sync::{
    OnceLock,
    atomic::{AtomicU64, Ordering::Relaxed},
};

use super::{
    Kernel, Layout,
    interpret::Interpreter,
    writer::{self, Shape},
};
use crate::{isa::Level, real::Real, tape::split::Body};

/// Each operation of the body is interpreted so often, counted over one lane, before machine code is written: writing an operation
/// takes about as long.
const INTERPRETATIONS_PER_WRITE: u64 = 4000;
/// The cost of dispatching an operation over a row of lanes in the interpreter, in lanes.
const LANES_PER_DISPATCH: usize = 10;

/// Lanes that the interpreter takes at once where no shape sets their number: of so few members all, of many the fewest and the most.
/// The more there are, the less it counts how long an operation takes to be dispatched.
const FEW_INTERPRETED: usize = 8;
const INTERPRETED_LANES: [usize; 2] = [64, 256];
/// The most bytes of the values of an interpreted step between these numbers of lanes, so that they stay in the L1 cache.
const INTERPRETED_BYTES: usize = 16 << 10;

/// How many lanes of a run of so many members the interpreter takes at once: the same for all turns, as nearly as can be.
fn interpreted_lanes(body: &Body, members: usize) -> usize {
    if members <= FEW_INTERPRETED {
        return members.max(1);
    }
    let [fewest, most] = INTERPRETED_LANES;
    let row = INTERPRETED_BYTES / body.precision.bytes() / Interpreter::new(body, 1, Level::Baseline).rows().max(1);
    let turns = members.div_ceil(row.clamp(fewest, most));
    members.div_ceil(turns).next_multiple_of(FEW_INTERPRETED)
}

/// A body, over tiles of one length.
pub struct Runner<T: Real = f64> {
    body: Body,
    lanes: usize,
    interpreter: Interpreter,
    /// The shape of its machine code; none where there is no machine code.
    shape: Option<Shape>,
    written: OnceLock<Option<Box<dyn Kernel<T>>>>,
    /// The work interpreted so far, as [`INTERPRETATIONS_PER_WRITE`] counts it.
    done: AtomicU64,
}

impl<T: Real> Runner<T> {
    /// For a run of so many members.
    pub fn new(body: &Body, level: Level, members: usize) -> Runner<T> {
        let shape = writer::choose(body, level, members);
        let lanes = shape.as_ref().map_or_else(|| interpreted_lanes(body, members), Shape::lanes);
        Runner::shaped(body, level, lanes, shape)
    }

    /// For rows of so many lanes, each a number of a long block.
    pub fn long(body: &Body, level: Level, lanes: usize) -> Runner<T> {
        Runner::shaped(body, level, lanes, writer::choose_long(body, level, lanes))
    }

    /// With a shape that was chosen before; interpreted if there is none.
    pub fn shaped(body: &Body, level: Level, lanes: usize, shape: Option<Shape>) -> Runner<T> {
        let interpreter = Interpreter::new(body, lanes, level.of_loops());
        Runner { body: body.clone(), lanes, interpreter, shape, written: OnceLock::new(), done: AtomicU64::new(0) }
    }

    /// How long rows are.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// How machine code would go through a tile; none where there is none at this level.
    pub fn layout(&self) -> Option<Layout> {
        self.shape.as_ref().map(Shape::layout)
    }

    /// What it makes steps of.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// What makes so many more steps, and whether that is machine code.
    pub fn kernel(&self, steps: usize) -> (&dyn Kernel<T>, bool) {
        // Asked first: the count of what was done belongs to all threads, and to touch it takes longer than a short kernel.
        if let Some(Some(written)) = self.written.get() {
            return (written.as_ref(), true);
        }
        let coming = (steps * (self.lanes + LANES_PER_DISPATCH)) as u64;
        let pays = self.shape.is_some() && self.done.fetch_add(coming, Relaxed) + coming >= INTERPRETATIONS_PER_WRITE;
        match pays.then(|| self.write()).flatten() {
            Some(written) => (written, true),
            None => (&self.interpreter, false),
        }
    }

    /// The machine code, written now if it was not before; none where none can be.
    pub fn write(&self) -> Option<&dyn Kernel<T>> {
        let write = || {
            let written = writer::write(&self.body, self.shape?)?;
            Some(Box::new(written) as Box<dyn Kernel<T>>)
        };
        self.written.get_or_init(write).as_deref()
    }
}

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
use crate::{
    isa::Level,
    tape::{real::Real, split::Body},
};

/// Each operation of the body is interpreted so often, counted over one lane, before machine code is written: writing an
/// operation takes about as long.
const INTERPRETATIONS_PER_WRITE: u64 = 4000;
/// Steps of a single member after which packing of equal operations into lanes of one vector is tried: that takes about as
/// long as these steps.
const STEPS_PER_PACKING: u64 = 12_000;
/// The cost of dispatching an operation over a row of lanes in the interpreter, in lanes.
const LANES_PER_DISPATCH: usize = 10;

/// Lanes that the interpreter takes at once where no shape sets their number: all of a few members, and bounds for more. The
/// more lanes, the less the time to dispatch an operation counts.
const FEW_INTERPRETED: usize = 8;
const INTERPRETED_LANES: [usize; 2] = [64, 256];
/// The most bytes of the values of an interpreted step between these numbers of lanes, so that they stay in the L1 cache.
const INTERPRETED_BYTES: usize = 16 << 10;

/// Lanes that the interpreter takes at once in a run of `members` members: the same for all turns, as nearly as can be.
fn interpreted_lanes(body: &Body, members: usize) -> usize {
    if members <= FEW_INTERPRETED {
        return members.max(1);
    }
    let [fewest, most] = INTERPRETED_LANES;
    let row = INTERPRETED_BYTES / body.precision.bytes() / Interpreter::new(body, 1, Level::Baseline).rows().max(1);
    let turns = members.div_ceil(row.clamp(fewest, most));
    members.div_ceil(turns).next_multiple_of(FEW_INTERPRETED)
}

/// The kind of the kernel. Each has its own layout of the uniform numbers: see [`Kernel::pool`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KernelKind {
    /// The interpreter.
    Interpreter,
    /// Machine code, a member in each lane.
    Lanes,
    /// Machine code for one member, whose equal operations are lanes of one vector.
    Packed,
}

/// A body, over tiles of one length.
pub(crate) struct Runner<T: Real = f64> {
    body: Body,
    lanes: usize,
    interpreter: Interpreter,
    /// The shape of its machine code; none where there is no machine code.
    shape: Option<Shape>,
    written: OnceLock<Option<Box<dyn Kernel<T>>>>,
    packed: OnceLock<Option<Box<dyn Kernel<T>>>>,
    /// The work interpreted so far, as [`INTERPRETATIONS_PER_WRITE`] counts it.
    done: AtomicU64,
    /// The steps made by machine code before packing was tried.
    steps: AtomicU64,
}

impl<T: Real> Runner<T> {
    /// A runner for `members` members.
    pub(crate) fn new(body: &Body, level: Level, members: usize) -> Runner<T> {
        let shape = writer::choose(body, level, members);
        let lanes = shape.as_ref().map_or_else(|| interpreted_lanes(body, members), Shape::lanes);
        Runner::shaped(body, level, lanes, shape)
    }

    /// A runner for rows of `lanes` lanes, each a number of a long block.
    pub(crate) fn long(body: &Body, level: Level, lanes: usize) -> Runner<T> {
        Runner::shaped(body, level, lanes, writer::choose_long(body, level, lanes))
    }

    /// A runner with a given shape; interpreted if there is none.
    pub(crate) fn shaped(body: &Body, level: Level, lanes: usize, shape: Option<Shape>) -> Runner<T> {
        let interpreter = Interpreter::new(body, lanes, level.of_loops());
        let packed = OnceLock::new();
        if !shape.is_some_and(|shape: Shape| shape.packs()) {
            let _ = packed.set(None);
        }
        Runner {
            body: body.clone(),
            lanes,
            interpreter,
            shape,
            written: OnceLock::new(),
            packed,
            done: AtomicU64::new(0),
            steps: AtomicU64::new(0),
        }
    }

    /// How long rows are.
    pub(crate) fn lanes(&self) -> usize {
        self.lanes
    }

    /// How machine code would go through a tile; none where there is none at this level.
    pub(crate) fn layout(&self) -> Option<Layout> {
        self.shape.as_ref().map(Shape::layout)
    }

    /// Whether its machine code may have the numbers of one member in the lanes of vectors.
    pub(crate) fn packs(&self) -> bool {
        self.shape.is_some_and(|shape| shape.packs())
    }

    /// The body that it runs.
    pub(crate) fn body(&self) -> &Body {
        &self.body
    }

    /// The kernel for the next `steps` steps.
    pub(crate) fn kernel(&self, steps: usize) -> (&dyn Kernel<T>, KernelKind) {
        // Asked first: the count of what was done belongs to all threads, and to touch it takes longer than a short kernel.
        if let Some(Some(written)) = self.written.get() {
            let packed = match self.packed.get() {
                Some(packed) => packed.as_deref(),
                None if self.steps.fetch_add(steps as u64, Relaxed) < STEPS_PER_PACKING => None,
                None => self.pack(),
            };
            return packed.map_or((written.as_ref(), KernelKind::Lanes), |packed| (packed, KernelKind::Packed));
        }
        let coming = (steps * (self.lanes + LANES_PER_DISPATCH)) as u64;
        let pays = self.shape.is_some() && self.done.fetch_add(coming, Relaxed) + coming >= INTERPRETATIONS_PER_WRITE;
        match pays.then(|| self.write_lanes()).flatten() {
            Some(written) => (written, KernelKind::Lanes),
            None => (&self.interpreter, KernelKind::Interpreter),
        }
    }

    /// The fastest machine code, written now if it was not before; none where none can be.
    pub(crate) fn write(&self) -> Option<&dyn Kernel<T>> {
        let written = self.write_lanes()?;
        Some(self.pack().unwrap_or(written))
    }

    fn write_lanes(&self) -> Option<&dyn Kernel<T>> {
        let write = || {
            let written = writer::write(&self.body, self.shape?)?;
            Some(Box::new(written) as Box<dyn Kernel<T>>)
        };
        self.written.get_or_init(write).as_deref()
    }

    fn pack(&self) -> Option<&dyn Kernel<T>> {
        let write = || {
            let written = writer::write_if_it_gains(&self.body, self.shape?)?;
            Some(Box::new(written) as Box<dyn Kernel<T>>)
        };
        self.packed.get_or_init(write).as_deref()
    }
}

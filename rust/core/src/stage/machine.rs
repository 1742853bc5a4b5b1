//! The means of hot loops: instruction set and threads, and the flag that stops them.

use std::{
    sync::{Arc, OnceLock, atomic::AtomicBool},
    thread,
};

use crate::isa::Level;

/// The instruction set and threads of hot loops.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// The instruction set.
    pub level: Level,
    /// How many threads the forces of one large system may use; zero for as many as there are.
    pub threads: usize,
}

impl Machine {
    /// Threads to use for work that can be divided into `parts` parts, if more than one are worthwhile.
    pub(crate) fn threads_for(self, parts: usize, worthwhile: bool) -> usize {
        /// The operating system reads files for it, which takes as long as a short run, so it is asked once.
        static AVAILABLE: OnceLock<usize> = OnceLock::new();
        let threads = match self.threads {
            0 if !worthwhile || parts <= 1 => 1,
            0 => *AVAILABLE.get_or_init(|| thread::available_parallelism().map_or(1, usize::from)),
            threads => threads,
        };
        threads.min(parts).max(1)
    }
}

/// Set when all threads are to stop. They leave their parts unfinished; the results of an interrupted run are discarded.
pub type Stop = Arc<AtomicBool>;

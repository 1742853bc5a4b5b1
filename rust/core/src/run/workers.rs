//! The threads of a run share its parts. The caller's monitor gets the progress and may stop the run.

use std::{
    sync::{
        Mutex,
        atomic::{
            AtomicU64, AtomicUsize,
            Ordering::{Acquire, Relaxed, Release},
        },
    },
    thread::{self, Thread},
    time::{Duration, Instant},
};

use crate::{error::Error, stage::Stop};

/// The longest time between two calls of the caller's monitor.
pub(crate) const POLL: Duration = Duration::from_millis(20);

/// Memory that must be left for a thread to be started: for its stack, 2 MiB, and for what it and the others allocate.
const ROOM_FOR_A_THREAD: usize = 16 << 20;

/// Is called with the amount of work done since the last call; returns whether to continue.
pub(crate) type GoOn<'a> = &'a mut dyn FnMut(u64) -> bool;

/// The threads of a run, and its stop flag.
#[derive(Debug)]
pub(crate) struct Workers {
    /// Number of threads that work on parts.
    pub threads: usize,
    /// Work in other threads only: a single step may take long, and the caller waits for signals, so that it can be stopped
    /// within one.
    pub background: bool,
    /// The whole work, in the unit of [`GoOn`].
    pub total: f64,
    /// Set to stop all threads.
    pub stop: Stop,
}

/// Does all parts. `mine` is the state of the first worker, `worker` makes those of the others.
///
/// The monitor is called on this thread some dozens of times a second with the fraction of the total that is done. When it
/// returns false, all threads stop.
pub(crate) fn share<P: Send, W: Send>(
    parts: Vec<P>,
    workers: &Workers,
    monitor: &mut dyn FnMut(f64) -> bool,
    mine: W,
    worker: impl Fn() -> Result<W, Error> + Sync,
    part: impl Fn(&mut W, P, GoOn) -> Result<(), Error> + Sync,
) -> Result<(), Error> {
    let Workers { threads, background, total, stop } = workers;
    let queue = Mutex::new(parts.into_iter());
    let done = AtomicU64::new(0);
    let take = || queue.lock().map_or(None, |mut q| q.next());
    let busy = AtomicUsize::new(0);
    let caller = thread::current();
    let work = |its: Option<W>, go_on: GoOn| {
        let mut its = its.map_or_else(&worker, Ok)?;
        while let Some(next) = take() {
            part(&mut its, next, go_on)?;
        }
        Ok(())
    };
    thread::scope(|scope| {
        let mut mine = Some(mine);
        let mut helpers = Vec::new();
        for _ in usize::from(!background)..*threads {
            // One that is started with the last of the memory may find none for itself a moment later, and the C library then
            // ends the process.
            if memmap2::MmapMut::map_anon(ROOM_FOR_A_THREAD).is_err() {
                break;
            }
            let its = if *background { mine.take() } else { None };
            busy.fetch_add(1, Relaxed);
            let guard = BusyGuard(&busy, &caller);
            let (work, done) = (&work, &done);
            let helper = move || {
                let _guard = guard;
                work(its, &mut |n| {
                    done.fetch_add(n, Relaxed);
                    !stop.load(Relaxed)
                })
            };
            // If a thread cannot be started, the others do its parts.
            match thread::Builder::new().spawn_scoped(scope, helper) {
                Ok(helper) => helpers.push(helper),
                Err(_) => break,
            }
        }
        let mut asked = Instant::now();
        let mut go_on = |n: u64| {
            done.fetch_add(n, Relaxed);
            if asked.elapsed() >= POLL {
                asked = Instant::now();
                if !monitor(done.load(Relaxed) as f64 / total.max(1.0)) {
                    stop.store(true, Relaxed);
                }
            }
            !stop.load(Relaxed)
        };
        let mut result = if !background || helpers.is_empty() { work(mine, &mut go_on) } else { Ok(()) };
        while busy.load(Acquire) > 0 {
            thread::park_timeout(POLL);
            go_on(0);
        }
        for helper in helpers {
            result = result.and(helper.join().unwrap_or(Err(Error::Interrupted)));
        }
        result
    })
}

/// Dropped when a thread has ended, even if it panicked or could not be started: counts it out and wakes the caller.
struct BusyGuard<'a>(&'a AtomicUsize, &'a Thread);

impl Drop for BusyGuard<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Release);
        self.1.unpark();
    }
}

//! Threads that share the parts of a run, and a caller who is told how far it is and may end it.

use std::{
    sync::{
        Arc, Mutex,
        atomic::{
            AtomicBool, AtomicU64, AtomicUsize,
            Ordering::{Acquire, Relaxed, Release},
        },
    },
    thread::{self, Thread},
    time::{Duration, Instant},
};

use crate::error::Error;

/// How long the caller's monitor may wait.
pub const POLL: Duration = Duration::from_millis(20);

/// Says how much was done, and hears whether to go on.
pub type GoOn<'a> = &'a mut dyn FnMut(u64) -> bool;

/// Set when all threads are to stop. They leave their parts as they are; the results of an interrupted run are discarded.
pub type Stop = Arc<AtomicBool>;

/// Who does the parts of a run.
#[derive(Debug)]
pub struct Crew {
    /// How many work.
    pub threads: usize,
    /// Work in other threads only: a single step may take long, and the caller waits for signals, so that it can be stopped within one.
    pub background: bool,
    /// How much there is to do.
    pub total: f64,
    /// How it is stopped.
    pub stop: Stop,
}

/// Does all parts, `mine` being the first of the crew and all others made by `worker`.
///
/// The monitor is called on this thread some dozens of times a second with the share of the total that is done; when it answers
/// no, all threads are told to stop.
pub fn share<P: Send, W: Send>(
    parts: Vec<P>,
    crew: &Crew,
    monitor: &mut dyn FnMut(f64) -> bool,
    mine: W,
    worker: impl Fn() -> Result<W, Error> + Sync,
    part: impl Fn(&mut W, P, GoOn) -> Result<(), Error> + Sync,
) -> Result<(), Error> {
    let Crew { threads, background, total, stop } = crew;
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
            let its = if *background { mine.take() } else { None };
            busy.fetch_add(1, Relaxed);
            let leave = Leave(&busy, &caller);
            let (work, done) = (&work, &done);
            let helper = move || {
                let _leave = leave;
                work(its, &mut |n| {
                    done.fetch_add(n, Relaxed);
                    !stop.load(Relaxed)
                })
            };
            // A thread that cannot be had leaves its parts to the others.
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

/// Tells the caller that a thread has nothing left to do, also if it panicked or was never there.
struct Leave<'a>(&'a AtomicUsize, &'a Thread);

impl Drop for Leave<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Release);
        self.1.unpark();
    }
}

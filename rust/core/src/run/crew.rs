//! Threads that share the parts of a run, and a caller who is told how far it is and may end it.

use std::{
    sync::{
        Mutex,
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

/// Does all parts, `mine` on this thread and as many others, each made by `worker`, as make up `threads`.
///
/// The monitor is called on this thread some dozens of times a second with the share of `total` that is done; when it answers
/// no, everybody is told not to go on.
pub fn share<P: Send, W>(
    parts: Vec<P>,
    threads: usize,
    total: f64,
    monitor: &mut dyn FnMut(f64) -> bool,
    mut mine: W,
    worker: impl Fn() -> Result<W, Error> + Sync,
    part: impl Fn(&mut W, P, GoOn) -> Result<(), Error> + Sync,
) -> Result<(), Error> {
    let queue = Mutex::new(parts.into_iter());
    let done = AtomicU64::new(0);
    let stop = AtomicBool::new(false);
    let take = || queue.lock().map_or(None, |mut q| q.next());
    let busy = AtomicUsize::new(threads - 1);
    let caller = thread::current();
    thread::scope(|scope| {
        let helpers: Vec<_> = (1..threads)
            .map(|_| {
                scope.spawn(|| {
                    let _leave = Leave(&busy, &caller);
                    let mut its = worker()?;
                    while let Some(next) = take() {
                        part(&mut its, next, &mut |n| {
                            done.fetch_add(n, Relaxed);
                            !stop.load(Relaxed)
                        })?;
                    }
                    Ok(())
                })
            })
            .collect();
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
        let mut result = Ok(());
        while result.is_ok()
            && let Some(next) = take()
        {
            result = part(&mut mine, next, &mut go_on);
        }
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

/// Tells the caller that a thread has nothing left to do, also if it panicked.
struct Leave<'a>(&'a AtomicUsize, &'a Thread);

impl Drop for Leave<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Release);
        self.1.unpark();
    }
}

//! One force of one large system on several threads: they take slabs of distances, whose sums are added in their own order.

use std::{sync::Mutex, thread};

use stepwell_base::forces::{Distances, Sums};

/// The sums of a slab.
pub(super) struct Share {
    pub(super) force: Vec<f64>,
    pub(super) potential: Vec<f64>,
    done: bool,
}

impl Share {
    pub(super) fn new(n: usize, dim: usize) -> Self {
        Share { force: vec![0.0; n * dim], potential: vec![0.0; n], done: false }
    }
}

/// Adds to what is there, or replaces it.
pub(super) fn add(to: &mut [f64], from: &[f64], more: bool) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = if more { *to + from } else { *from };
    }
}

/// Computes every slab into its share, on as many threads as there are sums.
pub(super) fn share(
    slabs: &[Vec<Distances>],
    shares: &mut [Share],
    sums: &mut [Sums],
    meet: impl Fn(&[Distances], &mut Share, &mut Sums) + Sync,
) {
    let Some((mine, others)) = sums.split_first_mut() else { return };
    let queue = Mutex::new(slabs.iter().zip(&mut *shares));
    let take = || queue.lock().map_or(None, |mut queue| queue.next());
    let work = |sums: &mut Sums| {
        while let Some((groups, share)) = take() {
            meet(groups, share, sums);
            share.done = true;
        }
    };
    let work = &work;
    thread::scope(|scope| {
        // If a thread cannot be started, the others do its slabs.
        let start = |sums| thread::Builder::new().spawn_scoped(scope, move || work(sums)).ok();
        let helpers: Vec<_> = others.iter_mut().filter_map(start).collect();
        work(mine);
        // The panic of a thread is not passed on to the caller: its slab is computed below.
        helpers.into_iter().for_each(|helper| drop(helper.join()));
    });
    for (groups, share) in slabs.iter().zip(shares) {
        if !share.done {
            meet(groups, share, mine);
        }
        share.done = false;
    }
}

/// A part of the bodies without mass.
struct Part<'a> {
    bodies: &'a [u32],
    /// The forces on the bodies from number `first` on.
    out: &'a mut [f64],
    first: usize,
    done: bool,
}

/// Calls a function on `threads` threads, each time for a part of the bodies without mass: with their numbers, the forces on the
/// bodies from a first one on, and the number of that one.
pub(super) fn share_massless(
    threads: usize,
    bodies: &[u32],
    dim: usize,
    out: &mut [f64],
    pull: impl Fn(&[u32], &mut [f64], usize) + Sync,
) {
    if threads < 2 {
        return pull(bodies, out, 0);
    }
    let mut parts = Vec::with_capacity(threads);
    let (mut left, mut first) = (out, 0);
    for bodies in bodies.chunks(bodies.len().div_ceil(threads).max(1)) {
        let end = bodies.last().map_or(first, |last| *last as usize + 1); // they ascend, so no other part is before it
        let (out, others) = left.split_at_mut(dim * (end - first));
        parts.push(Part { bodies, out, first, done: false });
        (left, first) = (others, end);
    }
    let queue = Mutex::new(parts.iter_mut());
    let take = || queue.lock().map_or(None, |mut queue| queue.next());
    let work = || {
        while let Some(part) = take() {
            pull(part.bodies, part.out, part.first);
            part.done = true;
        }
    };
    let work = &work;
    thread::scope(|scope| {
        let start = |_| thread::Builder::new().spawn_scoped(scope, work).ok();
        let helpers: Vec<_> = (1..threads).filter_map(start).collect();
        work();
        helpers.into_iter().for_each(|helper| drop(helper.join())); // as above
    });
    for part in parts.iter_mut().filter(|part| !part.done) {
        pull(part.bodies, part.out, part.first);
    }
}

//! Caches for the life of a process, which a forked child leaves behind.

use std::{
    collections::HashMap,
    hash::Hash,
    sync::{
        Arc, Mutex, MutexGuard, OnceLock, PoisonError,
        atomic::{AtomicUsize, Ordering::Relaxed},
    },
};

use crate::error::Error;

/// The most operations of all tapes in a cache: about 50 bytes each on the tape, and at most as much again, for each interleaved
/// vector, as machine code. When a new entry would exceed it, the cache is emptied first.
const MAX_CACHED_OPERATIONS: usize = 400_000;

/// Memory of an entry beside its own operations, as a number of operations: its key, and what surrounds the machine code.
const OPERATIONS_OF_AN_ENTRY: usize = 400;

/// How often this process, or one that it descends from, began with new caches.
static GENERATION: AtomicUsize = AtomicUsize::new(0);

/// Begins with new caches. For a forked child of a process in which other threads were at work: what they had locked, or were
/// compiling just then, is never released, and the child would wait for it for ever.
pub fn forget() {
    GENERATION.fetch_add(1, Relaxed);
}

/// A cache, and those of later generations. The former ones stay as they are: what they hold may be locked.
pub(crate) struct Cache<K, V> {
    entries: Mutex<Entries<K, V>>,
    next: OnceLock<Box<Cache<K, V>>>,
}

impl<K, V> Default for Cache<K, V> {
    fn default() -> Self {
        Cache { entries: Mutex::default(), next: OnceLock::new() }
    }
}

struct Entries<K, V> {
    known: HashMap<K, Arc<V>>,
    operations: usize,
}

impl<K, V> Default for Entries<K, V> {
    fn default() -> Self {
        Entries { known: HashMap::new(), operations: 0 }
    }
}

impl<K: Clone + Eq + Hash, V> Cache<K, V> {
    /// The entries of the present generation.
    fn entries(&self) -> MutexGuard<'_, Entries<K, V>> {
        let of = (0..GENERATION.load(Relaxed)).fold(self, |of, _| of.next.get_or_init(Box::default));
        // A thread that panicked while it held the lock has left the map intact: entries are made outside the lock.
        of.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether there is a value of this key.
    pub(crate) fn has(&self, key: &K) -> bool {
        self.entries().known.contains_key(key)
    }

    /// The value of a key. If it is missing, `make` makes it and returns it with its number of operations.
    pub(crate) fn find(&self, key: &K, make: impl FnOnce() -> Result<(V, usize), Error>) -> Result<Arc<V>, Error> {
        if let Some(known) = self.entries().known.get(key) {
            return Ok(Arc::clone(known));
        }
        let (made, size) = make()?;
        let (made, size) = (Arc::new(made), size + OPERATIONS_OF_AN_ENTRY);
        let mut entries = self.entries();
        if entries.operations + size > MAX_CACHED_OPERATIONS {
            *entries = Entries::default();
        }
        entries.operations += size;
        entries.known.insert(key.clone(), Arc::clone(&made));
        Ok(made)
    }
}

//! A fast hash: operations are small and there are tens of thousands. It need not resist chosen keys.

use std::{
    collections::HashMap,
    hash::{BuildHasherDefault, Hash, Hasher},
};

/// A map with a fast hash.
pub(crate) type FastHashMap<K, V> = HashMap<K, V, BuildHasherDefault<FastHasher>>;

/// Multiplies and adds: the high bits depend on all of the input.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FastHasher(u64);

/// An odd number whose bits look random.
const FACTOR: u64 = 0xF135_7AEA_2E62_A9C5;

impl Hasher for FastHasher {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_u64(u64::from(*byte)));
    }

    fn write_u32(&mut self, number: u32) {
        self.write_u64(u64::from(number));
    }

    fn write_u64(&mut self, number: u64) {
        self.0 = self.0.wrapping_add(number).wrapping_mul(FACTOR);
    }

    fn write_usize(&mut self, number: usize) {
        self.write_u64(number as u64);
    }

    // The discriminant of an enum is hashed by this.
    fn write_isize(&mut self, number: isize) {
        self.write_u64(number as u64);
    }

    fn finish(&self) -> u64 {
        self.0.rotate_left(26)
    }
}

/// Things in the order of their first request, each once.
#[derive(Clone, Debug)]
pub(crate) struct Places<T> {
    pub list: Vec<T>,
    known: FastHashMap<T, u32>,
}

impl<T> Default for Places<T> {
    fn default() -> Self {
        Places { list: Vec::new(), known: FastHashMap::default() }
    }
}

impl<T: Copy + Eq + Hash> Places<T> {
    /// The place of a thing, which is given the next one if it has none.
    pub(crate) fn of(&mut self, what: T) -> u32 {
        *self.known.entry(what).or_insert_with(|| {
            self.list.push(what);
            self.list.len() as u32 - 1
        })
    }
}

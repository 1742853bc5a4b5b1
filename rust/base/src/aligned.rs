//! Numbers that begin at a cache line.
//!
//! A vector of eight numbers across two cache lines takes two loads, and store forwarding fails for it. Without alignment the
//! same kernel was up to a fifth slower, depending on the allocator.

use std::ops::{Deref, DerefMut};

const LINE: usize = 64;

/// An array of numbers, initially zero, that begins at a line of the cache.
#[derive(Debug, Default)]
pub struct Aligned<T = f64> {
    numbers: Vec<T>,
    first: usize,
    count: usize,
}

impl<T: Copy + Default> Aligned<T> {
    const IN_A_LINE: usize = LINE / size_of::<T>();

    /// An array of `count` zeros.
    pub fn new(count: usize) -> Aligned<T> {
        let numbers = vec![T::default(); count + Self::IN_A_LINE - 1];
        let first = numbers.as_ptr().align_offset(LINE).min(Self::IN_A_LINE - 1);
        Aligned { numbers, first, count }
    }

    /// A copy of these numbers.
    pub fn from(numbers: &[T]) -> Aligned<T> {
        let mut aligned = Aligned::new(numbers.len());
        aligned.copy_from_slice(numbers);
        aligned
    }
}

impl<T> Deref for Aligned<T> {
    type Target = [T];
    #[inline]
    fn deref(&self) -> &[T] {
        &self.numbers[self.first..self.first + self.count]
    }
}

impl<T> DerefMut for Aligned<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.numbers[self.first..self.first + self.count]
    }
}

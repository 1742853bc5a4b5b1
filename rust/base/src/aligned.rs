//! Numbers that begin at a cache line.
//!
//! A vector of eight numbers across two cache lines takes two loads, and store forwarding fails for it. Without alignment the same kernel
//! was up to a fifth slower, depending on the allocator.

use std::ops::{Deref, DerefMut};

const LINE: usize = 64;
const NUMBERS: usize = LINE / size_of::<f64>();

/// So many numbers, all zero at first.
#[derive(Debug, Default)]
pub struct Aligned {
    numbers: Vec<f64>,
    first: usize,
    count: usize,
}

impl Aligned {
    /// So many zeros.
    pub fn new(count: usize) -> Aligned {
        let numbers = vec![0.0; count + NUMBERS - 1];
        let first = numbers.as_ptr().align_offset(LINE).min(NUMBERS - 1);
        Aligned { numbers, first, count }
    }

    /// These numbers.
    pub fn from(numbers: &[f64]) -> Aligned {
        let mut aligned = Aligned::new(numbers.len());
        aligned.copy_from_slice(numbers);
        aligned
    }
}

impl Deref for Aligned {
    type Target = [f64];
    #[inline]
    fn deref(&self) -> &[f64] {
        &self.numbers[self.first..self.first + self.count]
    }
}

impl DerefMut for Aligned {
    #[inline]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[self.first..self.first + self.count]
    }
}

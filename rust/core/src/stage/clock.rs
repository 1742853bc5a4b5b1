//! Input of a stage from step to step: the time, and a force from outside.

/// Time and step: t = `t0` + k·`h` at step k, never accumulated.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Time of step 0.
    pub t0: f64,
    /// The step.
    pub h: f64,
}

impl Clock {
    /// For steps that have no time in common: every lane has its own.
    pub(crate) const NONE: Clock = Clock { t0: 0.0, h: 1.0 };

    /// The time of step `k`.
    #[inline]
    pub fn at(&self, k: i64) -> f64 {
        self.t0 + k as f64 * self.h
    }
}

/// A force from outside that changes between steps: rows of one number for each member.
#[derive(Clone, Copy, Debug)]
pub struct Force<'a, T = f64> {
    /// The rows, one for each number of v.
    pub numbers: &'a [T],
    /// How long a row is.
    pub members: usize,
    /// The number of the first row among all parameters.
    pub place: usize,
}

impl<T> Force<'_, T> {
    /// A row.
    pub(crate) fn row(&self, i: usize) -> &[T] {
        &self.numbers[i * self.members..][..self.members]
    }
}

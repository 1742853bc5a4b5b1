//! Blocks: what a step adds and scales.
//!
//! A step is written over blocks and does not know what they are. For a small system a block is a short nalgebra vector that
//! lives in registers, one per lane; for a system of any size it is an nalgebra matrix of lanes × rows on the heap. Both are
//! the same implementation, because both are contiguous numbers: an operation on blocks is the same operation on each number,
//! in the order in which the reference spells it.

use nalgebra::{DefaultAllocator, Dim, OMatrix, allocator::Allocator};

use crate::system::System;

/// A block of numbers that a step can add and scale.
pub trait Block {
    /// A block of the same shape, all zero.
    fn like(&self) -> Self;
    /// A block that is never used: as `like`, but it takes no memory where the shape allows.
    fn unused(&self) -> Self;
    /// The numbers, in order.
    fn numbers(&self) -> &[f64];
    /// The numbers, to write.
    fn numbers_mut(&mut self) -> &mut [f64];

    /// `self = self + d`
    #[inline(always)]
    fn add(&mut self, d: &impl Block) {
        for (s, d) in self.numbers_mut().iter_mut().zip(d.numbers()) {
            *s += *d;
        }
    }

    /// `self = a + d`
    #[inline(always)]
    fn sum(&mut self, a: &impl Block, d: &impl Block) {
        for ((s, a), d) in self.numbers_mut().iter_mut().zip(a.numbers()).zip(d.numbers()) {
            *s = *a + *d;
        }
    }

    /// `self = a + c * d`
    #[inline(always)]
    fn sum_scaled(&mut self, a: &impl Block, c: f64, d: &impl Block) {
        for ((s, a), d) in self.numbers_mut().iter_mut().zip(a.numbers()).zip(d.numbers()) {
            *s = *a + c * *d;
        }
    }

    /// `self = self + c * d`
    #[inline(always)]
    fn add_scaled(&mut self, c: f64, d: &impl Block) {
        for (s, d) in self.numbers_mut().iter_mut().zip(d.numbers()) {
            *s += c * *d;
        }
    }

    /// `self = self + 0.5 * (a + b)`
    #[inline(always)]
    fn add_mean(&mut self, a: &impl Block, b: &impl Block) {
        for ((s, a), b) in self.numbers_mut().iter_mut().zip(a.numbers()).zip(b.numbers()) {
            *s += 0.5 * (*a + *b);
        }
    }

    /// `self = a + (c₀·d₀ + c₁·d₁ + …)`, the sum from the left
    #[inline(always)]
    fn sum_weighted<D: Block, const N: usize>(&mut self, a: &impl Block, terms: [(f64, &D); N]) {
        let n = self.numbers().len();
        let (a, terms) = (&a.numbers()[..n], terms.map(|(c, d)| (c, &d.numbers()[..n])));
        for (i, s) in self.numbers_mut().iter_mut().enumerate() {
            *s = a[i] + weighted(&terms, i);
        }
    }

    /// `self = self + (c₀·d₀ + c₁·d₁ + …)`, the sum from the left
    #[inline(always)]
    fn add_weighted<D: Block, const N: usize>(&mut self, terms: [(f64, &D); N]) {
        let n = self.numbers().len();
        let terms = terms.map(|(c, d)| (c, &d.numbers()[..n]));
        for (i, s) in self.numbers_mut().iter_mut().enumerate() {
            *s += weighted(&terms, i);
        }
    }

    /// `self = c₀·d₀ + c₁·d₁ + …`, from the left
    #[inline(always)]
    fn set_weighted<D: Block, const N: usize>(&mut self, terms: [(f64, &D); N]) {
        let n = self.numbers().len();
        let terms = terms.map(|(c, d)| (c, &d.numbers()[..n]));
        for (i, s) in self.numbers_mut().iter_mut().enumerate() {
            *s = weighted(&terms, i);
        }
    }

    /// `self = self + (((a + 2 * b) + 2 * c) + d) * (1 / 6)`
    #[inline(always)]
    fn add_kutta(&mut self, a: &impl Block, b: &impl Block, c: &impl Block, d: &impl Block) {
        const SIXTH: f64 = 1.0 / 6.0;
        let stages = a.numbers().iter().zip(b.numbers()).zip(c.numbers()).zip(d.numbers());
        for (s, (((a, b), c), d)) in self.numbers_mut().iter_mut().zip(stages) {
            *s += (((*a + 2.0 * *b) + 2.0 * *c) + *d) * SIXTH;
        }
    }
}

impl<R: Dim, C: Dim> Block for OMatrix<f64, R, C>
where
    DefaultAllocator: Allocator<R, C>,
{
    #[inline(always)]
    fn like(&self) -> Self {
        let (rows, columns) = self.shape_generic();
        if C::try_to_usize().is_some() {
            Self::zeros_generic(rows, columns)
        } else {
            at_a_line(|| Self::zeros_generic(rows, columns), |block| block.as_slice())
        }
    }

    #[inline(always)]
    fn unused(&self) -> Self {
        let (rows, columns) = self.shape_generic();
        Self::zeros_generic(rows, if C::try_to_usize().is_none() { C::from_usize(0) } else { columns })
    }

    #[inline(always)]
    fn numbers(&self) -> &[f64] {
        self.as_slice()
    }

    #[inline(always)]
    fn numbers_mut(&mut self) -> &mut [f64] {
        self.as_mut_slice()
    }
}

/// Makes numbers on the heap that begin at a cache line, if the allocator lands there within a few tries.
///
/// A vector of eight numbers that lies across two lines takes two reads, and waits long for what was just written there: a step
/// of a few bodies takes a fifth longer. Large blocks are not worth the tries.
#[inline(never)]
pub fn at_a_line<T>(make: impl Fn() -> T, numbers: impl Fn(&T) -> &[f64]) -> T {
    const LINE: usize = 64;
    let mut missed = Vec::new();
    loop {
        let made = make();
        let numbers = numbers(&made);
        if numbers.as_ptr().align_offset(LINE) == 0 || !(1..8192).contains(&numbers.len()) || missed.len() == 8 {
            return made;
        }
        // Kept until the end, or the next try would land in the same place.
        missed.push(made);
    }
}

/// The `i`-th number of c₀·d₀ + c₁·d₁ + …, from the left.
#[inline(always)]
fn weighted<const N: usize>(terms: &[(f64, &[f64]); N], i: usize) -> f64 {
    let mut sum = terms[0].0 * terms[0].1[i];
    for (c, d) in &terms[1..] {
        sum += c * d[i];
    }
    sum
}

/// How many increments of each block a step may hold at once.
pub const SLOTS: usize = 6;

/// Scratch for one step: the increments of the stages, and one intermediate state.
///
/// Small blocks live in registers and what a method does not use costs nothing; blocks on the heap are made once per run.
pub struct Work<S: System + ?Sized> {
    /// Increments of `v`, one per stage.
    pub dv: [S::V; SLOTS],
    /// Increments of `y`, one per stage.
    pub dy: [S::Y; SLOTS],
    /// Intermediate `v`.
    pub v: S::V,
    /// Intermediate `y`.
    pub y: S::Y,
}

impl<S: System + ?Sized> Work<S> {
    /// Scratch for blocks of the shapes of `v` and `y` and a method of so many evaluations.
    #[inline(always)]
    pub fn new(evaluations: u32, v: &S::V, y: &S::Y) -> Self {
        let used = |i: usize| i < evaluations as usize;
        Work {
            dv: std::array::from_fn(|i| if used(i) { v.like() } else { v.unused() }),
            dy: std::array::from_fn(|i| if used(i) { y.like() } else { y.unused() }),
            v: if used(1) { v.like() } else { v.unused() },
            y: if used(1) { y.like() } else { y.unused() },
        }
    }
}

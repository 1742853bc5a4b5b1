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

    /// `self = a + (c₀·d₀ + c₁·d₁ + …)`, the sum from the left, over slots and their weights
    #[inline(always)]
    fn sum_weighted<D: Block, const N: usize>(&mut self, a: &impl Block, d: &[D; SLOTS], terms: [(usize, f64); N]) {
        let n = alike(self, d, terms);
        let a = &a.numbers()[..n];
        for (i, s) in self.numbers_mut().iter_mut().enumerate() {
            *s = a[i] + weighted(d, terms, i);
        }
    }

    /// `self = self + (c₀·d₀ + c₁·d₁ + …)`, the sum from the left, over slots and their weights
    #[inline(always)]
    fn add_weighted<D: Block, const N: usize>(&mut self, d: &[D; SLOTS], terms: [(usize, f64); N]) {
        alike(self, d, terms);
        for (i, s) in self.numbers_mut().iter_mut().enumerate() {
            *s += weighted(d, terms, i);
        }
    }

    /// `self = c₀·d₀ + c₁·d₁ + …`, from the left, over slots and their weights
    #[inline(always)]
    fn set_weighted<D: Block, const N: usize>(&mut self, d: &[D; SLOTS], terms: [(usize, f64); N]) {
        alike(self, d, terms);
        for (i, s) in self.numbers_mut().iter_mut().enumerate() {
            *s = weighted(d, terms, i);
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

/// Does something for each of N terms. Written out: a loop over more than six terms is unrolled so late that no lane loop around it
/// is a vector loop.
macro_rules! each_term {
    ($n:ident, |$k:ident| $body:expr) => {
        each_term!(@ $n, |$k| $body, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11)
    };
    (@ $n:ident, |$k:ident| $body:expr, $($i:literal),*) => {
        const { assert!($n <= SLOTS) };
        $(if $n > $i {
            let $k: usize = $i;
            $body;
        })*
    };
}

/// The `i`-th number of c₀·d₀ + c₁·d₁ + …, from the left.
#[inline(always)]
fn weighted<D: Block, const N: usize>(d: &[D; SLOTS], terms: [(usize, f64); N], i: usize) -> f64 {
    let term = |k: usize| terms[k].1 * d[terms[k].0].numbers()[i];
    let mut sum = term(0);
    each_term!(N, |k| if k > 0 {
        sum += term(k)
    });
    sum
}

/// How many numbers a block has. Panics unless the terms have as many, so that a loop over them need not ask.
#[inline(always)]
fn alike<D: Block, const N: usize>(block: &(impl Block + ?Sized), d: &[D; SLOTS], terms: [(usize, f64); N]) -> usize {
    let n = block.numbers().len();
    each_term!(N, |k| assert!(d[terms[k].0].numbers().len() == n));
    n
}

/// How many increments of each block a step may hold at once.
pub const SLOTS: usize = 12;

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

/// One block for each slot, written out: the compiler does not unroll a loop over so many, and then no lane loop is a vector loop.
macro_rules! slots {
    ($block:ident, $used:ident) => {
        slots!($block, $used, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11)
    };
    ($block:ident, $used:ident, $($i:literal),*) => {
        [$(if $used($i) { $block.like() } else { $block.unused() }),*]
    };
}

impl<S: System + ?Sized> Work<S> {
    /// Scratch for blocks of the shapes of `v` and `y` and a method of so many evaluations.
    #[inline(always)]
    pub fn new(evaluations: u32, v: &S::V, y: &S::Y) -> Self {
        let used = |i: usize| i < evaluations as usize;
        Work {
            dv: slots!(v, used),
            dy: slots!(y, used),
            v: if used(1) { v.like() } else { v.unused() },
            y: if used(1) { y.like() } else { y.unused() },
        }
    }
}

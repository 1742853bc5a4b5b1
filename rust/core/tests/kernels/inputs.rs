//! Random shapes and inputs of kernels.

use crate::random::Random;
use stepwell_core::{
    isa::Level,
    kernel::{Kernel, Tile, writer::Shape},
    tape::{Op, real::Real, split::Body},
};

/// Inputs of a kernel.
#[derive(Clone)]
pub(crate) struct Inputs<T = f64> {
    pub state: Vec<T>,
    pub rows: Vec<T>,
    pub uniforms: Vec<T>,
    pub per_step: Vec<u64>,
    pub held: Vec<T>,
    pub steps: usize,
}

impl<T: Real> Inputs<T> {
    /// Inputs for a body, over rows of `lanes` lanes.
    pub(crate) fn new(random: &mut Random, body: &Body, lanes: usize, steps: usize) -> Inputs<T> {
        let mut numbers = |n: usize| (0..n).map(|_| random.number_of()).collect::<Vec<T>>();
        let (state, rows, uniforms) = (numbers(body.next.len() * lanes), numbers(body.rows * lanes), numbers(body.uniforms));
        let held = numbers(3 * lanes + 5);
        let mut per_step: Vec<u64> = numbers(body.per_step * steps).into_iter().map(T::pattern).collect();
        for op in &body.ops {
            if let Op::Held(i) = *op {
                per_step
                    .iter_mut()
                    .skip(i as usize)
                    .step_by(body.per_step)
                    .for_each(|at| *at = random.below(2 * lanes + 6) as u64);
            }
        }
        Inputs { state, rows, uniforms, per_step, held, steps }
    }

    /// The state after a kernel has made the steps.
    pub(crate) fn run(&self, kernel: &dyn Kernel<T>, scratch: &mut Vec<T>) -> Vec<T> {
        let mut state = self.state.clone();
        let pool = kernel.pool(&self.uniforms);
        kernel.run(
            &mut Tile {
                state: &mut state,
                rows: &self.rows,
                pool: &pool,
                steps: self.steps,
                per_step: &self.per_step,
                held: &self.held,
            },
            scratch,
        );
        state
    }
}

/// A shape of a level and a width; of few vectors if the operations are so many that all take long to write.
pub(crate) fn shape(random: &mut Random, operations: usize, level: Level, width: usize) -> Shape {
    let most = if operations < 1000 { 12 } else { 3 };
    let block_vectors = if random.once_in(2) { 1 + random.below(2) } else { 1 + random.below(most) };
    let blocks = if random.once_in(2) { 1 } else { 1 + random.below(5) };
    let interleaved = if random.once_in(3) { 1 + random.below(block_vectors) } else { block_vectors };
    Shape { level, bytes: 8, width, block_vectors, interleaved, blocks, resident: random.once_in(2) }
}

/// Whether two numbers have the same bits, or both are NaN.
pub(crate) fn same<T: Real>(a: T, b: T) -> bool {
    a.pattern() == b.pattern() || (a.wide().is_nan() && b.wide().is_nan())
}

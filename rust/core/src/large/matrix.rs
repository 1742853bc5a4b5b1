//! The transition-matrix form (Appendix B) of a large system: s ← P·s + Σ Q·u, one member at a time.

use std::sync::atomic::Ordering::Relaxed;

use super::{
    inputs::Inputs,
    panels::{Panels, filled},
};
use crate::{
    aligned::Aligned,
    group::Group,
    isa::{Level, Task, with_isa},
    model::{spec::Spec, system::Shape, window},
    stage::{Clock, Stop},
    step::key::StepKind,
};

/// A member of a linear map.
pub struct Matrix {
    shape: Shape,
    level: Level,
    clock: Clock,
    /// Times of the inputs, as fractions of a step.
    nodes: Vec<f64>,
    pq: Panels,
    inputs: Inputs,
    /// How many inputs there are.
    count: usize,
    /// Whether the method carries something in place of v.
    carries: bool,
    /// Whether products are added by fused multiply-adds.
    fused: bool,
    /// The inputs at all nodes.
    u: Vec<f64>,
    state: Aligned,
    next: Aligned,
    /// Whether the parameters taken for the first member hold for all.
    prepared: bool,
    stop: Stop,
}

impl Matrix {
    /// The matrix form, with inputs at its times.
    pub fn new(spec: &Spec, shape: Shape, how: &StepKind, level: Level, clock: &Clock) -> Matrix {
        let (nodes, fused) = match how {
            StepKind::Matrix { nodes, fused } => (nodes.iter().map(|bits| f64::from_bits(*bits)).collect(), *fused),
            // Not the matrix form: never called.
            StepKind::Method { .. } | StepKind::Attempts { .. } | StepKind::Step(_) => (Vec::new(), false),
        };
        let (n, count) = (shape.v + shape.y, spec.signature.whole("inputs"));
        Matrix {
            shape,
            level,
            clock: *clock,
            pq: Panels::new(0, 0, |_, _| 0.0),
            inputs: Inputs::default(),
            count,
            carries: spec.signature.whole("carries") > 0,
            fused,
            u: vec![0.0; nodes.len() * count],
            nodes,
            state: Aligned::new(filled(n)),
            next: Aligned::new(filled(n)),
            prepared: false,
            stop: Stop::default(),
        }
    }
}

struct Steps<'a> {
    of: &'a mut Matrix,
    k: i64,
    n: i64,
}

impl Task for Steps<'_> {
    #[inline(always)]
    fn run(self) {
        let Matrix { shape, clock, nodes, pq, inputs, count, carries, fused, u, state, next, stop, .. } = self.of;
        for k in self.k..self.k + self.n {
            let t = clock.at(k);
            let window = window::of_step(t, clock.h, *carries);
            for (node, u) in nodes.iter().zip(u.chunks_exact_mut((*count).max(1))) {
                inputs.fill(t + node * clock.h, Some(window), u);
            }
            if stop.load(Relaxed) {
                return;
            }
            let parts = [&state[..shape.v + shape.y], u, &[]];
            if *fused {
                pq.times_fused(parts, next, stop);
            } else {
                pq.times(parts, next, stop);
            }
            std::mem::swap(state, next);
        }
    }
}

impl Group for Matrix {
    fn lanes(&self) -> usize {
        1
    }

    fn prepare(&mut self, spec: &Spec, first: usize, _count: usize) {
        if std::mem::replace(&mut self.prepared, spec.is_common()) {
            return;
        }
        let n = self.shape.v + self.shape.y;
        let (p, q) = (spec.signature.place("p").unwrap_or(0), spec.signature.place("q").unwrap_or(0));
        // P by rows; Q by columns, nodes and inputs, each with a number for every row.
        let place = |i: usize, j: usize| if j < n { p + i * n + j } else { q + (j - n) * n + i };
        self.pq = Panels::new(n, n + self.u.len(), |i, j| spec.rows[place(i, j)].at(first));
        self.inputs = Inputs::new(spec, first);
    }

    fn set_stop_flag(&mut self, stop: &Stop) {
        self.stop = Stop::clone(stop);
    }

    fn slots(&self) -> (&[f64], &[f64]) {
        self.state[..self.shape.v + self.shape.y].split_at(self.shape.v)
    }

    fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        self.state[..self.shape.v + self.shape.y].split_at_mut(self.shape.v)
    }

    // The caller converts between velocities and the carry.
    fn start(&mut self, _k: i64) {}

    fn advance(&mut self, k: i64, n: i64) {
        with_isa!(self.level, |isa| isa.run(Steps { of: self, k, n }));
    }

    fn finish(&mut self, _k: i64) {}

    fn recorded(&self) -> usize {
        0
    }

    fn record(&mut self, _rows: &mut [f64]) {}

    fn tally(&self) -> &[f64] {
        &[]
    }

    fn tally_mut(&mut self) -> &mut [f64] {
        &mut []
    }
}

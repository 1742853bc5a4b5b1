//! The transition-matrix form (Appendix B) of a large system: s ← P·s + Σ Q·u, one member at a time.

use super::{inputs::Inputs, panels::Panels};
use crate::{
    isa::Level,
    run::{group::Group, stage::Clock},
    spec::Spec,
    system::Shape,
    trace::How,
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
    /// The state and the inputs at all nodes.
    column: Vec<f64>,
    /// Whether what was taken from the first member serves all.
    prepared: bool,
}

impl Matrix {
    /// With inputs at the times of the form.
    pub fn new(spec: &Spec, shape: Shape, how: &How, level: Level, clock: &Clock) -> Matrix {
        let nodes: Vec<f64> = match how {
            How::Matrix { nodes } => nodes.iter().map(|bits| f64::from_bits(*bits)).collect(),
            How::Method { .. } | How::Attempts { .. } => Vec::new(), // no matrix form, and nobody asks
        };
        let (n, count) = (shape.v + shape.y, spec.given.whole("inputs"));
        Matrix {
            shape,
            level,
            clock: *clock,
            pq: Panels::new(0, 0, |_, _| 0.0),
            inputs: Inputs::default(),
            count,
            column: vec![0.0; n + nodes.len() * count],
            nodes,
            prepared: false,
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
        let (p, q) = (spec.given.place("p").unwrap_or(0), spec.given.place("q").unwrap_or(0));
        // P by rows; Q by columns, nodes and inputs, each with a number for every row.
        let place = |i: usize, j: usize| if j < n { p + i * n + j } else { q + (j - n) * n + i };
        self.pq = Panels::new(n, self.column.len(), |i, j| spec.rows[place(i, j)].at(first));
        self.inputs = Inputs::new(spec, first);
    }

    fn slots(&self) -> (&[f64], &[f64]) {
        self.column[..self.shape.v + self.shape.y].split_at(self.shape.v)
    }

    fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        self.column[..self.shape.v + self.shape.y].split_at_mut(self.shape.v)
    }

    // What a method carries is its own affair: the caller starts and finishes.
    fn start(&mut self, _k: i64) {}

    fn advance(&mut self, k: i64, n: i64) {
        let numbers = self.shape.v + self.shape.y;
        for k in k..k + n {
            let t = self.clock.at(k);
            for (node, u) in self.nodes.iter().zip(self.column[numbers..].chunks_exact_mut(self.count.max(1))) {
                self.inputs.fill(t + node * self.clock.h, u);
            }
            let made = self.pq.times(self.level, &self.column);
            self.column[..numbers].copy_from_slice(made);
        }
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

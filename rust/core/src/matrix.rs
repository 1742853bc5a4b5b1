//! The transition-matrix form (Appendix B): s ← P·s + Σ Q·u, for any linear system and any method.
//!
//! A step of a linear system is a linear map of its state s = (v slot, y) and of its inputs u at the method's nodes. Whoever
//! calls this finds P and Q by stepping unit vectors, so no method is written a second time. Sums run in the order of the
//! columns, first over s, then over the nodes and, for each, over the inputs.
//!
//! Sizes: n. Options: `sine` or `held` for each input. Parameters: P by rows, then Q by nodes, inputs and rows, then
//! amplitude, frequency and phase of each sinusoid. Tables: the held inputs. Nodes: fractions of the step.

use crate::{
    group::{Clock, Group, Spec, Width},
    isa::{Isa, Task, with_isa},
    panels::Panels,
    rows::{LANES, Rows, lanes, lanes_mut, zeros},
    signal::Input,
};

struct Map<const L: usize> {
    pq: Panels<L>,
    inputs: Vec<Input<L>>,
    u: Rows<L>,
    next: Rows<L>,
}

struct Matrix<I, const L: usize> {
    clock: Clock,
    isa: I,
    nodes: Vec<f64>,
    v_rows: usize,
    state: Rows<L>,
    map: Map<L>,
}

struct Steps<'a, const L: usize> {
    clock: Clock,
    k: i64,
    n: i64,
    nodes: &'a [f64],
    state: &'a mut Rows<L>,
    map: &'a mut Map<L>,
}

impl<const L: usize> Task for Steps<'_, L> {
    #[inline(always)]
    fn run(self) {
        let Map { pq, inputs, u, next } = self.map;
        for k in self.k..self.k + self.n {
            let t = self.clock.at(k);
            for (node, u) in self.nodes.iter().zip(lanes_mut(u).chunks_exact_mut(inputs.len().max(1))) {
                Input::fill_all(inputs, t + node * self.clock.h, u);
            }
            pq.times([lanes(self.state), lanes(u), &[]], lanes_mut(next));
            std::mem::swap(self.state, next);
        }
    }
}

impl<I: Isa, const L: usize> Group for Matrix<I, L> {
    fn lanes(&self) -> usize {
        L
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        let member = |l: usize| first + l.min(count - 1);
        let (n, columns) = (self.map.next.ncols(), self.map.u.ncols());
        self.map.pq = Panels::new(n, n + columns, |i, j| {
            let place = if j < n { i * n + j } else { j * n + i }; // P by rows, then Q by columns
            std::array::from_fn(|l| spec.at(place, member(l)))
        });
        self.map.inputs = Input::all(spec, n * (n + columns), member);
    }

    fn slots(&self) -> (&[f64], &[f64]) {
        self.state.as_slice().split_at(self.v_rows * L)
    }

    fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        self.state.as_mut_slice().split_at_mut(self.v_rows * L)
    }

    // What a method carries is its own affair: the caller starts and finishes.
    fn start(&mut self, _k: i64) {}

    fn advance(&mut self, k: i64, n: i64) {
        self.isa.run(Steps { clock: self.clock, k, n, nodes: &self.nodes, state: &mut self.state, map: &mut self.map });
    }

    fn finish(&mut self, _k: i64) {}
}

fn boxed<I: Isa, const L: usize>(isa: I, spec: &Spec, nodes: &[f64], clock: &Clock, v_rows: usize) -> Box<dyn Group> {
    let n = spec.size(0);
    let columns = spec.options.len() * nodes.len();
    let map = Map { pq: Panels::new(0, 0, |_, _| [0.0; L]), inputs: Vec::new(), u: zeros(columns), next: zeros(n) };
    Box::new(Matrix::<I, L> { clock: *clock, isa, nodes: nodes.to_vec(), v_rows, state: zeros(n), map })
}

fn at_level<const L: usize>(spec: &Spec, nodes: &[f64], clock: &Clock, v_rows: usize) -> Box<dyn Group> {
    with_isa!(clock.level, |isa| boxed::<_, L>(isa, spec, nodes, clock, v_rows))
}

/// A group of linear maps of so many numbers as the spec's size says, the first `v_rows` of them in the v slot.
pub fn group(spec: &Spec, nodes: &[f64], clock: &Clock, v_rows: usize, width: Width) -> Box<dyn Group> {
    match width {
        Width::Wide => at_level::<LANES>(spec, nodes, clock, v_rows),
        _ => at_level::<1>(spec, nodes, clock, v_rows),
    }
}

//! The transition-matrix form (Appendix B): s ← P·s + Σ Q·u, for any linear system and any method.
//!
//! A step of a linear system is a linear map of its state s = (v slot, y) and of its inputs u at the method's nodes. Whoever
//! calls this finds P and Q by stepping unit vectors, so no method is written a second time. Sums run in the order of the
//! columns, first over s, then over the nodes and, for each, over the inputs.
//!
//! Options: `sine` or `held` for each input. Parameters: P by rows, then Q by nodes, inputs and rows, then
//! amplitude, frequency and phase of each sinusoid. Tables: the held inputs. Nodes: fractions of the step.

use crate::{
    group::{Clock, Group, Spec, Width},
    isa::{Isa, Task, with_isa},
    rows::{LANES, Rows, lanes, lanes_mut, zeros},
    signal::{Signal, Sine},
    tile::Samples,
};

enum Input<const L: usize> {
    Sine([Sine; L]),
    Held(Samples<L>),
}

struct Map<const L: usize> {
    p: Rows<L>,
    q: Rows<L>,
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
        let Map { p, q, inputs, u, next } = self.map;
        let size = self.state.ncols();
        for k in self.k..self.k + self.n {
            let t = self.clock.at(k);
            for (j, u) in lanes_mut(u).iter_mut().enumerate() {
                let at = t + self.nodes[j / inputs.len()] * self.clock.h;
                match &inputs[j % inputs.len()] {
                    Input::Sine(sines) => {
                        for l in 0..L {
                            u[l] = sines[l].at(at);
                        }
                    }
                    Input::Held(samples) => u.copy_from_slice(samples.view().at(at)),
                }
            }
            let s = lanes(self.state);
            for (i, next) in lanes_mut(next).iter_mut().enumerate() {
                let p = &lanes(p)[i * size..][..size];
                let mut sum = [0.0; L];
                for l in 0..L {
                    sum[l] = p[0][l] * s[0][l];
                }
                for (p, s) in p.iter().zip(s).skip(1) {
                    for l in 0..L {
                        sum[l] += p[l] * s[l];
                    }
                }
                for (j, u) in lanes(u).iter().enumerate() {
                    let q = &lanes(q)[j * size + i];
                    for l in 0..L {
                        sum[l] += q[l] * u[l];
                    }
                }
                *next = sum;
            }
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
        let mut next = 0;
        for rows in [&mut self.map.p, &mut self.map.q] {
            for row in lanes_mut(rows) {
                *row = std::array::from_fn(|l| spec.at(next, member(l)));
                next += 1;
            }
        }
        let mut tables = spec.tables.iter();
        let mut inputs = Vec::new();
        for kind in &spec.options {
            if *kind == "held"
                && let Some(table) = tables.next()
            {
                inputs.push(Input::Held(Samples::new(table, |_| 1.0, member)));
            } else {
                let p = |i: usize, l: usize| spec.at(next + i, member(l));
                inputs.push(Input::Sine(std::array::from_fn(|l| Sine { amplitude: p(0, l), omega: p(1, l), phase: p(2, l) })));
                next += 3;
            }
        }
        self.map.inputs = inputs;
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
    let n = spec.size;
    let columns = spec.options.len() * nodes.len();
    let map = Map { p: zeros(n * n), q: zeros(n * columns), inputs: Vec::new(), u: zeros(columns), next: zeros(n) };
    Box::new(Matrix::<I, L> { clock: *clock, isa, nodes: nodes.to_vec(), v_rows, state: zeros(n), map })
}

fn at_level<const L: usize>(spec: &Spec, nodes: &[f64], clock: &Clock, v_rows: usize) -> Box<dyn Group> {
    with_isa!(clock.level, |isa| boxed::<_, L>(isa, spec, nodes, clock, v_rows))
}

/// A group of linear maps of `spec.size` numbers, the first `v_rows` of them in the v slot.
pub fn group(spec: &Spec, nodes: &[f64], clock: &Clock, v_rows: usize, width: Width) -> Box<dyn Group> {
    match width {
        Width::Wide => at_level::<LANES>(spec, nodes, clock, v_rows),
        Width::Narrow => at_level::<1>(spec, nodes, clock, v_rows),
    }
}

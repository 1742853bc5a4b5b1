//! Explicit Runge-Kutta methods by their tableau, as the papers print them: each sum is a list of stages and their weights, summed
//! from the left, zeros left out. Stages count from 0.

use crate::{
    block::{Block, Work},
    system::System,
};

/// Stage 0: the increments at the start of the step.
#[inline(always)]
pub fn first<S: System>(s: &mut S, t: f64, v: &S::V, y: &S::Y, w: &mut Work<S>) {
    s.dv(t, v, y, &mut w.dv[0]);
    s.dy(t, v, y, &mut w.dy[0]);
}

/// A later stage: the increments at a time, and at the state that those before lead to.
#[inline(always)]
pub fn stage<S: System, const N: usize>(
    s: &mut S,
    at: f64,
    v: &S::V,
    y: &S::Y,
    w: &mut Work<S>,
    stage: usize,
    terms: [(usize, f64); N],
) {
    w.v.sum_weighted(v, &w.dv, terms);
    w.y.sum_weighted(y, &w.dy, terms);
    s.dv(at, &w.v, &w.y, &mut w.dv[stage]);
    s.dy(at, &w.v, &w.y, &mut w.dy[stage]);
}

/// The state goes on by the weighted increments.
#[inline(always)]
pub fn go_on<S: System, const N: usize>(v: &mut S::V, y: &mut S::Y, w: &Work<S>, terms: [(usize, f64); N]) {
    v.add_weighted(&w.dv, terms);
    y.add_weighted(&w.dy, terms);
}

/// An estimate of the error, into `w.v` and `w.y`.
#[inline(always)]
pub fn estimate<S: System, const N: usize>(w: &mut Work<S>, terms: [(usize, f64); N]) {
    w.v.set_weighted(&w.dv, terms);
    w.y.set_weighted(&w.dy, terms);
}

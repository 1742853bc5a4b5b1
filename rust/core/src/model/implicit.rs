//! The linear algebra of implicit methods: the Jacobian J of a system at the start of a step, and the solution of
//! (M − γhJ)·x = r, where M is the mass matrix of the system, or the unit matrix.
//!
//! `reference/implicit.py` has the same operations in the same order.

use std::ops::Range;

use nalgebra::DVector;

use super::{pivoting::Factors, system::System};
use crate::tape::{
    mass::Mass,
    number::{Derivatives, Number},
};

/// The derivatives of the rates at the start of a step, and the matrices that were factored.
pub(crate) struct Implicit<N: Number> {
    derivatives: Derivatives<N>,
    of_v: usize,
    /// Whether the rates of y do not depend on y, so that y follows from v.
    follows: bool,
    /// The mass matrix, if the system has one; it has no v then.
    mass: Option<Mass>,
    factored: Vec<(f64, Factors<N>)>,
}

impl<N: Number> Implicit<N> {
    /// Derives the rates of a system at a state; None for plain numbers, whose derivatives are not known.
    pub(crate) fn new(s: &dyn System<N>, t: N, h: N, v: &DVector<N>, y: &DVector<N>) -> Option<Implicit<N>> {
        let state: Vec<N> = v.iter().chain(y).copied().collect();
        let mut rates = || s.dv(t, v, y).iter().chain(&s.dy(t, v, y)).copied().collect();
        let tally = s.tally();
        let derivatives = N::derivatives(&state, t, h, &mut rates)?;
        if let Some(tally) = tally {
            s.set_tally(tally); // these rates push nothing
        }
        let of_v = v.len();
        let by_y = &derivatives.by_state[of_v..];
        let follows = of_v > 0 && !by_y.is_empty() && by_y.iter().all(|by| by[of_v..].iter().all(Option::is_none));
        Some(Implicit { derivatives, of_v, follows, mass: s.mass().cloned(), factored: Vec::new() })
    }

    /// γ·h times the derivative of a rate by a number of the state.
    fn entry(&self, gamma: f64, rate: usize, number: usize) -> Option<N> {
        self.derivatives.by_state[number][rate].map(|derivative| N::of(gamma) * derivative)
    }

    /// The entries of M in a row.
    fn mass(&self, row: usize, n: usize) -> Vec<Option<N>> {
        let mut entries = vec![None; n];
        match &self.mass {
            None => entries[row] = Some(N::of(1.0)),
            Some(mass) => mass.row(row).for_each(|(column, entry)| entries[column] = Some(N::of(entry))),
        }
        entries
    }

    /// The matrix of the unknowns: M − γhJ, or, where y follows from v, what is left of it for v.
    pub(crate) fn matrix(&self, gamma: f64) -> Vec<Vec<Option<N>>> {
        let (all, n) = (self.derivatives.by_state.len(), self.unknowns());
        let known: Vec<Vec<usize>> = (0..all).map(|rate| (0..all).filter(|k| self.has(rate, *k)).collect()).collect();
        let less = |entry: &mut Option<N>, term: Option<N>| {
            if let Some(term) = term {
                *entry = Some(entry.map_or(-term, |entry| entry - term));
            }
        };
        let row = |i: usize| {
            let mut row = self.mass(i, n);
            known[i].iter().filter(|j| **j < n).for_each(|j| less(&mut row[*j], self.entry(gamma, i, *j)));
            for &k in known[i].iter().filter(|k| **k >= n) {
                for &j in known[k].iter().filter(|j| **j < n) {
                    let by_way_of_y = || Some(self.entry(gamma, i, k)? * self.entry(gamma, k, j)?);
                    less(&mut row[j], by_way_of_y());
                }
            }
            row
        };
        (0..n).map(row).collect()
    }

    /// How many unknowns the equations have.
    pub(crate) fn unknowns(&self) -> usize {
        if self.follows { self.of_v } else { self.derivatives.by_state.len() }
    }

    /// Whether a rate depends on a number of the state.
    fn has(&self, rate: usize, number: usize) -> bool {
        self.derivatives.by_state[number][rate].is_some()
    }

    /// Where y follows from v: γ·h times the derivatives of rates of v by numbers of y, and of rates of y by numbers of v, by
    /// their places in the blocks.
    pub(crate) fn coupling(&self, gamma: f64) -> [Vec<(usize, usize, N)>; 2] {
        let (all, of_v) = (self.derivatives.by_state.len(), self.of_v);
        let between = |rates: Range<usize>, numbers: Range<usize>| {
            let (first_rate, first_number) = (rates.start, numbers.start);
            let entry = move |i: usize, j: usize| Some((i - first_rate, j - first_number, self.entry(gamma, i, j)?));
            rates.flat_map(|i| numbers.clone().filter_map(move |j| entry(i, j))).collect()
        };
        if self.follows { [between(0..of_v, of_v..all), between(of_v..all, 0..of_v)] } else { [Vec::new(), Vec::new()] }
    }

    /// x of (M − γhJ)·x = r, for both blocks.
    pub(crate) fn solve(&mut self, gamma: f64, [r_v, r_y]: [&DVector<N>; 2]) -> [DVector<N>; 2] {
        let place = match self.factored.iter().position(|(known, _)| known.to_bits() == gamma.to_bits()) {
            Some(place) => place,
            None => {
                self.factored.push((gamma, Factors::new(self.matrix(gamma))));
                self.factored.len() - 1
            }
        };
        let factors = &self.factored[place].1;
        let of_v = self.of_v;
        if !self.follows {
            let x = factors.solve(r_v.iter().chain(r_y).copied().collect());
            return [DVector::from_column_slice(&x[..of_v]), DVector::from_column_slice(&x[of_v..])];
        }
        let plus = |sum: N, entry: Option<N>, x: N| entry.map_or(sum, |entry| sum + entry * x);
        let right = |i: usize| {
            let terms = r_y.iter().enumerate();
            terms.fold(r_v[i], |sum, (k, r)| plus(sum, self.entry(gamma, i, of_v + k), *r))
        };
        let v = factors.solve((0..of_v).map(right).collect());
        let y = |k: usize| v.iter().enumerate().fold(r_y[k], |sum, (j, x)| plus(sum, self.entry(gamma, of_v + k, j), *x));
        let y = DVector::from_fn(r_y.len(), |k, _| y(k));
        [DVector::from_vec(v), y]
    }

    /// h times the derivatives of both rates by the time.
    pub(crate) fn by_time(&self, h: N) -> [DVector<N>; 2] {
        let by_time: Vec<N> = self.derivatives.by_time.iter().map(|rate| rate.map_or(N::of(0.0), |rate| h * rate)).collect();
        [DVector::from_column_slice(&by_time[..self.of_v]), DVector::from_column_slice(&by_time[self.of_v..])]
    }
}

//! Linear equations with any matrix: elimination with rows exchanged by the size of their entries, as the same operations for
//! every matrix.
//!
//! `reference/pivoting.py` has the same operations in the same order. `None` is an entry that is zero whatever the state is, and
//! its terms are left out. The order of the unknowns keeps such zeros: see `ordering.rs`.

use std::iter;

use super::ordering::Ordering;
use crate::tape::number::Number;

/// A number, or none where it is known to be zero.
type Entry<N> = Option<N>;

/// An exchange of two rows: by a comparison, or in any case.
enum Exchange<N: Number> {
    If(N::Truth),
    Always,
}

impl<N: Number> Exchange<N> {
    /// Both entries after the exchange.
    fn of(&self, a: Entry<N>, b: Entry<N>) -> [Entry<N>; 2] {
        match self {
            Exchange::Always => [b, a],
            Exchange::If(_) if a.is_none() && b.is_none() => [None, None],
            Exchange::If(truth) => {
                let [a, b] = [a, b].map(|entry| entry.unwrap_or_else(|| N::of(0.0)));
                [Some(N::choose(*truth, b, a)), Some(N::choose(*truth, a, b))]
            }
        }
    }
}

/// The factors of a matrix.
pub(crate) struct Factors<N: Number> {
    /// The unknowns, in the order of their elimination.
    order: Vec<usize>,
    /// For each unknown the exchanges of its row with a later one, and the multiples of it that these lose.
    exchanges: Vec<Vec<(usize, Exchange<N>)>>,
    below: Vec<Vec<(usize, N)>>,
    /// The rows, and the reciprocals of the entries on the diagonal.
    rows: Vec<Vec<Entry<N>>>,
    over: Vec<N>,
}

impl<N: Number> Factors<N> {
    /// Factors a matrix, by its rows. An unknown without a pivot has an infinite one in its place, or a NaN.
    pub(crate) fn new(mut rows: Vec<Vec<Entry<N>>>) -> Self {
        let n = rows.len();
        let columns = |row: &Vec<Entry<N>>| (0..n).filter(|column| row[*column].is_some()).collect();
        let order = Ordering::new(rows.iter().map(columns).collect()).order;
        let (mut all_exchanges, mut below, mut over) = (Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n));
        let mut left: Vec<usize> = (0..n).collect();
        for &k in &order {
            left.retain(|i| *i != k);
            let mut exchanges = Vec::new();
            for &i in &left {
                let exchange = match (rows[k][k], rows[i][k]) {
                    (_, None) => continue,
                    (None, Some(_)) => Exchange::Always,
                    (Some(a), Some(b)) => Exchange::If(magnitude(a).below(magnitude(b))),
                };
                for c in iter::once(k).chain(left.iter().copied()) {
                    [rows[k][c], rows[i][c]] = exchange.of(rows[k][c], rows[i][c]);
                }
                exchanges.push((i, exchange));
            }
            let reciprocal = N::of(1.0) / rows[k][k].unwrap_or_else(|| N::of(0.0));
            let mut factors = Vec::new();
            for &i in &left {
                let Some(entry) = rows[i][k] else { continue };
                let factor = entry * reciprocal;
                factors.push((i, factor));
                for &c in &left {
                    rows[i][c] = less(rows[i][c], factor, rows[k][c]);
                }
            }
            all_exchanges.push(exchanges);
            below.push(factors);
            over.push(reciprocal);
        }
        Factors { order, exchanges: all_exchanges, below, rows, over }
    }

    /// The unknowns, from the right-hand sides.
    pub(crate) fn solve(&self, mut x: Vec<N>) -> Vec<N> {
        for (place, &k) in self.order.iter().enumerate() {
            for (i, exchange) in &self.exchanges[place] {
                let [a, b] = exchange.of(Some(x[k]), Some(x[*i]));
                (x[k], x[*i]) = (a.unwrap_or(x[k]), b.unwrap_or(x[*i]));
            }
            for (i, factor) in &self.below[place] {
                let term = *factor * x[k];
                x[*i] -= term;
            }
        }
        for (place, &k) in self.order.iter().enumerate().rev() {
            for &c in self.order[place + 1..].iter().rev() {
                if let Some(entry) = self.rows[k][c] {
                    let term = entry * x[c];
                    x[k] -= term;
                }
            }
            x[k] *= self.over[place];
        }
        x
    }
}

fn magnitude<N: Number>(x: N) -> N {
    x.and_bits(u64::MAX >> 1)
}

fn less<N: Number>(entry: Entry<N>, factor: N, by: Entry<N>) -> Entry<N> {
    let Some(by) = by else { return entry };
    let term = factor * by;
    Some(entry.map_or(-term, |entry| entry - term))
}

//! Solves a few linear equations with a symmetric positive definite matrix by LDLᵀ, in a fixed order.
//!
//! There is no pivoting, so a step has no branch; such a matrix needs none. A matrix is passed as the rows of its lower triangle.
//! An entry `None` is zero in every state, and its terms are left out.

use crate::tape::number::Number;

/// L without its unit diagonal, and D.
pub(crate) struct Factors<N: Number> {
    /// The entries of each row left of the diagonal.
    below: Vec<Vec<Option<N>>>,
    pivots: Vec<N>,
}

impl<N: Number> Factors<N> {
    /// The factors of a matrix: `rows` has the entries left of the diagonal, `pivots` the diagonal.
    pub(crate) fn new(mut rows: Vec<Vec<Option<N>>>, mut pivots: Vec<N>) -> Self {
        let n = pivots.len();
        let mut below: Vec<Vec<Option<N>>> = (0..n).map(|i| vec![None; i]).collect();
        for j in 0..n {
            let touched: Vec<(usize, N)> = (j + 1..n).filter_map(|i| Some((i, rows[i][j]?))).collect();
            for (at, &(i, entry)) in touched.iter().enumerate() {
                let factor = entry / pivots[j];
                below[i][j] = Some(factor);
                for &(k, other) in &touched[..=at] {
                    let term = factor * other;
                    if k == i {
                        pivots[i] -= term;
                    } else {
                        rows[i][k] = Some(rows[i][k].map_or(-term, |entry| entry - term));
                    }
                }
            }
        }
        Factors { below, pivots }
    }

    /// Solves for right-hand sides.
    pub(crate) fn solve(&self, x: Vec<N>) -> Vec<N> {
        self.solve_some(x.into_iter().map(Some).collect()).into_iter().flatten().collect()
    }

    /// Solves for right-hand sides. Those that are `None` are zero in every state, and so are unknowns that are `None`.
    pub(crate) fn solve_some(&self, mut x: Vec<Option<N>>) -> Vec<Option<N>> {
        let n = x.len();
        let less = |x: &mut [Option<N>], from: usize, factor: Option<N>, known: usize| {
            if let (Some(factor), Some(known)) = (factor, x[known]) {
                let term = factor * known;
                x[from] = Some(x[from].map_or(-term, |x| x - term));
            }
        };
        for i in 0..n {
            for j in 0..i {
                less(&mut x, i, self.below[i][j], j);
            }
        }
        for j in (0..n).rev() {
            x[j] = x[j].map(|x| x / self.pivots[j]);
            for i in j + 1..n {
                less(&mut x, j, self.below[i][j], i);
            }
        }
        x
    }
}

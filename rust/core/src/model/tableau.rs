//! Explicit Runge-Kutta methods by their tableau, as the papers print them. Zeros are left out of the sums.

use super::program::{Block, Length, Rates, Time};

/// Nodes, one row of weights for each stage, and the weights of the result.
#[derive(Debug)]
pub struct Tableau {
    /// Times of the stages, as shares of the step.
    pub nodes: &'static [f64],
    /// Weights of the earlier increments in each stage.
    pub rows: &'static [&'static [f64]],
}

impl Tableau {
    /// The increments of both blocks, one stage after the other.
    pub(crate) fn stages(&self, s: Rates, t: Time, h: Length, v: Block, y: Block) -> Vec<(Block, Block)> {
        self.stages_after(Vec::with_capacity(self.nodes.len()), s, t, h, v, y)
    }

    /// The increments of all stages, after others that come before them and on which they may depend.
    pub(crate) fn stages_after(
        &self,
        mut found: Vec<(Block, Block)>,
        s: Rates,
        t: Time,
        h: Length,
        v: Block,
        y: Block,
    ) -> Vec<(Block, Block)> {
        for (&node, row) in self.nodes.iter().zip(self.rows) {
            let at = t + node * h;
            let (vi, yi) = if row.is_empty() { (v, y) } else { plus(v, y, row, &found) };
            found.push((s.dv(at, vi, yi), s.dy(at, vi, yi)));
        }
        found
    }
}

/// Both blocks and the weighted sums of their increments.
pub(crate) fn plus(v: Block, y: Block, weights: &[f64], increments: &[(Block, Block)]) -> (Block, Block) {
    let (dv, dy) = combined(weights, increments);
    (v + dv, y + dy)
}

/// The coefficients of the powers of θ in the state at the share θ of a step: a continuous extension of the method.
pub(crate) fn powers(weights: &[&[f64]], increments: &[(Block, Block)]) -> Vec<(Block, Block)> {
    weights.iter().map(|row| combined(row, increments)).collect()
}

/// The weighted sums of the increments of both blocks, from the left. Panics if all weights are zero.
pub(crate) fn combined(weights: &[f64], increments: &[(Block, Block)]) -> (Block, Block) {
    let mut terms = weights.iter().zip(increments).filter(|(c, _)| **c != 0.0).map(|(c, (dv, dy))| (*c * *dv, *c * *dy));
    let first = terms.next();
    assert!(first.is_some(), "weights of a tableau are all zero");
    terms.fold(first.unwrap_or(increments[0]), |(v, y), (dv, dy)| (v + dv, y + dy))
}

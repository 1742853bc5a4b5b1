//! Rosenbrock methods by their coefficients, as Hairer and Wanner print them (*Solving Ordinary Differential Equations II*,
//! IV.7).
//!
//! Stage i is the solution of (M − γhJ)·uᵢ = γ·(h·f(t + αᵢh, y + Σ aᵢⱼuⱼ) + M·Σ cᵢⱼuⱼ + dᵢ·h²·∂f/∂t), with the Jacobian J and
//! ∂f/∂t of the start of the step, and the mass matrix M of the system, or that of units.

use super::{
    program::{Block, Length, Rates, Time},
    tableau::{combined, plus},
};

/// The coefficients.
#[derive(Debug)]
pub(crate) struct Rosenbrock {
    /// γ
    pub gamma: f64,
    /// αᵢ
    pub nodes: &'static [f64],
    /// dᵢ
    pub by_time: &'static [f64],
    /// aᵢⱼ, a row for each stage.
    pub rows: &'static [&'static [f64]],
    /// cᵢⱼ
    pub of_solutions: &'static [&'static [f64]],
}

impl Rosenbrock {
    /// The solutions uᵢ of both blocks, one stage after the other.
    pub(crate) fn stages(&self, s: Rates, t: Time, h: Length, v: Block, y: Block) -> Vec<(Block, Block)> {
        let gamma = self.gamma;
        let mut solutions = Vec::with_capacity(self.nodes.len());
        for (i, (&node, row)) in self.nodes.iter().zip(self.rows).enumerate() {
            let at = t + node * h;
            let (vi, yi) = if row.is_empty() { (v, y) } else { plus(v, y, row, &solutions) };
            let (mut right_v, mut right_y) = (s.dv(at, vi, yi), s.dy(at, vi, yi));
            if !self.of_solutions[i].is_empty() {
                let (sum_v, sum_y) = s.mass(combined(self.of_solutions[i], &solutions));
                (right_v, right_y) = (right_v + sum_v, right_y + sum_y);
            }
            if self.by_time[i] != 0.0 {
                let (time_v, time_y) = s.by_time();
                (right_v, right_y) = (right_v + self.by_time[i] * time_v, right_y + self.by_time[i] * time_y);
            }
            solutions.push(s.implicit(gamma, (gamma * right_v, gamma * right_y)));
        }
        solutions
    }
}

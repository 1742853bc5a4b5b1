//! Newton's method for implicit steps, in a fixed number of passes, all with the Jacobian of the start of the step.
//!
//! An increment d of the state is sought for which a residual is zero. The first pass is exact for a linear system, and each
//! later one leaves of the error a share of the order of h², by which the Jacobian changes within the step. Where that share is
//! above 1, as in a stiff rope that turns, passes lead away: the increment of the first one is kept, which no stiffness makes
//! large.

use super::program::{Block, Rates};

/// How many passes there are.
pub(crate) const PASSES: u32 = 3;

/// The last correction is at most this share of the first, or the increment of the first pass is kept.
const CONVERGES: f64 = 0.25;

/// The increments of both blocks, from h times the rates of the step's start and of any other increment: the residual is those,
/// less the increment times the mass matrix, if the system has one.
pub(crate) fn solved(
    s: Rates,
    gamma: f64,
    at_zero: (Block, Block),
    rates: impl Fn(Block, Block) -> (Block, Block),
) -> (Block, Block) {
    let first = s.implicit(gamma, at_zero);
    let (all, last) = (1..PASSES).fold((first, first), |((dv, dy), _), _| {
        let ((rate_v, rate_y), (mass_v, mass_y)) = (rates(dv, dy), s.mass((dv, dy)));
        let more = s.implicit(gamma, (rate_v - mass_v, rate_y - mass_y));
        ((dv + more.0, dy + more.1), more)
    });
    s.if_shorter(last, (CONVERGES * first.0, CONVERGES * first.1), all, first)
}

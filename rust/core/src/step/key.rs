//! The key of a tape: all that it depends on.

use std::sync::Arc;

use super::pace::Acceptance;
use crate::{
    model::spec::Signature,
    tape::{equations::Equations, real::Precision},
};

/// The kind of step.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum StepKind {
    /// A method, by its name, started in its `choice`-th way.
    Method {
        /// The method's name.
        name: String,
        /// The number of its way to start.
        choice: usize,
    },
    /// Attempts at adaptive steps by a method.
    Attempts {
        /// The method's name.
        name: String,
        /// The order of its series, if it is one; 0 for that of a step of fixed length.
        order: u32,
        /// The conditions for a step to be accepted.
        acceptance: Acceptance,
        /// Whether the time of the run is that of the system, negated.
        backward: bool,
    },
    /// A step that is given as operations.
    Step(Arc<Equations>),
    /// The transition-matrix form (Appendix B): s ← P·s + Σ Q·u, with the inputs at these nodes, by the bits of each.
    Matrix {
        /// Times of the inputs, as fractions of a step, by their bits.
        nodes: Vec<u64>,
        /// Whether each product after the first is added by one fused multiply-add.
        fused: bool,
    },
}

/// The key of a tape.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct TapeKey {
    /// The names and sizes of the model's parameters.
    pub signature: Arc<Signature>,
    /// The kind of step.
    pub how: StepKind,
    /// Quantities that are recorded beside states.
    pub record: Vec<String>,
    /// Whether steps are computed with fused multiply-adds: see [`crate::tape::fuse`]. Recorded quantities are not.
    pub fused: bool,
    /// The numbers that steps are computed with.
    pub precision: Precision,
}

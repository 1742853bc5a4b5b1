//! Events: changes of sign of quantities along a motion. They are sought between the states of steps, and located within a
//! step by steps of other lengths from its start.

pub(crate) mod course;
pub mod evaluation;
pub mod found;
pub mod motion;
pub(crate) mod resets;
pub(crate) mod search;
pub(crate) mod watch;

pub(crate) use watch::any_may_change;
pub use watch::{Brackets, locate};

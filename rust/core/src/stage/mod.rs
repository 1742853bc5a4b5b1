//! Stages: cut tapes, ready to be run over tiles. The hot loop, and what is computed before it.

mod clock;
mod compiled;
mod machine;
mod prepared;

pub(crate) use self::compiled::{CompiledStage, Numbers};
pub use self::{
    clock::{Clock, Force},
    compiled::Stage,
    machine::{Machine, Stop},
    prepared::PreparedStage,
};

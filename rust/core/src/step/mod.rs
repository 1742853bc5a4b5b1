//! A model and a method become tapes.

mod attempts;
pub mod cache;
pub mod key;
mod leaves;
pub mod pace;
mod properties;
mod series_pace;
pub mod tapes;
pub mod trace;
mod watch;

pub(crate) use self::leaves::{block, ids, parameters};
pub(crate) use self::{leaves::BEGINS, properties::MAX_TAPE_OPERATIONS};

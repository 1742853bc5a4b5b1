//! A model and a method become tapes.

mod acceptance;
pub(crate) mod attempts;
pub mod cache;
mod controller;
pub mod key;
mod leaves;
pub mod pace;
mod properties;
pub(crate) mod series_pace;
mod sizes;
pub(crate) mod solving;
pub mod tapes;
pub mod trace;
pub(crate) mod watch;

pub(crate) use self::leaves::{block, ids, parameters};
pub(crate) use self::{leaves::own_times, properties::MAX_TAPE_OPERATIONS};

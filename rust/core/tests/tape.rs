//! The tape: the values and the listings of expressions.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

#[path = "tape/expressions.rs"]
mod expressions;
#[path = "kernels/random.rs"]
#[allow(dead_code, reason = "bodies are for kernels")]
mod random;
#[path = "tape/rules.rs"]
mod rules;

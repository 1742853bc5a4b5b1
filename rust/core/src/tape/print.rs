//! A tape as text.

use super::{Id, Op, real::Precision};

/// One operation, as a line of a listing.
pub fn line(id: Id, op: Op, precision: Precision) -> String {
    let text = match op {
        Op::Const(bits) if !precision.number(bits).is_nan() => format!("{:?}", precision.number(bits)),
        _ => op.text(),
    };
    format!("%{id} = {text}")
}

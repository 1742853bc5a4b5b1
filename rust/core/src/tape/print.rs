//! A tape as text.

use super::{Id, Op};

/// One operation, as a line of a listing.
pub fn line(id: Id, op: Op) -> String {
    use Op::*;
    let is = match op {
        State(i) => format!("state[{i}]"),
        Param(i) => format!("param[{i}]"),
        Step => "h".into(),
        Time => "t".into(),
        Const(bits) => match f64::from_bits(bits) {
            x if x.is_nan() => format!("bits {bits:#018x}"),
            x => format!("{x:?}"),
        },
        Sample(i, t) => format!("input[{i}] at %{t}"),
        Add(a, b) => format!("%{a} + %{b}"),
        Sub(a, b) => format!("%{a} - %{b}"),
        Mul(a, b) => format!("%{a} * %{b}"),
        Div(a, b) => format!("%{a} / %{b}"),
        Sqrt(a) => format!("sqrt %{a}"),
        Neg(a) => format!("- %{a}"),
        Floor(a) => format!("floor %{a}"),
        Less(a, b) => format!("%{a} < %{b}"),
        LessEqual(a, b) => format!("%{a} <= %{b}"),
        Equal(a, b) => format!("%{a} = %{b}"),
        Select(m, a, b) => format!("%{m} ? %{a} : %{b}"),
        And(a, b) => format!("%{a} and %{b}"),
        Or(a, b) => format!("%{a} or %{b}"),
        Xor(a, b) => format!("%{a} xor %{b}"),
        AddBits(a, b) => format!("%{a} plus %{b}"),
        ShiftUp(a, n) => format!("%{a} << {n}"),
        ShiftDown(a, n) => format!("%{a} >> {n}"),
        Copy(a) => format!("%{a}"),
        Row(i) => format!("row[{i}]"),
        Uniform(i) => format!("uniform[{i}]"),
        PerStep(i) => format!("step[{i}]"),
        Held(i) => format!("held[{i}]"),
        Gather(a) => format!("sample %{a}"),
    };
    format!("%{id} = {is}")
}

/// A listing of operations.
pub fn listing(ops: &[Op]) -> String {
    ops.iter().enumerate().map(|(id, op)| line(id as Id, *op) + "\n").collect()
}

//! A tape as text.

use super::{Id, Op, real::Precision};

/// One operation, as a line of a listing.
pub fn line(id: Id, op: Op, precision: Precision) -> String {
    use Op::*;
    let is = match op {
        State(i) => format!("state[{i}]"),
        Param(i) => format!("param[{i}]"),
        Step => "h".into(),
        Time => "t".into(),
        Const(bits) => match precision.number(bits) {
            x if x.is_nan() => format!("bits {bits:#018x}"),
            x => format!("{x:?}"),
        },
        Sample(i, t) => format!("input[{i}] at %{t}"),
        Add(a, b) => format!("%{a} + %{b}"),
        Sub(a, b) => format!("%{a} - %{b}"),
        Mul(a, b) => format!("%{a} * %{b}"),
        Div(a, b) => format!("%{a} / %{b}"),
        MulAdd(a, b, c) => format!("fused %{a} * %{b} + %{c}"),
        MulSub(a, b, c) => format!("fused %{a} * %{b} - %{c}"),
        SubMul(a, b, c) => format!("fused %{c} - %{a} * %{b}"),
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

/// The name of an operation, and its argument besides the operands: the index of a leaf, the bits of a constant, a number of
/// bits.
pub fn named(op: Op) -> (&'static str, u64) {
    use Op::*;
    match op {
        State(i) => ("state", i.into()),
        Param(i) => ("parameter", i.into()),
        Step => ("step", 0),
        Time => ("time", 0),
        Const(bits) => ("constant", bits),
        Sample(i, _) => ("sample", i.into()),
        Add(..) => ("add", 0),
        Sub(..) => ("subtract", 0),
        Mul(..) => ("multiply", 0),
        Div(..) => ("divide", 0),
        MulAdd(..) => ("multiply add", 0),
        MulSub(..) => ("multiply subtract", 0),
        SubMul(..) => ("subtract multiply", 0),
        Sqrt(_) => ("square root", 0),
        Neg(_) => ("negate", 0),
        Floor(_) => ("floor", 0),
        Less(..) => ("less", 0),
        LessEqual(..) => ("at most", 0),
        Equal(..) => ("equal", 0),
        Select(..) => ("choose", 0),
        And(..) => ("and", 0),
        Or(..) => ("or", 0),
        Xor(..) => ("exclusive or", 0),
        AddBits(..) => ("add bits", 0),
        ShiftUp(_, n) => ("shift up", n.into()),
        ShiftDown(_, n) => ("shift down", n.into()),
        Copy(_) => ("copy", 0),
        Row(i) => ("row", i.into()),
        Uniform(i) => ("uniform", i.into()),
        PerStep(i) => ("of the step", i.into()),
        Held(i) => ("held", i.into()),
        Gather(_) => ("gather", 0),
    }
}

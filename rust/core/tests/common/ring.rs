//! A body as long as is asked for, all of whose numbers wait at once in the order of an array.

use stepwell_core::tape::{Op, split::Body};

/// Masses on a ring, each pulled by the next and by the one before: roots, quotients, and numbers that are needed in other lanes.
pub(crate) fn ring(n: u32) -> Body {
    let mut ops: Vec<Op> = (0..2 * n).map(Op::State).collect();
    ops.push(Op::Row(0));
    let mut each = |op: &dyn Fn(u32) -> Op| {
        ops.extend((0..n).map(op));
        ops.len() as u32 - n
    };
    let (v, y, soft) = (0, n, 2 * n);
    let d = each(&|i| Op::Sub(y + (i + 1) % n, y + i));
    let squares = each(&|i| Op::Mul(d + i, d + i));
    let sums = each(&|i| Op::Add(squares + i, soft));
    let roots = each(&|i| Op::Sqrt(sums + i));
    let pulls = each(&|i| Op::Div(d + i, roots + i));
    let both = each(&|i| Op::Sub(pulls + i, pulls + (i + n - 1) % n));
    let v = each(&|i| Op::Add(v + i, both + i));
    let y = each(&|i| Op::Add(y + i, v + i));
    Body { ops, next: (v..v + n).chain(y..y + n).collect(), rows: 1, ..Body::default() }
}

//! What solving the equations of an implicit step takes, by the places of its matrix that may hold a number.

use super::leaves::{block, ids, parameters, time};
use crate::{
    error::Error,
    model::{
        around,
        ordering::{Columns, Ordering},
        program::Program,
        spec::Signature,
        system::Shape,
        systems::kind,
        window,
    },
    tape::{
        Op, Tape,
        number::{Number, Symbol, record},
    },
};

/// Operations of a step's Jacobian, of its factors and of its solutions.
pub(super) fn solving_operations(signature: &Signature, program: &Program, shape: Shape) -> Result<usize, Error> {
    let (kind, h) = (kind(signature)?, Symbol::new(Op::Step));
    let of_step = || window::of_step(time(signature), h, false);
    let rates = || {
        let p = parameters(signature, h);
        let (t, v, y) = (time(signature), block(0, shape.v), block(shape.v, shape.y));
        let system = around::wrap(&p, (kind.make)(&p), Symbol::of(0.0));
        ids([&system.dv(t, &v, &y), &system.dy(t, &v, &y)])
    };
    let (tape, rates) = record(Tape::default(), || window::over(signature, of_step, rates));
    // The numbers of the state on which each value depends; it has a derivative by each of them.
    let mut of_state: Vec<Columns> = Vec::with_capacity(tape.ops().len());
    for op in tape.ops() {
        let mut columns = Columns::default();
        if let Op::State(number) = op {
            columns.add(*number as usize);
        }
        let (operands, n) = op.operands();
        operands[..n].iter().for_each(|id| columns.join(&of_state[*id as usize]));
        of_state.push(columns);
    }
    let jacobian: Vec<&Columns> = rates.iter().map(|id| &of_state[*id as usize]).collect();
    let derivatives = of_state.iter().map(Columns::len).sum::<usize>();
    let entries = jacobian.iter().map(|row| row.len()).sum::<usize>();
    let follows = shape.v.min(shape.y) > 0 && jacobian[shape.v..].iter().all(|row| row.iter().all(|column| column < shape.v));
    let n = if follows { shape.v } else { shape.v + shape.y };
    let row = |i: usize| {
        let mut columns: Columns = jacobian[i].iter().filter(|column| *column < n).collect();
        columns.add(i);
        jacobian[i].iter().filter(|column| *column >= n).for_each(|column| columns.join(jacobian[column]));
        columns
    };
    let ordering = Ordering::new((0..n).map(row).collect());
    // A derivative takes a product and a sum; an entry of the matrix a product, and by way of y another and a difference.
    Ok(2 * derivatives + 3 * entries + ordering.factors + program.solutions() * ordering.solution)
}

//! The equations of an implicit step: what they take, and their numbers as a tape of their own, for systems whose step is too
//! long for one.

use super::{
    attempts::AttemptsOf,
    key::StepKind,
    leaves::{block, ids, length, parameters, time},
};
use crate::{
    error::Error,
    model::{
        around,
        implicit::Implicit,
        ordering::{Columns, Ordering},
        program::Program,
        spec::Signature,
        system::Shape,
        systems::kind,
        window,
    },
    tape::{
        Id, Op, Tape,
        number::{Number, Symbol, record},
        reserved::WINDOW_ENDS,
    },
};

/// Operations of a step's equations, and of solving them.
pub(super) fn operations(signature: &Signature, program: &Program, shape: Shape) -> Result<(usize, usize), Error> {
    let (kind, h) = (kind(signature)?, length(signature));
    let of_step = || window::of_step(time(signature), h, false);
    let rates = || {
        let p = parameters(signature, h);
        let (t, v, y) = (time(signature), block(0, shape.v), block(shape.v, shape.y));
        let system = around::wrap(&p, (kind.make)(&p), Symbol::of(0.0));
        ids([&system.dv(t, &v, &y), &system.dy(t, &v, &y)])
    };
    let (tape, rates) = record(Tape::default(), || window::over(signature, of_step, rates));
    // The numbers of the state on which each value depends; it has a derivative by each of them.
    let (mut of_state, mut derivatives): (Vec<Columns>, usize) = (Vec::with_capacity(tape.ops().len()), 0);
    for op in tape.ops() {
        let mut columns = Columns::default();
        if let Op::State(number) = op {
            columns.add(*number as usize);
        }
        let (operands, n) = op.operands();
        operands[..n].iter().for_each(|id| columns.join(&of_state[*id as usize]));
        let of_operands = operands[..n].iter().map(|id| of_state[*id as usize].len()).sum::<usize>();
        derivatives += match op {
            Op::Add(..) | Op::Sub(..) => of_operands - columns.len(), // a sum with what is zero takes none
            _ => 2 * columns.len(),
        };
        of_state.push(columns);
    }
    let jacobian: Vec<&Columns> = rates.iter().map(|id| &of_state[*id as usize]).collect();
    let entries = jacobian.iter().map(|row| row.len()).sum::<usize>();
    let follows = shape.v.min(shape.y) > 0 && jacobian[shape.v..].iter().all(|row| row.iter().all(|column| column < shape.v));
    let n = if follows { shape.v } else { shape.v + shape.y };
    let mass = signature.equations.as_ref().and_then(|equations| equations.mass.as_ref());
    let row = |i: usize| {
        let mut columns: Columns = jacobian[i].iter().filter(|column| *column < n).collect();
        match mass {
            None => columns.add(i),
            Some(mass) => mass.row(i).for_each(|(column, _)| columns.add(column)),
        }
        jacobian[i].iter().filter(|column| *column >= n).for_each(|column| columns.join(jacobian[column]));
        columns
    };
    let ordering = Ordering::new((0..n).map(row).collect());
    // An entry of the matrix takes a product, and by way of y another and a difference.
    Ok((derivatives + 3 * entries, ordering.factors + program.solutions() * ordering.solution))
}

/// Where the numbers of a step's equations stand behind the state and the step, in this order.
#[derive(Clone, Debug, Default)]
pub(crate) struct EquationPlaces {
    /// For each row of the matrix the columns that hold a number.
    pub rows: Vec<Columns>,
    /// The places in v and y of γ·h times the derivatives of v̇ by y, and in y and v of those of ẏ by v, where y follows from v.
    pub by_y: Vec<(usize, usize)>,
    /// See above.
    pub by_v: Vec<(usize, usize)>,
}

impl EquationPlaces {
    /// How many numbers there are, with the derivatives by the time, one for each of the state.
    pub(crate) fn numbers(&self, shape: Shape) -> usize {
        self.rows.iter().map(Columns::len).sum::<usize>() + self.by_y.len() + self.by_v.len() + shape.v + shape.y
    }
}

/// Traces the equations of a step with this γ. The state is v, y, the step, and a number for each result.
pub(crate) fn trace_equations(
    signature: &Signature,
    how: &StepKind,
    shape: Shape,
    gamma: f64,
) -> Result<((Tape, Vec<Id>), EquationPlaces), Error> {
    let kind = kind(signature)?;
    let first = shape.v + shape.y;
    let mut places = EquationPlaces::default();
    let traced = record(Tape::default(), || {
        let (v, y, h) = (block(0, shape.v), block(shape.v, shape.y), Symbol::new(Op::State(first as u32)));
        let seen = || WINDOW_ENDS.map(|end| Symbol::new(Op::Param(end)));
        let results = window::over(signature, seen, || {
            let p = parameters(signature, h);
            let system = match how {
                StepKind::Attempts { acceptance, .. } => {
                    AttemptsOf { kind, signature, shape, acceptance, backward: false }.rates(h)
                }
                _ => around::wrap(&p, (kind.make)(&p), Symbol::of(0.0)),
            };
            let Some(equations) = Implicit::new(system.as_ref(), time(signature), h, &v, &y) else { return Vec::new() };
            let matrix = equations.matrix(gamma);
            places.rows = matrix.iter().map(|row| (0..row.len()).filter(|column| row[*column].is_some()).collect()).collect();
            let [by_y, by_v] = equations.coupling(gamma);
            let places_of = |entries: &[(usize, usize, Symbol)]| entries.iter().map(|(i, j, _)| (*i, *j)).collect();
            (places.by_y, places.by_v) = (places_of(&by_y), places_of(&by_v));
            let mut results: Vec<Id> = matrix.iter().flatten().flatten().map(|entry| entry.0).collect();
            results.extend(by_y.iter().chain(&by_v).map(|(_, _, entry)| entry.0));
            results.extend(ids(&equations.by_time(h)));
            results
        });
        let mut next = ids([&v, &y]);
        next.push(h.0);
        next.extend(results);
        next
    });
    Ok((traced, places))
}

//! Properties of a step that are known before it is traced: sizes and approximate numbers of operations.

use super::{key::StepKind, solving};
use crate::{
    error::Error,
    model::{
        around::{self, contact, controls, sampled},
        methods::method,
        program::Program,
        spec::Signature,
        system::Shape,
        systems::{equations, kind, nbody},
    },
};

/// The most operations, approximately, of a step that is a single tape: tracing and writing take a microsecond each, and its code
/// of a megabyte stays in the second cache.
pub(crate) const MAX_TAPE_OPERATIONS: usize = 100_000;

/// The size of the blocks of a scene, or an error if its parameters are wrong or the method cannot step it.
pub(crate) fn shape(signature: &Signature, how: &StepKind) -> Result<Shape, Error> {
    match how {
        StepKind::Matrix { .. } => {
            let (n, v) = (signature.whole("n"), signature.whole("n_v").min(signature.whole("n")));
            Ok(Shape { v, y: n - v })
        }
        StepKind::Step(step) => equations::fit(step, signature),
        StepKind::Method { name, .. } | StepKind::Attempts { name, .. } => {
            around::fit(kind(signature)?, signature, method(name)?.as_ref())
        }
    }
}

/// Numbers of a recorded quantity.
fn quantity(signature: &Signature, name: &str) -> Result<usize, Error> {
    let known = (kind(signature)?.quantities)(signature);
    let found = known.iter().find(|(known, _)| *known == name);
    found
        .map(|(_, numbers)| *numbers)
        .or_else(|| sampled::sets(signature, name))
        .ok_or_else(|| Error::Options { system: signature.system.clone(), options: format!("record {name}") })
}

/// How many numbers are recorded in all.
pub(crate) fn recorded(signature: &Signature, names: &[String]) -> Result<usize, Error> {
    names.iter().try_fold(0, |sum, name| Ok(sum + quantity(signature, name)?))
}

/// Approximate numbers of operations.
pub(super) struct Operations {
    pub rates: usize,
    pub step: usize,
    /// Operations of the equations of an implicit step, from the state.
    pub equations: usize,
}

/// Approximate numbers of operations of the rates of a scene and of a step.
pub(super) fn operations(signature: &Signature, how: &StepKind, shape: Shape) -> Result<Operations, Error> {
    let mut equations = 0;
    let (rates, step) = match how {
        StepKind::Matrix { nodes, .. } => {
            let n = shape.v + shape.y;
            let products = n * (n + signature.whole("inputs") * nodes.len());
            (2 * products, 2 * products)
        }
        StepKind::Step(step) => (step.operations(), step.operations()),
        StepKind::Method { name, .. } | StepKind::Attempts { name, .. } => {
            let rates = (kind(signature)?.operations)(signature);
            let method = method(name)?;
            let attempt = if matches!(how, StepKind::Attempts { .. }) { method.attempt() } else { None };
            // Potentials take as long as forces, and are found at the end of a step, too, where a projection asks for them.
            let controls = if controls::is_given(signature) { 2 } else { 1 };
            let contacts = contact::operations(signature, shape);
            let program = attempt.unwrap_or_else(|| method.program());
            // The coefficient k of a product is a sum of k + 1 products.
            let order = match how {
                StepKind::Attempts { order, .. } if *order > 0 && program.series_order() > 0 => *order as usize,
                _ => program.series_order() as usize,
            };
            let evaluations = if order > 0 { order * (order + 1) / 2 } else { program.evaluations() };
            let mut solving = 0;
            if program.is_implicit() {
                // Of a full matrix; where ẏ is v times a number, only v is solved for. A column of the Jacobian takes about as
                // long as the rates. Elimination has two choices and two operations for each of n³/3 entries, a solution three
                // for n².
                let n = if shape.v == shape.y { shape.v } else { shape.v + shape.y };
                equations = rates * n;
                solving = 4 * n * n * n / 3 + 3 * n * n * program.solutions();
                if equations + solving > MAX_IMPLICIT_TAPE_OPERATIONS && rates <= MAX_TAPE_OPERATIONS {
                    (equations, solving) = solving::operations(signature, program, shape)?;
                }
                solving += equations;
            }
            // A solution of Kepler's equation and the changes of coordinates around it take some 350 operations a body.
            let drifts = if splits(signature, program) { 350 * signature.count("masses") } else { 0 };
            (controls * rates, controls * rates * evaluations + contacts + solving + drifts)
        }
    };
    Ok(Operations { rates, step, equations })
}

/// Whether steps are made by derivatives of the rates: by a series of the solution, or by solving equations.
pub(super) fn has_derivatives(how: &StepKind) -> Result<bool, Error> {
    of_method(how, Program::has_derivatives)
}

/// Whether they are made by a splitting that the system has, so that they are one tape.
pub(super) fn has_splitting(signature: &Signature, how: &StepKind) -> Result<bool, Error> {
    of_method(how, |program| splits(signature, program))
}

fn splits(signature: &Signature, program: &Program) -> bool {
    program.splits() && nbody::splits(signature)
}

/// Whether they are made by a series of the solution.
pub(super) fn has_series(how: &StepKind) -> Result<bool, Error> {
    of_method(how, |program| program.series_order() > 0)
}

fn of_method(how: &StepKind, holds: impl Fn(&Program) -> bool) -> Result<bool, Error> {
    Ok(match how {
        StepKind::Method { name, .. } | StepKind::Attempts { name, .. } => holds(method(name)?.program()),
        StepKind::Step(_) | StepKind::Matrix { .. } => false,
    })
}

/// The most operations of a step that solves equations, or of these equations alone: to trace and compile this many takes some
/// three seconds.
pub(super) const MAX_IMPLICIT_OPERATIONS: usize = 500_000;

/// The most operations of a step that solves equations and is one tape, for however few steps, though it might be solved over
/// rows.
pub(super) const MAX_IMPLICIT_TAPE_OPERATIONS: usize = 20_000;

/// The most unknowns of equations: their matrix is kept as a whole.
pub(super) const MAX_UNKNOWNS: usize = 4096;

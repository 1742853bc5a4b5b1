//! The parts around a system: each is a system that wraps another, or acts on the state after a step.
//!
//! `parts` lists them from the inside out. A new kind is a file here and a line there; see docs/developing/adding.md.

pub mod contact;
pub mod controls;
pub mod force;
pub(crate) mod friction;
mod part;
pub(crate) mod sampled;

use self::part::{Attempts, Part};
use super::{
    method::Needs,
    methods::Method,
    spec::{Parameters, Signature},
    system::{Kind, Shape, System},
};
use crate::{error::Error, tape::number::Number};

/// All kinds, from the inside out: friction resists all other forces.
pub(crate) fn parts<N: Number>() -> Vec<Part<N>> {
    vec![
        contact::part(),
        controls::part(),
        force::part(),
        friction::part(),
        sampled::part(), //
    ]
}

/// The size of the blocks, or an error if the parameters are wrong or the method cannot step the system.
///
/// A system that passes this check can be made and stepped.
pub fn fit(kind: &Kind, signature: &Signature, method: &Method) -> Result<Shape, Error> {
    let shape = (kind.shape)(signature)?;
    if signature.equations.as_ref().is_some_and(|equations| equations.mass.is_some()) && !method.program().is_implicit() {
        return Err(Error::MassMatrix { method: method.name });
    }
    let mut term = (kind.velocity_term)(signature);
    for part in parts::<f64>().iter().filter(|part| (part.is_given)(signature)) {
        (part.check)(kind, signature, shape)?;
        term = term.or((part.velocity_term)(signature, method));
    }
    match term {
        Some(term) if method.needs == Needs::Acceleration => {
            Err(Error::VelocityDependent { method: method.name, system: kind.name, term })
        }
        _ => Ok(shape),
    }
}

/// An error if something is given that works with steps of fixed length only.
pub(crate) fn only_fixed(signature: &Signature) -> Result<(), Error> {
    match parts::<f64>().iter().find(|part| (part.is_given)(signature) && (part.is_only_fixed)(signature)) {
        None => Ok(()),
        Some(part) => {
            Err(Error::Options { system: signature.system.clone(), options: format!("{}, with adaptive steps", part.name) })
        }
    }
}

/// Whether the whole step of a system has to be one tape.
pub(crate) fn is_one_tape(signature: &Signature) -> bool {
    parts::<f64>().iter().any(|part| !part.has_rows && (part.is_given)(signature))
}

fn wrap_in<N: Number>(
    p: &Parameters<N>,
    system: Box<dyn System<N>>,
    tally: N,
    which: impl Fn(&Part<N>) -> bool,
) -> Box<dyn System<N>> {
    let given = parts().into_iter().filter(|part| which(part) && (part.is_given)(p.signature));
    given.fold(system, |system, part| (part.wrap)(p, system, tally))
}

/// A system with all that is given around it. The tally starts from this number: h times the energy that control or projection
/// added.
pub fn wrap<N: Number>(p: &Parameters<N>, system: Box<dyn System<N>>, tally: N) -> Box<dyn System<N>> {
    wrap_in(p, system, tally, |_| true)
}

/// A system with the parts that attempts have in the rates for a step of 1.
pub(crate) fn wrap_scaled<N: Number>(p: &Parameters<N>, system: Box<dyn System<N>>) -> Box<dyn System<N>> {
    wrap_in(p, system, N::of(0.0), |part| part.attempts == Attempts::Scaled)
}

/// A system, as `wrap_scaled` returns it, with what is around it but forces, which attempts add to rates that are stretched
/// already.
pub(crate) fn wrap_without_forces<N: Number>(p: &Parameters<N>, system: Box<dyn System<N>>, tally: N) -> Box<dyn System<N>> {
    wrap_in(p, system, tally, |part| part.attempts == Attempts::Other)
}

/// Whether there are any of these forces.
pub(crate) fn has_forces(signature: &Signature) -> bool {
    parts::<f64>().iter().any(|part| part.attempts == Attempts::Added && (part.is_given)(signature))
}

/// Rates with these forces.
pub(crate) fn wrap_in_forces<N: Number>(p: &Parameters<N>, rates: Box<dyn System<N>>) -> Box<dyn System<N>> {
    wrap_in(p, rates, N::of(0.0), |part| part.attempts == Attempts::Added)
}

/// A system as a method's start and finish see it: with surfaces, forces and friction.
pub(crate) fn wrap_for_carry<N: Number>(p: &Parameters<N>, system: Box<dyn System<N>>) -> Box<dyn System<N>> {
    wrap_in(p, system, N::of(0.0), |part| part.is_for_carry)
}

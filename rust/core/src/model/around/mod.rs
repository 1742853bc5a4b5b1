//! What is around a system. Each part is a system that wraps another, or acts on the state after a step.
//!
//! From the inside out: springs of surfaces ([`contact`]), control or projection ([`controls`]), a force from outside
//! ([`force`]), and friction (`friction`), which resists all other forces.

pub mod contact;
pub mod controls;
pub mod force;
pub(crate) mod friction;

use super::{
    method::{Needs, Record},
    spec::{Parameters, Signature},
    system::{Kind, Shape, System},
};
use crate::{error::Error, tape::number::Number};

/// The size of the blocks, or an error if the parameters are wrong or the method cannot step the system.
///
/// A system that passes this check can be made and stepped.
pub fn fit(kind: &Kind, signature: &Signature, method: &Record) -> Result<Shape, Error> {
    let shape = (kind.shape)(signature)?;
    force::check(signature, shape)?;
    friction::check(signature)?;
    controls::check(kind, signature)?;
    contact::check(signature, shape)?;
    if contact::is_given(signature) && controls::is_given(signature) {
        return Err(signature.unknown("control"));
    }
    // What a method carries in place of v would have to change with v.
    let apart = controls::is_after_the_step(signature) && method.carry.is_none();
    let around = [(friction::is_given(signature), "friction"), (controls::is_given(signature) && !apart, "energy control")];
    let term = (kind.velocity_term)(signature).or(around.into_iter().find_map(|(is_given, term)| is_given.then_some(term)));
    match term {
        Some(term) if method.needs == Needs::Acceleration => {
            Err(Error::VelocityDependent { method: method.name, system: kind.name, term })
        }
        _ => Ok(shape),
    }
}

/// An error if something is given that goes with steps of fixed length only.
pub(crate) fn only_fixed(signature: &Signature) -> Result<(), Error> {
    match signature.count(friction::NAME) {
        0 => Ok(()),
        _ => {
            Err(Error::Options { system: signature.system.clone(), options: format!("{}, with adaptive steps", friction::NAME) })
        }
    }
}

/// A system with all that is given around it. The tally starts from this number: h times the energy that control or projection
/// added.
pub fn wrap<N: Number>(p: &Parameters<N>, system: Box<dyn System<N>>, tally: N) -> Box<dyn System<N>> {
    friction::wrap(p, force::wrap(p, wrap_below_force(p, system, tally)))
}

/// A system with what is around it below the force from outside, which attempts add to rates that are stretched already.
pub(crate) fn wrap_below_force<N: Number>(p: &Parameters<N>, system: Box<dyn System<N>>, tally: N) -> Box<dyn System<N>> {
    controls::wrap(p, contact::wrap(p, system), tally)
}

/// A system with surfaces and the force from outside: what a method's start and finish see.
pub(crate) fn wrap_for_carry<N: Number>(p: &Parameters<N>, system: Box<dyn System<N>>) -> Box<dyn System<N>> {
    force::wrap(p, contact::wrap(p, system))
}

//! The description of a kind of part.

use crate::{
    error::Error,
    model::{
        methods::Method,
        spec::{Parameters, Signature},
        system::{Kind, Shape, System},
    },
    tape::number::Number,
};

/// A kind of part. A system has it if parameters of its names are given.
pub(crate) struct Part<N: Number> {
    /// The name that is reported where it does not work with something.
    pub name: &'static str,
    /// Whether a system has it.
    pub is_given: fn(&Signature) -> bool,
    /// An error if its parameters are wrong, or if it does not work with the system or with another part.
    pub check: fn(&Kind, &Signature, Shape) -> Result<(), Error>,
    /// The term of it that depends on the velocity, if there is one: methods that need an acceleration refuse it.
    pub velocity_term: fn(&Signature, &Method) -> Option<&'static str>,
    /// Where attempts at adaptive steps have it.
    pub attempts: Attempts,
    /// Whether a method's start and finish see it.
    pub is_for_carry: bool,
    /// Whether it works with steps of fixed length only, as its parameters are.
    pub is_only_fixed: fn(&Signature) -> bool,
    /// Whether `large/` has it over rows. Otherwise the whole step of a system with it is one tape.
    pub has_rows: bool,
    /// The system with the part around it. The tally starts from the number: h times the energy that a control added.
    pub wrap: Wrap<N>,
}

/// Where attempts at adaptive steps, whose length is not known before, have a part.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Attempts {
    /// In the rates for a step of 1, which are multiplied by the step.
    Scaled,
    /// Added to the rates after that, for the step.
    Added,
    /// Around all of it: it acts on the state after the step, or on velocities.
    Other,
}

/// Puts a part around a system.
pub(crate) type Wrap<N> = fn(&Parameters<N>, Box<dyn System<N>>, N) -> Box<dyn System<N>>;

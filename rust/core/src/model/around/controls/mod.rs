//! Controls and projections, which hold the energy near a target (§12, Appendix D).
//!
//! A *control* is a push −g·v on the velocities. It is added to the increment h·v̇ in every stage, so it works with every method
//! in whose stages v and y belong to one time; with others it comes between steps. A *projection* returns the state to the target
//! energy after the step. Both wrap any system that has an energy, and are a system themselves. Energies are scaled to the step,
//! as everything is.
//!
//! Parameters: the word `control` is `energy` or `projection`. A control has the word `control.form`, the numbers `control.gain`
//! and `control.target`, and the word `control.when`, which is `between` if it acts between steps. A projection has the word
//! `control.way` and the number `control.target`.

pub(crate) mod energy;
pub(crate) mod projection;

use self::energy::is_between;
use super::part::{Attempts, Part};
use crate::{
    error::Error,
    model::{
        spec::Signature,
        system::{Kind, Shape},
    },
    tape::number::Number,
};

/// Whether a system has a control or a projection.
pub(crate) fn is_given(signature: &Signature) -> bool {
    !signature.word("control").is_empty()
}

/// Whether it is a control that acts in the stages of a step.
pub fn pushes(signature: &Signature) -> bool {
    signature.word("control") == "energy" && !is_between(signature)
}

/// Whether it acts only on the state after a step.
pub(crate) fn is_after_the_step(signature: &Signature) -> bool {
    signature.word("control") == "projection" || is_between(signature)
}

/// Controls and projections as a part around a system.
pub(crate) fn part<N: Number>() -> Part<N> {
    Part {
        name: "control",
        is_given,
        check,
        // What a method carries in place of v would have to change with v.
        velocity_term: |signature, method| {
            let is_apart = is_after_the_step(signature) && !method.carries;
            (!is_apart).then_some("energy control")
        },
        attempts: Attempts::Other,
        is_for_carry: false,
        is_only_fixed: |_| false,
        has_rows: true,
        wrap: |p, system, tally| match p.signature.word("control") {
            "energy" => Box::new(energy::Controlled::new(p, system, tally)),
            _ => Box::new(projection::Projected::new(p, system, tally)),
        },
    }
}

/// Checks the parameters.
fn check(kind: &Kind, signature: &Signature, _: Shape) -> Result<(), Error> {
    let name = match signature.word("control") {
        "energy" => "control.form",
        "projection" => "control.way",
        _ => return Err(signature.unknown("control")),
    };
    let has_gradient = signature.equations.as_ref().is_some_and(|equations| equations.has_gradient());
    if !kind.controllable && !has_gradient {
        return Err(signature.unknown("control"));
    }
    if !matches!(signature.word("control.when"), "" | "between") {
        return Err(signature.unknown("control.when"));
    }
    match (name, signature.word(name)) {
        ("control.form", "limited" | "printed") => signature.expect("control.gain", 1)?,
        ("control.way", "scaling" | "nacozy") => {}
        _ => return Err(signature.unknown(name)),
    }
    signature.expect("control.target", 1)
}

//! Controls and projections, which keep the energy near its target (§12, Appendix D).
//!
//! A *control* is a push −g·v on the velocities. It is added to the increment h·v̇ in every stage, so it works with every method
//! in whose stages v and y belong to one time; with others it comes between steps. A *projection* returns the state to the target
//! energy after the step. Both wrap any system that has an energy, and are a system themselves. Energies are scaled to the step,
//! as everything is.
//!
//! Given: the word `control` is `energy`, with the word `control.form`, the `control.gain` and the `control.target`, and the word
//! `control.when`, `between`, if it comes between steps; or it is
//! `projection`, with the word `control.way` and the `control.target`.

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

/// Whether a system is given any control.
pub(crate) fn is_given(signature: &Signature) -> bool {
    !signature.word("control").is_empty()
}

/// Whether it pushes velocities in the stages of a step, and is no projection.
pub fn pushes(signature: &Signature) -> bool {
    signature.word("control") == "energy" && !is_between(signature)
}

/// Whether it acts on the state after a step alone, and not in its stages.
pub(crate) fn is_after_the_step(signature: &Signature) -> bool {
    signature.word("control") == "projection" || is_between(signature)
}

/// The part.
pub(crate) fn part<N: Number>() -> Part<N> {
    Part {
        name: "control",
        is_given,
        check,
        // What a method carries in place of v would have to change with v.
        velocity_term: |signature, method| {
            let is_apart = is_after_the_step(signature) && method.carry.is_none();
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

/// An error if the control is wrong.
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

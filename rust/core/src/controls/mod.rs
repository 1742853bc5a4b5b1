//! Controls and projections, which keep the energy near its target (§12, Appendix D).
//!
//! A *control* is a push −g·v on the velocities. It is added to the increment h·v̇ in every stage, so it works with every method in whose
//! stages v and y belong to one time; with others it comes between steps.
//! A *projection* returns the state to the target energy after the step. Both wrap any system that has
//! an energy, and are a system themselves. Energies are scaled to the step, as everything is.
//!
//! Beside them [`force`] adds a force from outside, and [`friction`] Coulomb's friction.
//!
//! Given: the word `control` is `energy`, with the word `control.form`, the `control.gain` and the `control.target`, and the word
//! `control.when`, `between`, if it comes between steps; or it is
//! `projection`, with the word `control.way` and the `control.target`.

pub mod energy;
pub mod force;
pub mod friction;
pub mod projection;

use crate::{
    error::Error,
    number::Number,
    spec::{Given, Parameters},
    system::{Kind, Shape, System},
};

/// Whether a system is given any control.
pub fn is_given(given: &Given) -> bool {
    !given.word("control").is_empty()
}

/// Whether it pushes velocities in the stages of a step, and is no projection.
pub fn pushes(given: &Given) -> bool {
    given.word("control") == "energy" && !is_between(given)
}

/// Whether its push comes between steps: for methods in whose stages v and y belong to different times.
fn is_between(given: &Given) -> bool {
    given.word("control.when") == "between"
}

/// Whether it acts on the state after a step alone, and not in its stages.
pub fn is_after_the_step(given: &Given) -> bool {
    given.word("control") == "projection" || is_between(given)
}

/// An error if what is given around the system is wrong.
pub fn check(kind: &Kind, given: &Given, shape: Shape) -> Result<(), Error> {
    force::check(given, shape)?;
    friction::check(given)?;
    let name = match given.word("control") {
        "" => return Ok(()),
        "energy" => "control.form",
        "projection" => "control.way",
        _ => return Err(given.unknown("control")),
    };
    let has_energy = (kind.quantities)(given).iter().any(|(quantity, _)| quantity == "energy");
    let has_gradient = given.equations.as_ref().is_some_and(|equations| equations.has_gradient());
    if !has_energy && !has_gradient {
        return Err(given.unknown("control"));
    }
    if !matches!(given.word("control.when"), "" | "between") {
        return Err(given.unknown("control.when"));
    }
    match (name, given.word(name)) {
        ("control.form", "limited" | "printed") => given.expect("control.gain", 1)?,
        ("control.way", "scaling" | "nacozy") => {}
        _ => return Err(given.unknown(name)),
    }
    given.expect("control.target", 1)
}

/// An error if something is given that goes with steps of fixed length only.
pub fn only_fixed(given: &Given) -> Result<(), Error> {
    let name = [force::NAME, friction::NAME].into_iter().find(|name| given.count(name) > 0);
    match name {
        None => Ok(()),
        Some(name) => Err(Error::Options { system: given.system.clone(), options: format!("{name}, with adaptive steps") }),
    }
}

/// A system with all that is given around it: control or projection, force from outside, friction, in that order, for friction resists
/// all other forces. The tally starts from this number: h times the energy that control or projection added.
pub fn wrap<N: Number>(p: &Parameters<N>, system: Box<dyn System<N>>, tally: N) -> Box<dyn System<N>> {
    let system: Box<dyn System<N>> = match p.given.word("control") {
        "energy" => Box::new(energy::Controlled::new(p, system, tally)),
        "projection" => Box::new(projection::Projected::new(p, system, tally)),
        _ => system,
    };
    friction::wrap(p, force::wrap(p, system))
}

/// √x with x clamped between ¼ and 4: a factor of velocities between ½ and 2.
fn factor<N: Number>(square: N) -> N {
    square.clamped(0.25, 4.0).sqrt()
}

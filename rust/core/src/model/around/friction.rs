//! Coulomb's friction that sticks (§8): on each velocity, against its motion, or against the force that would set it in motion.
//!
//! With f = h·v̇ without friction and l = h times the deceleration by friction, a step of Euler's kind moves v to p = v + f,
//! reduced by l towards zero; where |p| ≤ l that is zero itself. No sign of v is asked for, so nothing chatters: a block that
//! friction can stop within a step stops, and at rest it stays while |f| ≤ l.
//!
//! Methods of several stages mix such increments, and v would only shrink by a factor in each step. So after the step v is set to
//! zero if the first stage said that the block stops, and friction can hold it there.

use super::{
    controls,
    part::{Attempts, Part},
};
use crate::{
    error::Error,
    model::{
        spec::Signature,
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// The name under which it is given, in the unit of v̇: one number for all velocities.
const NAME: &str = "friction.limit";

/// The part.
pub(crate) fn part<N: Number>() -> Part<N> {
    Part {
        name: NAME,
        is_given: |signature| signature.count(NAME) > 0,
        check,
        velocity_term: |_, _| Some("friction"),
        attempts: Attempts::Other,
        is_for_carry: false,
        is_only_fixed: |_| true,
        has_rows: false,
        wrap: |p, system, _| Box::new(Rubbing { system, limit: p.h * p.number(NAME) }),
    }
}

/// An error beside a control, whose work would count a stage twice.
fn check(_: &Kind, signature: &Signature, _: Shape) -> Result<(), Error> {
    signature.expect(NAME, 1)?;
    if controls::is_given(signature) { Err(signature.unknown("control")) } else { Ok(()) }
}

struct Rubbing<N: Number> {
    system: Box<dyn System<N>>,
    /// The most that friction takes from a velocity in a step.
    limit: N,
}

impl<N: Number> System<N> for Rubbing<N> {
    fn inner(&self) -> Option<&dyn System<N>> {
        Some(self.system.as_ref())
    }

    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let limit = self.limit;
        self.system.dv(t, v, y).zip_map(v, |f, v| {
            let moved = v + f;
            let forward = N::choose(limit.below(moved), f - limit, -v);
            N::choose(moved.below(-limit), f + limit, forward)
        })
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.system.dy(t, v, y)
    }

    fn bring_to_rest(&self, t: N, before: (&Block<N>, &Block<N>), v: Block<N>) -> Block<N> {
        let limit = self.limit;
        let within = |x: N| (-limit).at_most(x) & x.at_most(limit);
        let stops = self.system.dv(t, before.0, before.1).zip_map(before.0, |f, v| (f, v + f));
        v.zip_map(&stops, |v, (f, moved)| N::choose(within(moved) & within(f), N::of(0.0), v))
    }
}

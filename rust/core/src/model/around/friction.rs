//! Coulomb's friction that sticks (§8): on each velocity, against its motion, or against the force that would set it in motion.
//!
//! With f = h·v̇ without friction and l = h times the deceleration by friction, a step of Euler's kind moves v to p = v + f,
//! reduced by l towards zero; where |p| ≤ l that is zero itself. No sign of v is asked for, so nothing chatters: a block that
//! friction can stop within a step stops, and at rest it stays while |f| ≤ l.
//!
//! Methods of several stages mix such increments, and v would only shrink by a factor in each step. So after the step v is set to
//! zero if the first stage said that the block stops, and friction can hold it there.
//!
//! Friction of a user's own equations depends on the state. It may act on vectors, which it shortens, or on one number with which
//! others change, as the pole does with a cart.

use super::{
    controls,
    part::{Attempts, Part},
};
use crate::{
    error::Error,
    model::{
        spec::Signature,
        system::{Block, Friction, Kind, On, Shape, System},
    },
    tape::number::Number,
};

/// The name under which it is given, in the unit of v̇: one number for all velocities.
const NAME: &str = "friction.limit";

/// The part.
pub(crate) fn part<N: Number>() -> Part<N> {
    Part {
        name: NAME,
        is_given: |signature| signature.count(NAME) > 0 || is_own(signature),
        check,
        velocity_term: |_, _| Some("friction"),
        attempts: Attempts::Other,
        is_for_carry: true,
        is_only_fixed: |_| true,
        has_rows: false,
        wrap: |p, system, _| Box::new(Rubbing { system, limit: p.h * p.number(NAME) }),
    }
}

/// Whether it is a part of own equations.
fn is_own(signature: &Signature) -> bool {
    signature.equations.as_ref().is_some_and(|equations| equations.friction.is_some())
}

/// An error beside a control, whose work would count a stage twice.
fn check(_: &Kind, signature: &Signature, _: Shape) -> Result<(), Error> {
    if !is_own(signature) {
        signature.expect(NAME, 1)?;
    }
    if controls::is_given(signature) { Err(signature.unknown("control")) } else { Ok(()) }
}

struct Rubbing<N: Number> {
    system: Box<dyn System<N>>,
    /// The most that friction takes from each velocity in a step, if it is not a part of the equations.
    limit: N,
}

impl<N: Number> Rubbing<N> {
    fn friction_at(&self, t: N, v: &Block<N>, y: &Block<N>) -> Friction<N> {
        let common = || Friction { limit: Block::from_element(v.len(), self.limit), on: On::Vectors(1) };
        self.system.friction(t, v, y).unwrap_or_else(common)
    }
}

impl<N: Number> System<N> for Rubbing<N> {
    fn inner(&self) -> Option<&dyn System<N>> {
        Some(self.system.as_ref())
    }

    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let f = self.system.dv(t, v, y);
        let Friction { limit, on } = self.friction_at(t, v, y);
        match on {
            On::Vectors(1) => Block::from_fn(v.len(), |i, _| reduced(limit[i], v[i], f[i])),
            On::Vectors(n) => {
                let moved = v + &f;
                let length = lengths(&moved, n);
                Block::from_fn(v.len(), |i, _| {
                    let (limit, length) = (limit[i / n], length[i / n]);
                    N::choose(length.at_most(limit), -v[i], f[i] - moved[i] * (limit / length))
                })
            }
            On::One(at, along) => {
                let (limit, moved) = (limit[0], v[at] + f[at]);
                let forward = N::choose(limit.below(moved), -limit, -moved);
                let push = N::choose(moved.below(-limit), limit, forward);
                Block::from_fn(v.len(), |i, _| match along.get(i) {
                    _ if i == at => reduced(limit, v[at], f[at]),
                    Some(along) => f[i] + *along * push,
                    None => f[i],
                })
            }
        }
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.system.dy(t, v, y)
    }

    fn bring_to_rest(&self, t: N, before: (&Block<N>, &Block<N>), v: Block<N>) -> Block<N> {
        let f = self.system.dv(t, before.0, before.1);
        let moved = before.0 + &f;
        let Friction { limit, on } = self.friction_at(t, before.0, before.1);
        let within = |limit: N, x: N| (-limit).at_most(x) & x.at_most(limit);
        let zero = N::of(0.0);
        match on {
            On::Vectors(1) => {
                let stops = |i: usize| within(limit[i], moved[i]) & within(limit[i], f[i]);
                Block::from_fn(v.len(), |i, _| N::choose(stops(i), zero, v[i]))
            }
            On::Vectors(n) => {
                let (moved, f) = (lengths(&moved, n), lengths(&f, n));
                let stops = |k: usize| moved[k].at_most(limit[k]) & f[k].at_most(limit[k]);
                Block::from_fn(v.len(), |i, _| N::choose(stops(i / n), zero, v[i]))
            }
            On::One(at, along) => {
                let stops = within(limit[0], moved[at]) & within(limit[0], f[at]);
                Block::from_fn(v.len(), |i, _| match along.get(i) {
                    _ if i == at => N::choose(stops, zero, v[at]),
                    Some(along) => N::choose(stops, v[i] - *along * v[at], v[i]),
                    None => v[i],
                })
            }
        }
    }
}

/// The change of a velocity by f, less what friction takes of the sum.
fn reduced<N: Number>(limit: N, v: N, f: N) -> N {
    let moved = v + f;
    let forward = N::choose(limit.below(moved), f - limit, -v);
    N::choose(moved.below(-limit), f + limit, forward)
}

/// The lengths of vectors of n numbers each.
fn lengths<N: Number>(vectors: &Block<N>, n: usize) -> Block<N> {
    let square =
        |first: usize| (first + 1..first + n).fold(vectors[first] * vectors[first], |sum, i| sum + vectors[i] * vectors[i]);
    Block::from_fn(vectors.len() / n, |k, _| square(k * n).sqrt())
}

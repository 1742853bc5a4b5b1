//! Systems: two blocks and an increment for each, over any kind of number.

use nalgebra::DVector;

use super::spec::{Parameters, Signature};
use crate::{
    error::Error,
    tape::{
        mass::Mass,
        number::{Number, Symbol},
    },
};

/// A velocity or coordinate block: its numbers in order.
pub(crate) type Block<N> = DVector<N>;

/// A system scaled to the step: its rates times `h`.
///
/// Hoffmann writes every method in increments, `dv = h·v̇` and `dy = h·ẏ`, because `h` and a system's own constants can be
/// multiplied once for a whole run (Φ = ω₀T for the oscillator: "ω₀ is the same as a scale factor for the time", §3). A
/// method then needs nothing but increments and sums.
pub trait System<N: Number> {
    /// The system that this one is around, if it is a wrapper: what a wrapper does not define is that system's.
    fn inner(&self) -> Option<&dyn System<N>> {
        None
    }

    /// h·v̇(t, v, y)
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N>;

    /// h·ẏ(t, v, y)
    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N>;

    /// M, if the equations are M·ẏ = f with another matrix than that of units; `dy` is then h·f.
    fn mass(&self) -> Option<&Mass> {
        self.inner()?.mass()
    }

    /// The velocity whose increment of `y` is `d`: undoes `dy` in a second-order system, where ẏ is v times a number.
    ///
    /// Methods that need an acceleration use it; other systems need not define it.
    fn velocity(&self, d: &Block<N>) -> Block<N> {
        self.inner().map_or_else(|| d.map(|_| N::of(f64::NAN)), |inner| inner.velocity(d))
    }

    /// h times the acceleration by the part of the forces under which [`System::drift`] moves, if the system has such a part.
    fn central(&self, y: &Block<N>) -> Option<Block<N>> {
        self.inner()?.central(y)
    }

    /// The state after a share of the step under that part alone, whose motion is known.
    fn drift(&self, share: f64, v: &Block<N>, y: &Block<N>) -> Option<[Block<N>; 2]> {
        self.inner()?.drift(share, v, y)
    }

    /// h·v̇, h times the kinetic and h times the whole energy of a state, if the system has an energy that can be controlled.
    fn energies(&self, v: &Block<N>, y: &Block<N>) -> Option<Energies<N>> {
        self.inner()?.energies(v, y)
    }

    /// The gradient of the energy at the state whose velocities and energies these are.
    fn gradient(&self, v: &Block<N>, y: &Block<N>, energies: &Energies<N>) -> Option<Gradient<N>> {
        self.inner()?.gradient(v, y, energies)
    }

    /// The numbers of a quantity of a state that can be recorded, if the system knows it.
    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        self.inner()?.record(quantity, v, y)
    }

    /// The friction that sticks on velocities, with h times its decelerations, if the equations have some.
    fn friction(&self, t: N, v: &Block<N>, y: &Block<N>) -> Option<Friction<N>> {
        self.inner()?.friction(t, v, y)
    }

    /// The velocities after a step from `before` at time `t`, if the step may have missed that they come to rest.
    fn bring_to_rest(&self, t: N, before: (&Block<N>, &Block<N>), v: Block<N>) -> Block<N> {
        match self.inner() {
            Some(inner) => inner.bring_to_rest(t, before, v),
            None => v,
        }
    }

    /// The state after a step, projected onto what should be constant.
    fn project(&self, v: Block<N>, y: Block<N>) -> (Block<N>, Block<N>) {
        match self.inner() {
            Some(inner) => inner.project(v, y),
            None => (v, y),
        }
    }

    /// Its tally, the sum over the steps since it was made, if it has one.
    fn tally(&self) -> Option<N> {
        self.inner()?.tally()
    }

    /// Sets its tally, if it has one.
    fn set_tally(&self, tally: N) {
        if let Some(inner) = self.inner() {
            inner.set_tally(tally);
        }
    }
}

/// The result of [`System::energies`].
#[derive(Clone, Debug)]
pub struct Energies<N: Number> {
    /// h·v̇
    pub dv: Block<N>,
    /// h times the kinetic energy.
    pub kinetic: N,
    /// h times the whole energy.
    pub whole: N,
}

/// The result of [`System::gradient`].
#[derive(Clone, Debug)]
pub struct Gradient<N: Number> {
    /// ∂E/∂v
    pub v: Block<N>,
    /// ∂E/∂y
    pub y: Block<N>,
    /// The square of the length of both together.
    pub square: N,
}

/// The result of [`System::friction`]: the most that it takes from velocities in a step.
#[derive(Clone, Debug)]
pub struct Friction<N: Number> {
    /// For each vector, or for one number.
    pub limit: Block<N>,
    /// The velocities that it acts on.
    pub on: On<N>,
}

/// The velocities that friction acts on.
#[derive(Clone, Debug)]
pub enum On<N: Number> {
    /// Vectors of this many numbers each.
    Vectors(usize),
    /// The number at that place, and by how much others change where it changes by 1; nothing if they do not.
    One(usize, Block<N>),
}

/// How many numbers the blocks of a system have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Shape {
    /// Velocities.
    pub v: usize,
    /// Coordinates.
    pub y: usize,
}

/// The properties of a kind of system: its file in `systems/` has one as `KIND`.
pub struct Kind {
    /// The name of its file.
    pub name: &'static str,
    /// The size of the blocks, or an error for wrong parameters.
    pub shape: fn(&Signature) -> Result<Shape, Error>,
    /// The term that depends on the velocity, if there is one: methods that need an acceleration refuse it.
    pub velocity_term: fn(&Signature) -> Option<&'static str>,
    /// Quantities that can be recorded, and how many numbers each has.
    pub quantities: fn(&Signature) -> Vec<(String, usize)>,
    /// Whether [`System::energies`] are known, so that its energy can be controlled.
    pub controllable: bool,
    /// Approximate number of operations of both rates: with many, a step is not a single tape.
    pub operations: fn(&Signature) -> usize,
    /// The system over symbols.
    pub make: Make<Symbol>,
}

/// Makes the system of one member, scaled to the step.
pub type Make<N> = fn(&Parameters<N>) -> Box<dyn System<N>>;

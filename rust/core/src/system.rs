//! Systems: two blocks and an increment for each, over any kind of number.

use nalgebra::DVector;

use crate::{
    contact, controls,
    error::Error,
    large::Long,
    method::{Needs, Record},
    number::{Number, Symbol},
    spec::{Given, Parameters},
};

/// A velocity or coordinate block: its numbers in order.
pub type Block<N> = DVector<N>;

/// A system scaled to the step: its rates times `h`.
///
/// The document writes every method in increments, `dv = h·v̇` and `dy = h·ẏ`, because `h` and a system's own constants can be
/// multiplied once for a whole run (Φ = ω₀T for the oscillator: "ω₀ is the same as a scale factor for the time", §3). A
/// method then needs nothing but increments and sums.
pub trait System<N: Number> {
    /// h·v̇(t, v, y)
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N>;

    /// h·ẏ(t, v, y)
    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N>;

    /// The velocity whose increment of `y` is `d`: undoes `dy` in a second-order system, where ẏ is v times a number.
    ///
    /// Methods that need an acceleration use it; other systems need not define it.
    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|_| N::of(f64::NAN))
    }

    /// h·v̇, h times the kinetic and h times the whole energy of a state, if the system has an energy that can be controlled.
    fn energies(&self, _v: &Block<N>, _y: &Block<N>) -> Option<Energies<N>> {
        None
    }

    /// The gradient of the energy at the state whose velocities and energies these are.
    fn gradient(&self, _v: &Block<N>, _y: &Block<N>, _energies: &Energies<N>) -> Option<Gradient<N>> {
        None
    }

    /// The numbers of a quantity of a state that can be recorded, if the system knows it.
    fn record(&self, _quantity: &str, _v: &Block<N>, _y: &Block<N>) -> Option<Vec<N>> {
        None
    }

    /// The velocities after a step from `before` at time `t`, if the step may have missed that they come to rest.
    fn bring_to_rest(&self, _t: N, _before: (&Block<N>, &Block<N>), v: Block<N>) -> Block<N> {
        v
    }

    /// The state after a step, projected onto what should be constant.
    fn project(&self, v: Block<N>, y: Block<N>) -> (Block<N>, Block<N>) {
        (v, y)
    }

    /// Its tally, the sum over the steps since it was made, if it has one.
    fn tally(&self) -> Option<N> {
        None
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

/// How many numbers the blocks of a system have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    pub shape: fn(&Given) -> Result<Shape, Error>,
    /// The term that depends on the velocity, if there is one: methods that need an acceleration refuse it.
    pub velocity_term: fn(&Given) -> Option<&'static str>,
    /// Quantities that can be recorded, and how many numbers each has. The `energy` is among them if it can be controlled.
    pub quantities: fn(&Given) -> Vec<(String, usize)>,
    /// Approximate number of operations of both rates: with many, a step is not a single tape.
    pub operations: fn(&Given) -> usize,
    /// The rates of one large member, where they are written by hand.
    pub long: Option<Long>,
    /// The system over symbols.
    pub make: Make<Symbol>,
}

impl Kind {
    /// The size of the blocks, or an error if the parameters are wrong or the method cannot step the system.
    ///
    /// A system that passes this check can be made and stepped.
    pub fn fit(&self, given: &Given, method: &Record) -> Result<Shape, Error> {
        let shape = (self.shape)(given)?;
        controls::check(self, given, shape)?;
        contact::check(given, shape)?;
        if contact::is_given(given) && controls::is_given(given) {
            return Err(given.unknown("control"));
        }
        // What a method carries in place of v would have to change with v.
        let apart = controls::is_after_the_step(given) && method.carry.is_none();
        let around = [(controls::friction::is_given(given), "friction"), (controls::is_given(given) && !apart, "energy control")];
        let term = (self.velocity_term)(given).or(around.into_iter().find_map(|(given, term)| given.then_some(term)));
        match term {
            Some(term) if method.needs == Needs::Acceleration => {
                Err(Error::VelocityDependent { method: method.name, system: self.name, term })
            }
            _ => Ok(shape),
        }
    }
}

/// Makes the system of one member, scaled to the step.
pub type Make<N> = fn(&Parameters<N>) -> Box<dyn System<N>>;

/// The kind of systems of that name.
pub fn kind(name: &str) -> Option<&'static Kind> {
    crate::systems::KINDS.iter().copied().find(|kind| kind.name == name)
}

//! The linear oscillator ÿ + 2Dω₀ẏ + ω₀²y = ω₀²x + a (§3), in canonical and physical form.
//!
//! | form | v̇ | ẏ |
//! |---|---|---|
//! | canonical | −ω₀(y + 2Dv − x) + a/ω₀ | ω₀v |
//! | physical | −ω₀²y − 2Dω₀v + ω₀²x + a | v |
//!
//! Options: `canonical` or `physical`; `damped`; `x:sine` or `x:held`; `a:sine` or `a:held`. Parameters: ω₀, D, then amplitude,
//! frequency and phase of x, then those of a. Tables: x's, then a's, if held. A driven oscillator always has its damping term.

use std::marker::PhantomData;

use nalgebra::SVector;

use crate::{
    error::Error,
    group::{Clock, Group, NARROW, Spec, Width},
    signal::{Beat, Both, Held, Signal, Sine},
    stepper::{Needs, Stepper},
    system::System,
    tile::{self, INPUTS, Small, View},
};

/// What a kernel knows of the choice of state variables, and what pulls back.
pub trait Form: Send + 'static {
    /// Factor of v in h·ẏ.
    fn speed(constants: &[f64; CONSTANTS], h: f64) -> f64;
    /// The pull at y: that of a spring, if nothing else is said.
    #[inline(always)]
    fn pull(y: f64) -> f64 {
        y
    }
}

/// v is the velocity divided by ω₀: the phase diagram is a circle, and Φ the only constant of a free oscillator.
pub struct Canonical;
/// v is the velocity.
pub struct Physical;
/// One or the other, as a constant says: beside other constants one more is cheaper than a second kernel.
pub struct Either;

impl Form for Canonical {
    #[inline(always)]
    fn speed(c: &[f64; CONSTANTS], _h: f64) -> f64 {
        -c[0]
    }
}

impl Form for Physical {
    #[inline(always)]
    fn speed(_c: &[f64; CONSTANTS], h: f64) -> f64 {
        h
    }
}

impl Form for Either {
    #[inline(always)]
    fn speed(c: &[f64; CONSTANTS], _h: f64) -> f64 {
        c[SPEED]
    }
}

/// The choice of state variables.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Variables {
    /// v is the velocity divided by ω₀.
    Canonical,
    /// v is the velocity.
    Physical,
    /// v is the velocity, y an angle, and the only input an acceleration.
    Angle,
}

/// Factors of the pull and of the inputs in h·v̇.
fn factors(variables: Variables, h: f64, omega: f64) -> [f64; 3] {
    match variables {
        Variables::Canonical => [h * omega, h * omega, h / omega],
        Variables::Physical => [h * (omega * omega), h * (omega * omega), h],
        Variables::Angle => [h * (omega * omega), h, h],
    }
}

/// What acts on the oscillator besides its spring, times h.
pub trait Force {
    /// h·v̇ from what the spring adds to it.
    fn total(&self, spring: f64, t: f64, v: f64) -> f64;
}

/// Nothing.
pub struct Free;
/// Damping.
pub struct Damped {
    drag: f64,
}
/// Damping and inputs.
pub struct Driven<X> {
    drag: f64,
    input: X,
}

impl Force for Free {
    #[inline(always)]
    fn total(&self, spring: f64, _t: f64, _v: f64) -> f64 {
        spring
    }
}

impl Force for Damped {
    #[inline(always)]
    fn total(&self, spring: f64, _t: f64, v: f64) -> f64 {
        spring - self.drag * v
    }
}

impl<X: Signal> Force for Driven<X> {
    #[inline(always)]
    fn total(&self, spring: f64, t: f64, v: f64) -> f64 {
        (spring - self.drag * v) + self.input.at(t)
    }
}

/// The oscillator of one member, scaled to the step.
pub struct Oscillator<F, W> {
    spring: f64,
    speed: f64,
    force: W,
    form: PhantomData<F>,
}

impl<F: Form, W: Force> System for Oscillator<F, W> {
    type V = SVector<f64, 1>;
    type Y = SVector<f64, 1>;

    #[inline(always)]
    fn dv(&mut self, t: f64, v: &Self::V, y: &Self::Y, out: &mut Self::V) {
        out[0] = self.force.total(self.spring * F::pull(y[0]), t, v[0]);
    }

    #[inline(always)]
    fn dy(&mut self, _t: f64, v: &Self::V, _y: &Self::Y, out: &mut Self::Y) {
        out[0] = self.speed * v[0];
    }

    #[inline(always)]
    fn velocity(&mut self, d: &Self::Y, out: &mut Self::V) {
        out[0] = d[0] / self.speed;
    }
}

/// Makes a member's force from its constants.
pub trait Drive: Send + 'static {
    /// What it makes.
    type Force<'a, const L: usize>: Force;
    /// From the scaled constants and the sampled inputs.
    fn force<'a, const L: usize>(constants: &[f64; CONSTANTS], inputs: &[View<'a, L>; INPUTS], lane: usize)
    -> Self::Force<'a, L>;
}

/// Spring, drag, two inputs of amplitude, frequency and phase, and the factor of v in h·ẏ.
pub const CONSTANTS: usize = 9;
/// The place of that factor.
const SPEED: usize = 8;

impl Drive for Free {
    type Force<'a, const L: usize> = Free;
    #[inline(always)]
    fn force<'a, const L: usize>(_: &[f64; CONSTANTS], _: &[View<'a, L>; INPUTS], _: usize) -> Free {
        Free
    }
}

impl Drive for Damped {
    type Force<'a, const L: usize> = Damped;
    #[inline(always)]
    fn force<'a, const L: usize>(c: &[f64; CONSTANTS], _: &[View<'a, L>; INPUTS], _: usize) -> Damped {
        Damped { drag: c[1] }
    }
}

/// Makes a signal from the slot of constants or the table that is its own.
pub trait Source: Send + 'static {
    /// What it makes.
    type Signal<'a, const L: usize>: Signal;
    /// How many slots of constants it takes, and how many tables.
    const SLOTS: usize;
    /// From the constants of `slot` or the table of that number.
    fn signal<'a, const L: usize>(
        c: &[f64; CONSTANTS],
        inputs: &[View<'a, L>; INPUTS],
        slot: usize,
        table: usize,
        lane: usize,
    ) -> Self::Signal<'a, L>;
}

/// A sinusoid.
pub struct FromSine;
/// A sinusoid of the same frequency and phase for all members, the only input.
pub struct FromBeat;
/// A table.
pub struct FromTable;

impl Source for FromSine {
    type Signal<'a, const L: usize> = Sine;
    const SLOTS: usize = 1;
    #[inline(always)]
    fn signal<'a, const L: usize>(c: &[f64; CONSTANTS], _: &[View<'a, L>; INPUTS], slot: usize, _: usize, _: usize) -> Sine {
        Sine { amplitude: c[2 + 3 * slot], omega: c[3 + 3 * slot], phase: c[4 + 3 * slot] }
    }
}

impl Source for FromBeat {
    type Signal<'a, const L: usize> = Beat<'a, L>;
    const SLOTS: usize = 1;
    #[inline(always)]
    fn signal<'a, const L: usize>(
        c: &[f64; CONSTANTS],
        inputs: &[View<'a, L>; INPUTS],
        slot: usize,
        table: usize,
        _: usize,
    ) -> Beat<'a, L> {
        Beat { amplitude: c[2 + 3 * slot], sine: inputs[table] }
    }
}

impl Source for FromTable {
    type Signal<'a, const L: usize> = Held<'a, L>;
    const SLOTS: usize = 0;
    #[inline(always)]
    fn signal<'a, const L: usize>(
        _: &[f64; CONSTANTS],
        inputs: &[View<'a, L>; INPUTS],
        _: usize,
        table: usize,
        lane: usize,
    ) -> Held<'a, L> {
        Held { samples: inputs[table], lane }
    }
}

impl<X: Source> Drive for Driven<X> {
    type Force<'a, const L: usize> = Driven<X::Signal<'a, L>>;
    #[inline(always)]
    fn force<'a, const L: usize>(c: &[f64; CONSTANTS], inputs: &[View<'a, L>; INPUTS], lane: usize) -> Self::Force<'a, L> {
        Driven { drag: c[1], input: X::signal(c, inputs, 0, 0, lane) }
    }
}

impl<A: Source, B: Source> Drive for Driven<(A, B)> {
    type Force<'a, const L: usize> = Driven<Both<A::Signal<'a, L>, B::Signal<'a, L>>>;
    #[inline(always)]
    fn force<'a, const L: usize>(c: &[f64; CONSTANTS], inputs: &[View<'a, L>; INPUTS], lane: usize) -> Self::Force<'a, L> {
        let first = A::signal(c, inputs, 0, 0, lane);
        let second = B::signal(c, inputs, A::SLOTS, 1 - A::SLOTS, lane);
        Driven { drag: c[1], input: Both(first, second) }
    }
}

struct Family<F, D> {
    /// For x and a, or the only input: whether it is a sinusoid, held, or not there.
    inputs: [Option<Kind>; 2],
    variables: Variables,
    form: PhantomData<fn() -> (F, D)>,
}

/// What an input is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// A table.
    Held,
    /// A sinusoid of the same frequency and phase for all members.
    Beat,
    /// A sinusoid.
    Sine,
}

/// The kind of an input by the options that would name it.
pub(super) fn kind(spec: &Spec, held: &str, sine: &str) -> Option<Kind> {
    if spec.has(held) { Some(Kind::Held) } else { spec.has(sine).then_some(Kind::Sine) }
}

impl<F: Form, D: Drive> Small<1, 1, CONSTANTS> for Family<F, D> {
    type Member<'a, const L: usize> = Oscillator<F, D::Force<'a, L>>;

    #[inline(always)]
    fn constants(&self, h: f64, p: [f64; CONSTANTS]) -> [f64; CONSTANTS] {
        let [stiffness, by_x, by_a] = factors(self.variables, h, p[0]);
        let speed = if self.variables == Variables::Canonical { stiffness } else { h };
        let [x, a] = self.inputs.map(|kind| matches!(kind, Some(Kind::Sine | Kind::Beat)));
        let (of_x, of_a) = ([by_x * p[2], p[3], p[4]], [by_a * p[5], p[6], p[7]]);
        // Without a loop or a branch, so that a loop over the lanes is a vector loop.
        let first = if x { of_x } else { of_a };
        let second = if x && a { of_a } else { [0.0; 3] };
        let drag = (2.0 * p[1]) * (h * p[0]);
        // The spring is negated once, and not in every step.
        [-stiffness, drag, first[0], first[1], first[2], second[0], second[1], second[2], speed]
    }

    fn input_factor(&self, h: f64, p: [f64; CONSTANTS], i: usize) -> f64 {
        let [_, by_x, by_a] = factors(self.variables, h, p[0]);
        if i == 0 && self.inputs[0] == Some(Kind::Held) { by_x } else { by_a }
    }

    fn beat(&self, spec: &Spec) -> Option<(f64, f64)> {
        (self.inputs[0] == Some(Kind::Beat)).then(|| (spec.at(3, 0), spec.at(4, 0)))
    }

    #[inline(always)]
    fn member<'a, const L: usize>(
        h: f64,
        c: [f64; CONSTANTS],
        inputs: &[View<'a, L>; INPUTS],
        lane: usize,
    ) -> Self::Member<'a, L> {
        Oscillator { spring: c[0], speed: F::speed(&c, h), force: D::force(&c, inputs, lane), form: PhantomData }
    }
}

/// A group of this form and this force.
pub(super) fn of_force<F: Form, D: Drive, St: Stepper, const WIDE: usize, const HALF: usize, const ABREAST: usize>(
    inputs: [Option<Kind>; 2],
    variables: Variables,
    clock: &Clock,
    width: Width,
) -> Box<dyn Group> {
    let family = Family::<F, D> { inputs, variables, form: PhantomData };
    // Many stages are long enough for two vectors of lanes to keep the machine busy; more kernels of them would only make the core
    // larger, by half.
    if const { St::RECORD.evaluations > 4 } {
        tile::group::<_, St, 1, 1, CONSTANTS, 16, 16, 16, 16, 1>(family, clock, width)
    } else {
        tile::group::<_, St, 1, 1, CONSTANTS, WIDE, HALF, NARROW, 16, ABREAST>(family, clock, width)
    }
}

/// A group of oscillators.
pub fn group<St: Stepper>(spec: &Spec, clock: &Clock, width: Width) -> Result<Box<dyn Group>, Error> {
    let canonical = spec.has("canonical");
    if canonical == spec.has("physical") {
        return Err(spec.unknown_options());
    }
    let variables = if canonical { Variables::Canonical } else { Variables::Physical };
    if St::RECORD.needs == Needs::Acceleration && spec.has("damped") {
        return Err(Error::VelocityDependent { method: St::RECORD.name, system: "oscillator", term: "damping" });
    }
    let inputs = [kind(spec, "x:held", "x:sine"), kind(spec, "a:held", "a:sine")];
    let mut kinds: Vec<Kind> = inputs.into_iter().flatten().collect();
    // Lanes: what was fastest when tried. The free oscillator's v and y fill the registers of AVX-512 and Φ comes from memory.
    kinds.sort(); // a sum of two does not care for their order, and this saves kernels
    Ok(match (kinds.as_slice(), spec.has("damped")) {
        ([], false) if canonical => of_force::<Canonical, Free, St, 112, 24, 1>(inputs, variables, clock, width),
        ([], false) => of_force::<Physical, Free, St, 112, 24, 1>(inputs, variables, clock, width),
        ([], true) => of_force::<Either, Damped, St, 64, 32, 1>(inputs, variables, clock, width),
        ([Kind::Held], _) => of_force::<Either, Driven<FromTable>, St, 64, 32, 1>(inputs, variables, clock, width),
        ([Kind::Sine], _) => of_force::<Either, Driven<FromSine>, St, 16, 32, 1>(inputs, variables, clock, width),
        ([Kind::Held, Kind::Held], _) => {
            of_force::<Either, Driven<(FromTable, FromTable)>, St, 64, 32, 1>(inputs, variables, clock, width)
        }
        ([Kind::Held, Kind::Sine], _) => {
            of_force::<Either, Driven<(FromTable, FromSine)>, St, 32, 32, 1>(inputs, variables, clock, width)
        }
        ([Kind::Sine, Kind::Sine], _) => {
            of_force::<Either, Driven<(FromSine, FromSine)>, St, 32, 32, 1>(inputs, variables, clock, width)
        }
        _ => return Err(spec.unknown_options()),
    })
}

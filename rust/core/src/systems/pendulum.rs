//! The pendulum v̇ = −ω₀²·sin y − 2Dω₀v + a, ẏ = v: the oscillator in physical form, pulled by the sine of its angle.
//!
//! Options: `damped`; `sine` or `held`, what a is. Parameters: ω₀, D, then amplitude, frequency and phase of a. Table: a's, if held.
//! A driven pendulum always has its damping term.

use super::oscillator::{CONSTANTS, Damped, Driven, Form, Free, FromBeat, FromSine, FromTable, Kind, Variables, kind, of_force};
use crate::{
    error::Error,
    group::{Clock, Group, Spec, Width},
    stepper::{Needs, Stepper},
    trig,
};

/// y is an angle and v its velocity.
pub struct Angle;

impl Form for Angle {
    #[inline(always)]
    fn speed(_c: &[f64; CONSTANTS], h: f64) -> f64 {
        h
    }
    #[inline(always)]
    fn pull(y: f64) -> f64 {
        trig::sin(y)
    }
}

/// A group of pendulums.
pub fn group<St: Stepper>(spec: &Spec, clock: &Clock, width: Width) -> Result<Box<dyn Group>, Error> {
    if St::RECORD.needs == Needs::Acceleration && spec.has("damped") {
        return Err(Error::VelocityDependent { method: St::RECORD.name, system: "pendulum", term: "damping" });
    }
    let common = |i: usize| spec.rows.get(i).is_none_or(|row| row.0.len() == 1);
    let input =
        kind(spec, "held", "sine").map(|kind| if kind == Kind::Sine && common(3) && common(4) { Kind::Beat } else { kind });
    let inputs = [input, None];
    // Lanes: what was fastest when tried. A sinusoid that all have in common, as one that drives a sweep is, costs one sine for all
    // lanes: the more, the less each pays.
    Ok(match (input, spec.has("damped")) {
        (None, false) => of_force::<Angle, Free, St, 48, 16, 3>(inputs, Variables::Angle, clock, width),
        (None, true) => of_force::<Angle, Damped, St, 48, 16, 3>(inputs, Variables::Angle, clock, width),
        (Some(Kind::Held), _) => of_force::<Angle, Driven<FromTable>, St, 16, 16, 1>(inputs, Variables::Angle, clock, width),
        (Some(Kind::Beat), _) => of_force::<Angle, Driven<FromBeat>, St, 192, 32, 3>(inputs, Variables::Angle, clock, width),
        (Some(Kind::Sine), _) => of_force::<Angle, Driven<FromSine>, St, 16, 16, 1>(inputs, Variables::Angle, clock, width),
    })
}

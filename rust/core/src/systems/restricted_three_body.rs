//! The restricted problem of three bodies: one without mass moves in the plane between two that circle each other, seen from a
//! frame that turns with them. The heavy one, 1 − μ, stands at (−μ, 0), the light one, μ, at (1 − μ, 0).
//!
//! ẍ = x + 2ẏ − (1 − μ)(x + μ)/r₁³ − μ(x − 1 + μ)/r₂³, ÿ = y − 2ẋ − (1 − μ)y/r₁³ − μy/r₂³
//!
//! No options. Parameter: μ.

use nalgebra::SVector;

use crate::{
    error::Error,
    group::{Clock, Group, NARROW, Spec, Width},
    stepper::{Needs, Stepper},
    system::System,
    tile::{self, INPUTS, Small, View},
};

/// The body of one member, scaled to the step.
pub struct RestrictedThreeBody {
    heavy: f64,
    light: f64,
    mu: f64,
    h: f64,
}

impl System for RestrictedThreeBody {
    type V = SVector<f64, 2>;
    type Y = SVector<f64, 2>;

    #[inline(always)]
    fn dv(&mut self, _t: f64, v: &Self::V, y: &Self::Y, out: &mut Self::V) {
        let from_heavy = y[0] + self.mu;
        let from_light = (y[0] - 1.0) + self.mu; // in this order, because near the light body the difference is exact
        let across = y[1] * y[1];
        let square = from_heavy * from_heavy + across;
        let by_heavy = self.heavy / (square * square.sqrt());
        let square = from_light * from_light + across;
        let by_light = self.light / (square * square.sqrt());
        let turn = self.h + self.h;
        out[0] = ((self.h * y[0] + turn * v[1]) - by_heavy * from_heavy) - by_light * from_light;
        out[1] = ((self.h * y[1] - turn * v[0]) - by_heavy * y[1]) - by_light * y[1];
    }

    #[inline(always)]
    fn dy(&mut self, _t: f64, v: &Self::V, _y: &Self::Y, out: &mut Self::Y) {
        out[0] = self.h * v[0];
        out[1] = self.h * v[1];
    }

    #[inline(always)]
    fn velocity(&mut self, d: &Self::Y, out: &mut Self::V) {
        out[0] = d[0] / self.h;
        out[1] = d[1] / self.h;
    }
}

/// h·(1 − μ), h·μ and μ.
const CONSTANTS: usize = 3;

struct Family;

impl Small<2, 2, CONSTANTS> for Family {
    type Member<'a, const L: usize> = RestrictedThreeBody;

    fn constants(&self, h: f64, [mu, ..]: [f64; CONSTANTS]) -> [f64; CONSTANTS] {
        [h * (1.0 - mu), h * mu, mu]
    }

    #[inline(always)]
    fn member<'a, const L: usize>(
        h: f64,
        [heavy, light, mu]: [f64; CONSTANTS],
        _: &[View<'a, L>; INPUTS],
        _: usize,
    ) -> RestrictedThreeBody {
        RestrictedThreeBody { heavy, light, mu, h }
    }
}

/// A group of such bodies.
pub fn group<St: Stepper>(spec: &Spec, clock: &Clock, width: Width) -> Result<Box<dyn Group>, Error> {
    if St::RECORD.needs == Needs::Acceleration {
        let (method, system) = (St::RECORD.name, "restricted_three_body");
        return Err(Error::VelocityDependent { method, system, term: "the Coriolis force" });
    }
    if !spec.options.is_empty() {
        return Err(spec.unknown_options());
    }
    // Square roots and divisions keep the machine busy with a vector or two of lanes.
    Ok(tile::group::<_, St, 2, 2, CONSTANTS, 16, 16, NARROW, 16, 1>(Family, clock, width))
}

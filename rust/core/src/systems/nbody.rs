//! Bodies that attract each other.
//!
//! Three equal bodies in the plane under the 1/r law (Appendix C), whose potential is the logarithm of the distance. A body's
//! numbers are x and y; the block is x₁ y₁ x₂ y₂ x₃ y₃. Options: `logarithmic`, `planar`, `three`. Parameters: G·m.

use nalgebra::SVector;

use crate::{
    error::Error,
    group::{Clock, Group, Spec, Width},
    stepper::Stepper,
    system::System,
    tile::{self, INPUTS, Small, View},
};

/// Three bodies, scaled to the step.
pub struct ThreeBodies {
    strength: f64,
    h: f64,
}

impl ThreeBodies {
    /// Both bodies of a pair move by h·G·m·d/r², in opposite directions.
    #[inline(always)]
    fn pair(&self, y: &SVector<f64, 6>, dv: &mut SVector<f64, 6>, i: usize, j: usize) {
        let dx = y[2 * j] - y[2 * i];
        let dy = y[2 * j + 1] - y[2 * i + 1];
        let pull = self.strength / (dx * dx + dy * dy);
        dv[2 * i] += dx * pull;
        dv[2 * i + 1] += dy * pull;
        dv[2 * j] -= dx * pull;
        dv[2 * j + 1] -= dy * pull;
    }
}

impl System for ThreeBodies {
    type V = SVector<f64, 6>;
    type Y = SVector<f64, 6>;

    #[inline(always)]
    fn dv(&mut self, _t: f64, _v: &Self::V, y: &Self::Y, out: &mut Self::V) {
        // Written out: a loop over pairs loses the vector instructions.
        *out = SVector::zeros();
        self.pair(y, out, 0, 1);
        self.pair(y, out, 0, 2);
        self.pair(y, out, 1, 2);
    }

    #[inline(always)]
    fn dy(&mut self, _t: f64, v: &Self::V, _y: &Self::Y, out: &mut Self::Y) {
        for i in 0..6 {
            out[i] = self.h * v[i];
        }
    }

    #[inline(always)]
    fn velocity(&mut self, d: &Self::Y, out: &mut Self::V) {
        for i in 0..6 {
            out[i] = d[i] / self.h;
        }
    }
}

struct Family;

impl Small<6, 6, 1> for Family {
    type Member<'a, const L: usize> = ThreeBodies;

    fn constants(&self, h: f64, [strength]: [f64; 1]) -> [f64; 1] {
        [h * strength]
    }

    #[inline(always)]
    fn member<'a, const L: usize>(h: f64, [strength]: [f64; 1], _inputs: &[View<'a, L>; INPUTS], _lane: usize) -> ThreeBodies {
        ThreeBodies { strength, h }
    }
}

/// A group of N-body systems.
pub fn group<St: Stepper>(spec: &Spec, clock: &Clock, width: Width) -> Result<Box<dyn Group>, Error> {
    match spec.options.as_slice() {
        ["logarithmic", "planar", "three"] => Ok(tile::group::<_, St, 6, 6, 1, 32, 16>(Family, clock, width)),
        _ => Err(spec.unknown_options()),
    }
}

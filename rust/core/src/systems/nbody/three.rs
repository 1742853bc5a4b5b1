//! Three bodies in a lane tile.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use nalgebra::SVector;

use super::law::pull;
use crate::{
    system::System,
    tile::{INPUTS, Small, View},
};

/// Three bodies, scaled to the step.
pub struct ThreeBodies<const D: usize, const LAW: u8> {
    strength: [f64; 3],
    soft: f64,
    h: f64,
}

impl<const D: usize, const LAW: u8> ThreeBodies<D, LAW> {
    /// What bodies i and j get from each other.
    #[inline(always)]
    fn pair(&self, y: &[f64], i: usize, j: usize) -> ([f64; D], [f64; D]) {
        let mut d = [0.0; D];
        for c in 0..D {
            d[c] = y[D * j + c] - y[D * i + c];
        }
        let mut r2 = d[0] * d[0];
        for c in 1..D {
            r2 += d[c] * d[c];
        }
        let pull = pull::<LAW>(r2 + self.soft);
        let (to_i, to_j) = (pull * self.strength[j], pull * self.strength[i]);
        (d.map(|d| d * to_i), d.map(|d| d * to_j))
    }
}

macro_rules! three_bodies {
    ($dim:literal, $numbers:literal) => {
        impl<const LAW: u8> System for ThreeBodies<$dim, LAW> {
            type V = SVector<f64, $numbers>;
            type Y = SVector<f64, $numbers>;

            #[inline(always)]
            fn dv(&mut self, _t: f64, _v: &Self::V, y: &Self::Y, out: &mut Self::V) {
                // Written out: a loop over pairs loses the vector instructions.
                let y = y.as_slice();
                let (after_0, before_1) = self.pair(y, 0, 1);
                let (after_1, before_2) = self.pair(y, 1, 2);
                let (after_2, before_0) = self.pair(y, 2, 0);
                for c in 0..$dim {
                    // (0 + after) + (first round + second round), as the sums of any number of bodies.
                    out[c] = (0.0 + after_0[c]) + (0.0 + (0.0 - before_0[c]));
                    out[$dim + c] = (0.0 + after_1[c]) + ((0.0 - before_1[c]) + 0.0);
                    out[2 * $dim + c] = (0.0 + after_2[c]) + ((0.0 - before_2[c]) + 0.0);
                }
            }

            #[inline(always)]
            fn dy(&mut self, _t: f64, v: &Self::V, _y: &Self::Y, out: &mut Self::Y) {
                for i in 0..$numbers {
                    out[i] = self.h * v[i];
                }
            }

            #[inline(always)]
            fn velocity(&mut self, d: &Self::Y, out: &mut Self::V) {
                for i in 0..$numbers {
                    out[i] = d[i] / self.h;
                }
            }
        }

        impl<const LAW: u8> Small<$numbers, $numbers, 7> for Three<$dim, LAW> {
            type Member<'a, const L: usize> = ThreeBodies<$dim, LAW>;

            fn constants(&self, h: f64, [a, b, c, _, _, _, soft]: [f64; 7]) -> [f64; 7] {
                [h * a, h * b, h * c, 0.0, 0.0, 0.0, soft * soft]
            }

            #[inline(always)]
            fn member<'a, const L: usize>(
                h: f64,
                [a, b, c, _, _, _, soft]: [f64; 7],
                _: &[View<'a, L>; INPUTS],
                _: usize,
            ) -> Self::Member<'a, L> {
                ThreeBodies { strength: [a, b, c], soft, h }
            }
        }
    };
}

/// The tile of three bodies.
pub(super) struct Three<const D: usize, const LAW: u8>;
three_bodies!(2, 6);
three_bodies!(3, 9);

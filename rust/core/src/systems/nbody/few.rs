//! Two or three bodies in a lane tile.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use nalgebra::SVector;

use super::law::pull;
use crate::{
    system::System,
    tile::{INPUTS, Small, View},
};

/// A few bodies, scaled to the step.
pub struct FewBodies<const N: usize, const D: usize, const LAW: u8> {
    strength: [f64; N],
    soft: f64,
    h: f64,
}

impl<const N: usize, const D: usize, const LAW: u8> FewBodies<N, D, LAW> {
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

impl<const D: usize, const LAW: u8> FewBodies<2, D, LAW> {
    /// h·v̇, summed as those of any number of bodies; what is left out there adds zero, which changes no sum that begins with one.
    #[inline(always)]
    fn meet(&self, y: &[f64], out: &mut [f64]) {
        let (after_0, before_1) = self.pair(y, 0, 1);
        for c in 0..D {
            out[c] = 0.0 + after_0[c];
            out[D + c] = 0.0 - before_1[c];
        }
    }
}

impl<const D: usize, const LAW: u8> FewBodies<3, D, LAW> {
    /// h·v̇. The sums are those of any number of bodies, (0 + after) + (0 − before): the zero before `after` changes no sum that is not
    /// itself zero, and that one is 0 either way.
    #[inline(always)]
    fn meet(&self, y: &[f64], out: &mut [f64]) {
        // Written out: a loop over pairs loses the vector instructions.
        let (after_0, before_1) = self.pair(y, 0, 1);
        let (after_1, before_2) = self.pair(y, 1, 2);
        let (after_2, before_0) = self.pair(y, 2, 0);
        for c in 0..D {
            out[c] = after_0[c] + (0.0 - before_0[c]);
            out[D + c] = after_1[c] + (0.0 - before_1[c]);
            out[2 * D + c] = after_2[c] + (0.0 - before_2[c]);
        }
    }
}

macro_rules! few_bodies {
    ($n:literal, $dim:literal, $numbers:literal, $parameters:literal) => {
        impl<const LAW: u8> System for FewBodies<$n, $dim, LAW> {
            type V = SVector<f64, $numbers>;
            type Y = SVector<f64, $numbers>;

            #[inline(always)]
            fn dv(&mut self, _t: f64, _v: &Self::V, y: &Self::Y, out: &mut Self::V) {
                self.meet(y.as_slice(), out.as_mut_slice());
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

        /// Constants are h·G·m of the bodies, and ε² in the last place.
        impl<const LAW: u8> Small<$numbers, $numbers, $parameters> for Few<$n, $dim, LAW> {
            type Member<'a, const L: usize> = FewBodies<$n, $dim, LAW>;

            fn constants(&self, h: f64, mut c: [f64; $parameters]) -> [f64; $parameters] {
                for strength in &mut c[..$n] {
                    *strength *= h;
                }
                c[2 * $n] *= c[2 * $n];
                c
            }

            #[inline(always)]
            fn member<'a, const L: usize>(
                h: f64,
                c: [f64; $parameters],
                _: &[View<'a, L>; INPUTS],
                _: usize,
            ) -> Self::Member<'a, L> {
                FewBodies { strength: std::array::from_fn(|i| c[i]), soft: c[2 * $n], h }
            }
        }
    };
}

/// The tile of a few bodies.
pub(super) struct Few<const N: usize, const D: usize, const LAW: u8>;
few_bodies!(2, 2, 4, 5);
few_bodies!(2, 3, 6, 5);
few_bodies!(3, 2, 6, 7);
few_bodies!(3, 3, 9, 7);

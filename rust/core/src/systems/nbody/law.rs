//! The forces and their potentials.

use crate::log::log;

pub(super) const LOGARITHMIC: u8 = 0;
pub(super) const NEWTON: u8 = 1;
pub(super) const PRINTED: u8 = 2;

/// f(r²)
#[inline(always)]
pub(super) fn pull<const LAW: u8>(r2: f64) -> f64 {
    if LAW == NEWTON { 1.0 / (r2 * r2.sqrt()) } else { 1.0 / r2 }
}

/// The potential, per mass, that a partner of this strength makes; `to_i` is pull·strength.
#[inline(always)]
pub(super) fn phi<const LAW: u8>(r2: f64, pull: f64, strength: f64, to_i: f64) -> f64 {
    match LAW {
        LOGARITHMIC => (0.5 * log(r2)) * strength,
        NEWTON => -(r2 * to_i),
        _ => -(pull.sqrt() * strength),
    }
}

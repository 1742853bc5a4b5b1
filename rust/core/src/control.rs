//! What keeps the energy near its target (§12, Appendix D).
//!
//! A *control* is a push −g·v on the velocities. It is added to the increment h·v̇ in every stage of whatever method makes the step,
//! so it goes with all of them. A *projection* sets the state back onto the energy after the step. Energies come scaled to the
//! step, as everything does.

use crate::group::Spec;

/// Energy control over `L` lanes.
#[derive(Clone, Debug)]
pub struct EnergyControl<const L: usize> {
    limited: bool,
    gain: [f64; L],
    target: [f64; L],
}

impl<const L: usize> EnergyControl<L> {
    /// From the rows `target` and `gain` of the parameters; `limited` or as printed.
    pub fn new(spec: &Spec, limited: bool, first_row: usize, h: f64, member: impl Fn(usize) -> usize) -> Self {
        EnergyControl {
            limited,
            target: std::array::from_fn(|l| h * spec.at(first_row, member(l))),
            gain: std::array::from_fn(|l| spec.at(first_row + 1, member(l))),
        }
    }

    /// g, from h times the kinetic and h times the whole energy.
    ///
    /// As printed, g = h·C·ΔE. It overflows where C·h·K passes 1, so the limited form takes the decay of ΔE by
    /// backward Euler: the velocities are scaled by the root of 1 − 2hC·ΔE/(1 + 2hC·K), held in ¼ … 4.
    #[inline(always)]
    pub fn push(&self, kinetic: &[f64; L], energy: &[f64; L]) -> [f64; L] {
        let mut g = [0.0; L];
        for l in 0..L {
            let off = energy[l] - self.target[l];
            g[l] = if self.limited {
                let twice = 2.0 * self.gain[l];
                let square = 1.0 - (twice * off) / (1.0 + twice * kinetic[l]);
                let held = if square < 0.25 { 0.25 } else { square };
                let held = if held > 4.0 { 4.0 } else { held };
                1.0 - held.sqrt()
            } else {
                self.gain[l] * off
            };
        }
        g
    }
}

/// How a projection goes back to the energy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// All velocities by one factor.
    Scaling,
    /// The least change of the state (Nacozy 1971): along the gradient of the energy, in velocities and coordinates.
    Nacozy,
}

/// Projection onto the energy over `L` lanes.
#[derive(Clone, Debug)]
pub struct Projection<const L: usize> {
    /// How.
    pub way: Way,
    target: [f64; L],
}

impl<const L: usize> Projection<L> {
    /// From the row `target` of the parameters.
    pub fn new(spec: &Spec, way: Way, row: usize, h: f64, member: impl Fn(usize) -> usize) -> Self {
        Projection { way, target: std::array::from_fn(|l| h * spec.at(row, member(l))) }
    }

    /// h times how far the energy is off.
    #[inline(always)]
    pub fn off(&self, energy: &[f64; L]) -> [f64; L] {
        let mut off = [0.0; L];
        for l in 0..L {
            off[l] = energy[l] - self.target[l];
        }
        off
    }

    /// The factor of the velocities, from h times the kinetic energy and h times what is off: between ½ and 2.
    #[inline(always)]
    pub fn factor(&self, kinetic: &[f64; L], off: &[f64; L]) -> [f64; L] {
        let mut factor = [0.0; L];
        for l in 0..L {
            let square = 1.0 - off[l] / kinetic[l];
            let held = if square < 0.25 { 0.25 } else { square };
            let held = if held > 4.0 { 4.0 } else { held };
            factor[l] = held.sqrt();
        }
        factor
    }
}

//! Systems: two blocks and an increment for each.

use crate::block::Block;

/// A system scaled to the step: its rates times `h`.
///
/// The document writes every method in increments, `dv = h·v̇` and `dy = h·ẏ`, because `h` and a system's own constants can be
/// multiplied once for a whole run (Φ = ω₀T for the oscillator: "ω₀ is the same as a scale factor for the time", §3). A
/// method then needs nothing but increments and sums.
pub trait System {
    /// The velocity block.
    type V: Block;
    /// The coordinate block.
    type Y: Block;

    /// `out = h·v̇(t, v, y)`
    fn dv(&mut self, t: f64, v: &Self::V, y: &Self::Y, out: &mut Self::V);

    /// `out = h·ẏ(t, v, y)`
    fn dy(&mut self, t: f64, v: &Self::V, y: &Self::Y, out: &mut Self::Y);

    /// The velocity whose increment of `y` is `d`: undoes `dy` in a second-order system, where ẏ is v times a number.
    ///
    /// Methods that ask for [`crate::stepper::Needs::Acceleration`] use it; no other system needs it.
    fn velocity(&mut self, _d: &Self::Y, out: &mut Self::V) {
        out.numbers_mut().fill(f64::NAN);
    }

    /// Corrects the state after a step: projections onto what should be constant.
    #[inline(always)]
    fn settle(&mut self, _v: &mut Self::V, _y: &mut Self::Y) {}

    /// Says that the state of these coordinates is about to be recorded, and that the next step will begin there.
    fn foresee(&mut self, _y: &Self::Y) {}

    /// Records quantities of a state, as rows.
    fn record(&mut self, _v: &Self::V, _y: &Self::Y, _rows: &mut [f64]) {}

    /// What it adds up over the steps.
    fn tally(&self) -> &[f64] {
        &[]
    }

    /// What it adds up, to write.
    fn tally_mut(&mut self) -> &mut [f64] {
        &mut []
    }
}

use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
};

/// The order of a step of fixed length.
const ORDER: u32 = 8;

pub const RECORD: Record = Record {
    name: "taylor",
    title: "Taylor series",
    other_names: &["Taylor method", "Taylor integrator", "high-order Taylor method"],
    false_friends: &["Lie series of a split system", "exponential integrators", "Taylor-Galerkin method"],
    order: ORDER,
    family: "Taylor",
    limit: 3.395_140_220_574_925, // the root of 1/201600 − x/1451520 + x²/33868800 − x³/1625702400, x = Φ²
    needs: Needs::Rates,
    carry: None,
    estimate: Some(Estimate { order: ORDER, error, coarse: None, extension: None }),
    section: "not in Hoffmann (2002)",
    reference: "À. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods, \
                Experimental Mathematics 14 (2005) 99",
    about: "The sum of the solution's Taylor series around the start of the step; its coefficients follow from the operations of the \
            rates. Steps of fixed length have order 8. It damps an undamped oscillator very slightly, r₁² = 1 − Φ¹⁰/201600, up to \
            Φ = 3.395. Comparisons, and samples of an input, are taken as they are at the start of the step.",
    step,
};

/// The last term. What it is depends on the order, so adaptive steps find their length in another way (`series_pace.rs`).
fn error(s: Rates, _t: Time, _h: Length, v: Block, y: Block) -> (Block, Block) {
    s.series(ORDER, v, y)[ORDER as usize - 1]
}

fn step(s: Rates, _t: Time, _h: Length, v: Block, y: Block) -> (Block, Block) {
    let series = s.series(ORDER, v, y);
    // The smallest terms first.
    let sum = series.into_iter().rev().reduce(|(sum_v, sum_y), (next_v, next_y)| (next_v + sum_v, next_y + sum_y));
    sum.map_or((v, y), |(dv, dy)| (v + dv, y + dy))
}

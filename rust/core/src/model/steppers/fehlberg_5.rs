use super::fehlberg::{COARSE, ERROR, TABLEAU};
use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    tableau::{Tableau, combined, plus, powers},
};

const WEIGHTS: &[f64] = &[16.0 / 135.0, 0.0, 6656.0 / 12825.0, 28561.0 / 56430.0, -9.0 / 50.0, 2.0 / 55.0];
/// The weights of the powers of θ in the state at the share θ of a step: see the reference.
const EXTENSION: &[&[f64]] = &[
    &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    &[-14677.0 / 5760.0, 0.0, 23336.0 / 4275.0, -3609671.0 / 1203840.0, 0.853_75, -997.0 / 440.0, 1.5],
    &[22207.0 / 8640.0, 0.0, -5968.0 / 675.0, 762359.0 / 95040.0, -2.4275, 1029.0 / 220.0, -4.0],
    &[-347.0 / 384.0, 0.0, 1112.0 / 285.0, -10985.0 / 2432.0, 1.393_75, -2.375, 2.5],
];
const MORE: Tableau = Tableau { nodes: &[1.0], rows: &[WEIGHTS] };

pub const RECORD: Record = Record {
    name: "fehlberg_5",
    title: "RK-Fehlberg 5(4)",
    other_names: &["RKF45 with local extrapolation"],
    false_friends: &["RK-Fehlberg 4(5)", "Dormand-Prince 5(4)"],
    order: 5,
    family: "Runge-Kutta",
    limit: 0.0,
    needs: Needs::Rates,
    carry: None,
    estimate: Some(Estimate { order: 5, error, coarse: Some(coarse), extension: Some(extension) }),
    section: "§12",
    reference: "E. Fehlberg, Low-order classical Runge-Kutta formulas with stepsize control, NASA TR R-315 (1969)",
    about: "RK-Fehlberg with local extrapolation: the same six evaluations, advancing with the fifth-order result. It too adds \
            energy to an undamped oscillator, r₁² = 1 + 0.0018·Φ⁶, and damps it only for Φ between 2.046 and 3.607.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    plus(v, y, WEIGHTS, &TABLEAU.stages(s, t, h, v, y))
}

fn coarse(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    combined(COARSE, &TABLEAU.stages(s, t, h, v, y))
}

fn error(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    combined(ERROR, &TABLEAU.stages(s, t, h, v, y))
}

fn extension(s: Rates, t: Time, h: Length, v: Block, y: Block) -> Vec<(Block, Block)> {
    powers(EXTENSION, &MORE.stages_after(TABLEAU.stages(s, t, h, v, y), s, t, h, v, y))
}

use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    tableau::{Tableau, combined, plus, powers},
};

pub const TABLEAU: Tableau = Tableau {
    nodes: &[0.0, 0.25, 0.375, 12.0 / 13.0, 1.0, 0.5],
    rows: &[
        &[],
        &[1.0 / 4.0],
        &[3.0 / 32.0, 9.0 / 32.0],
        &[1932.0 / 2197.0, -7200.0 / 2197.0, 7296.0 / 2197.0],
        &[439.0 / 216.0, -8.0, 3680.0 / 513.0, -845.0 / 4104.0],
        &[-8.0 / 27.0, 2.0, -3544.0 / 2565.0, 1859.0 / 4104.0, -11.0 / 40.0],
    ],
};
const WEIGHTS: &[f64] = &[25.0 / 216.0, 0.0, 1408.0 / 2565.0, 2197.0 / 4104.0, -1.0 / 5.0, 0.0];
/// The fourth-order result less the fifth-order one.
pub const ERROR: &[f64] = &[-1.0 / 360.0, 0.0, 128.0 / 4275.0, 2197.0 / 75240.0, -1.0 / 50.0, -2.0 / 55.0];
/// How far the rates of all stages are from a polynomial of fourth order in time: their divided difference over the nodes, scaled
/// such that positive weights add up to 1. Of a solution C/(t − a) of ẏ = −y/(t − a) the error is zero, within and across its
/// pole.
pub const COARSE: &[f64] =
    &[-385.0 / 10188.0, 352.0 / 849.0, -39424.0 / 48393.0, -28561.0 / 193572.0, 77.0 / 849.0, 140.0 / 283.0];
/// The weights of the powers of θ in the state at the share θ of a step: see the reference.
const EXTENSION: &[&[f64]] = &[
    &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    &[-91.0 / 36.0, 0.0, 896.0 / 171.0, -2197.0 / 684.0, 1.0, -2.0, 1.5],
    &[68.0 / 27.0, 0.0, -21248.0 / 2565.0, 4394.0 / 513.0, -2.8, 4.0, -4.0],
    &[-0.875, 0.0, 1024.0 / 285.0, -2197.0 / 456.0, 1.6, -2.0, 2.5],
];
const MORE: Tableau = Tableau { nodes: &[1.0], rows: &[WEIGHTS] };

pub const RECORD: Record = Record {
    name: "fehlberg",
    title: "RK-Fehlberg 4(5)",
    other_names: &["RKF45", "Runge-Kutta-Fehlberg"],
    false_friends: &["RK45", "RK-Merson"],
    order: 4,
    family: "Runge-Kutta",
    limit: 0.0,
    needs: Needs::Rates,
    carry: None,
    estimate: Some(Estimate { order: 5, error, coarse: Some(coarse), extension: Some(extension) }),
    section: "§12",
    reference: "E. Fehlberg, Low-order classical Runge-Kutta formulas with stepsize control, NASA TR R-315 (1969)",
    about: "Advances with the fourth-order result, by five evaluations; with tolerance= a sixth estimates its error by the \
            fifth-order one. It slowly adds energy to an undamped oscillator at every small step, r₁² = 1 + 0.0053·Φ⁶, and \
            damps it only for Φ between 2.374 and 3.202. Use Merson there. Local extrapolation is fehlberg_5.",
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

use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    tableau::{Tableau, combined, plus, powers},
};

const TABLEAU: Tableau = Tableau {
    nodes: &[0.0, 1.0 / 3.0, 1.0 / 3.0, 0.5, 1.0],
    rows: &[&[], &[1.0 / 3.0], &[1.0 / 6.0, 1.0 / 6.0], &[1.0 / 8.0, 0.0, 3.0 / 8.0], &[1.0 / 2.0, 0.0, -3.0 / 2.0, 2.0]],
};
const WEIGHTS: &[f64] = &[1.0 / 6.0, 0.0, 0.0, 2.0 / 3.0, 1.0 / 6.0];
const ERROR: &[f64] = &[1.0 / 15.0, 0.0, -0.3, 4.0 / 15.0, -1.0 / 30.0];
/// The weights of the powers of θ in the state at the share θ of a step: see the reference.
const EXTENSION: &[&[f64]] = &[
    &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    &[-4.0, 0.0, 0.0, -4.0 / 3.0, -1.875, 2.0, 125.0 / 24.0],
    &[17.0 / 3.0, 0.0, 0.0, 16.0 / 3.0, 53.0 / 12.0, -5.0, -125.0 / 12.0],
    &[-2.5, 0.0, 0.0, -10.0 / 3.0, -2.375, 3.0, 125.0 / 24.0],
];
const MORE: Tableau =
    Tableau { nodes: &[1.0, 0.2], rows: &[WEIGHTS, &[109.0 / 750.0, 0.0, 0.0, 26.0 / 375.0, 13.0 / 750.0, -0.032]] };

pub const RECORD: Record = Record {
    name: "merson",
    title: "RK-Merson",
    other_names: &["Kutta-Merson", "Merson 4(5)"],
    false_friends: &["Runge-Kutta 4", "RK-Fehlberg"],
    order: 4,
    family: "Runge-Kutta",
    limit: 3.464_101_615_137_754_6, // 2√3
    needs: Needs::Rates,
    carry: None,
    estimate: Some(Estimate { order: 5, error, coarse: None, extension: Some(extension) }),
    section: "§12",
    reference: "R. H. Merson, An operational method for the study of integration processes, Proc. Symp. Data Processing (1957)",
    about: "Five evaluations, fourth order, and an estimate of its own error for adaptive steps (tolerance=). It \
            damps an undamped oscillator very slightly, r₁² = 1 − Φ⁸/1728 + Φ¹⁰/20736, up to Φ = 2√3. The estimate is of fifth \
            order for linear equations and too large for others.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    plus(v, y, WEIGHTS, &TABLEAU.stages(s, t, h, v, y))
}

fn error(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    combined(ERROR, &TABLEAU.stages(s, t, h, v, y))
}

fn extension(s: Rates, t: Time, h: Length, v: Block, y: Block) -> Vec<(Block, Block)> {
    powers(EXTENSION, &MORE.stages_after(TABLEAU.stages(s, t, h, v, y), s, t, h, v, y))
}

use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    tableau::{Tableau, combined, plus, powers},
};

const TABLEAU: Tableau =
    Tableau { nodes: &[0.0, 0.5, 0.75, 1.0], rows: &[&[], &[0.5], &[0.0, 0.75], &[2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0]] };
const WEIGHTS: &[f64] = &[2.0 / 9.0, 1.0 / 3.0, 4.0 / 9.0, 0.0];
/// The third-order result less the second-order one.
const ERROR: &[f64] = &[-5.0 / 72.0, 1.0 / 12.0, 1.0 / 9.0, -1.0 / 8.0];
/// The weights of the powers of θ in the state at the share θ of a step: see the reference.
const EXTENSION: &[&[f64]] =
    &[&[1.0, 0.0, 0.0, 0.0], &[-4.0 / 3.0, 1.0, 4.0 / 3.0, -1.0], &[5.0 / 9.0, -2.0 / 3.0, -8.0 / 9.0, 1.0]];

pub const RECORD: Record = Record {
    name: "bs32",
    title: "Bogacki-Shampine 3(2)",
    other_names: &["RK23", "ode23", "BS3", "Bogacki-Shampine 2(3)"],
    false_friends: &["Rosenbrock 2(3)", "ode23s"],
    order: 3,
    family: "Runge-Kutta",
    limit: 1.732_050_807_568_877_2, // √3
    needs: Needs::Rates,
    carry: None,
    estimate: Some(Estimate { order: 3, error, coarse: None, extension: Some(extension) }),
    section: "not in Hoffmann (2002)",
    reference: "P. Bogacki, L. F. Shampine, A 3(2) pair of Runge-Kutta formulas, Appl. Math. Lett. 2 (1989) 321",
    about: "Three evaluations and third order, for one or two digits; with tolerance= a fourth evaluation, at the result, \
            estimates its error by one of second order. It damps an undamped oscillator, r₁² = 1 − Φ⁴/12 + Φ⁶/36, up to Φ = \
            √3.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    plus(v, y, WEIGHTS, &TABLEAU.stages(s, t, h, v, y))
}

fn error(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    combined(ERROR, &TABLEAU.stages(s, t, h, v, y))
}

fn extension(s: Rates, t: Time, h: Length, v: Block, y: Block) -> Vec<(Block, Block)> {
    powers(EXTENSION, &TABLEAU.stages(s, t, h, v, y))
}

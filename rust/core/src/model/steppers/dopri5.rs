use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    tableau::{Tableau, combined, plus},
};

const TABLEAU: Tableau = Tableau {
    nodes: &[0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0],
    rows: &[
        &[],
        &[0.2],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
        &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
        &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
    ],
};
const WEIGHTS: &[f64] = &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0];
/// The fifth-order result less the fourth-order one.
const ERROR: &[f64] = &[71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];

pub const RECORD: Record = Record {
    name: "dopri5",
    title: "Dormand-Prince 5(4)",
    other_names: &["DOPRI5", "RK45", "ode45", "DP5"],
    false_friends: &["RK-Fehlberg 5(4)", "RK-Fehlberg 4(5)", "Dormand-Prince 8(5,3)"],
    order: 5,
    family: "Runge-Kutta",
    limit: 0.997_189_008_632_529_9,
    needs: Needs::Rates,
    carry: None,
    estimate: Some(Estimate { order: 5, error, coarse: None }),
    section: "not in Hoffmann (2002)",
    reference: "J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comp. Appl. Math. 6 (1980) 19",
    about: "Six evaluations and fifth order; with tolerance= a seventh, at the result, estimates its error by one of fourth \
            order. It damps an undamped oscillator very slightly, r₁² = 1 − Φ⁶/1800 + Φ⁸/1600 − …, up to Φ = 0.997, and adds \
            energy beyond.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    plus(v, y, WEIGHTS, &TABLEAU.stages(s, t, h, v, y))
}

fn error(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    combined(ERROR, &TABLEAU.stages(s, t, h, v, y))
}

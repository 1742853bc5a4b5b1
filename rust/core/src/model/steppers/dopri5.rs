use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    tableau::{Tableau, combined, plus, powers},
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
/// The weights of the powers of θ in the state at the share θ of a step: see the reference.
const EXTENSION: &[&[f64]] = &[
    &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    &[
        -8048581381.0 / 2820520608.0,
        0.0,
        131558114200.0 / 32700410799.0,
        -1754552775.0 / 470086768.0,
        127303824393.0 / 49829197408.0,
        -282668133.0 / 205662961.0,
        40617522.0 / 29380423.0,
    ],
    &[
        8663915743.0 / 2820520608.0,
        0.0,
        -68118460800.0 / 10900136933.0,
        14199869525.0 / 1410260304.0,
        -318862633887.0 / 49829197408.0,
        2019193451.0 / 616988883.0,
        -110615467.0 / 29380423.0,
    ],
    &[
        -12715105075.0 / 11282082432.0,
        0.0,
        87487479700.0 / 32700410799.0,
        -10690763975.0 / 1880347072.0,
        701980252875.0 / 199316789632.0,
        -1453857185.0 / 822651844.0,
        69997945.0 / 29380423.0,
    ],
];

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
    estimate: Some(Estimate { order: 5, error, coarse: None, extension: Some(extension) }),
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

fn extension(s: Rates, t: Time, h: Length, v: Block, y: Block) -> Vec<(Block, Block)> {
    powers(EXTENSION, &TABLEAU.stages(s, t, h, v, y))
}

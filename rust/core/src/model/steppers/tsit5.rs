use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    tableau::{Tableau, combined, plus},
};

const TABLEAU: Tableau = Tableau {
    nodes: &[0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0, 1.0],
    rows: &[
        &[],
        &[0.161],
        &[-0.008480655492356989, 0.335480655492357],
        &[2.8971530571054935, -6.359448489975075, 4.3622954328695815],
        &[5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525],
        &[5.86145544294642, -12.92096931784711, 8.159367898576159, -0.071584973281401, -0.028269050394068383],
        &[0.09646076681806523, 0.01, 0.4798896504144996, 1.379008574103742, -3.290069515436081, 2.324710524099774],
    ],
};
const WEIGHTS: &[f64] =
    &[0.09646076681806523, 0.01, 0.4798896504144996, 1.379008574103742, -3.290069515436081, 2.324710524099774, 0.0];
/// The fifth-order result less the fourth-order one.
const ERROR: &[f64] = &[
    0.0017800110522257714,
    0.0008164344596567469,
    -0.007880878010261995,
    0.1447110071732629,
    -0.5823571654525552,
    0.45808210592918697,
    -0.015151515151515152,
];

pub const RECORD: Record = Record {
    name: "tsit5",
    title: "Tsitouras 5(4)",
    other_names: &["Tsit5", "Tsitouras 5"],
    false_friends: &["Dormand-Prince 5(4)"],
    order: 5,
    family: "Runge-Kutta",
    limit: 0.477_978_868_609_194, // by the numbers above as they are in double precision, which cost the tenth digit
    needs: Needs::Rates,
    carry: None,
    estimate: Some(Estimate { order: 5, error, coarse: None }),
    section: "not in Hoffmann (2002)",
    reference: "Ch. Tsitouras, Runge-Kutta pairs of order 5(4) satisfying only the first column simplifying assumption, \
            Comput. Math. Appl. 62 (2011) 770",
    about: "Six evaluations and fifth order, as Dormand-Prince 5(4), with smaller terms of sixth order in its error; with \
            tolerance= a seventh evaluation, at the result, estimates its error by one of fourth order. It damps an undamped \
            oscillator very slightly, r₁² = 1 − 8.7e-5·Φ⁶ + 3.9e-4·Φ⁸ − …, up to Φ = 0.478, and adds energy beyond.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    plus(v, y, WEIGHTS, &TABLEAU.stages(s, t, h, v, y))
}

fn error(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    combined(ERROR, &TABLEAU.stages(s, t, h, v, y))
}

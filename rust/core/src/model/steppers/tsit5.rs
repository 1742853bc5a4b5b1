use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    tableau::{Tableau, combined, plus, powers},
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
/// The weights of the powers of θ in the state at the share θ of a step: see the reference.
const EXTENSION: &[&[f64]] = &[
    &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    &[
        -2.763_706_197_274_826,
        0.131_699_999_999_999_98,
        3.930_296_236_894_751_6,
        -12.411_077_166_933_676,
        37.509_313_416_511_04,
        -27.896_526_289_197_286,
        1.5,
    ],
    &[
        2.913_255_461_821_912_6,
        -0.2234,
        -5.941_033_872_131_505,
        30.338_188_630_282_32,
        -88.178_904_894_766_4,
        65.091_894_674_793_66,
        -4.0,
    ],
    &[
        -1.053_088_497_729_021_6,
        0.1017,
        2.490_627_285_651_253,
        -16.548_102_889_244_902,
        47.379_521_962_819_28,
        -34.870_657_861_496_61,
        2.5,
    ],
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
    estimate: Some(Estimate { order: 5, error, coarse: None, extension: Some(extension) }),
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

fn extension(s: Rates, t: Time, h: Length, v: Block, y: Block) -> Vec<(Block, Block)> {
    powers(EXTENSION, &TABLEAU.stages(s, t, h, v, y))
}

use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    tableau::{Tableau, combined, plus},
};

#[rustfmt::skip]
const TABLEAU: Tableau = Tableau {
    nodes: &[0.0, 0.005, 0.10888888888888888, 0.16333333333333333, 0.4555, 0.6095094489978381, 0.884, 0.925, 1.0, 1.0],
    rows: &[
        &[],
        &[0.005],
        &[-1.07679012345679, 1.185679012345679],
        &[0.04083333333333333, 0.0, 0.1225],
        &[0.6389139236255726, 0.0, -2.455672638223657, 2.272258714598084],
        &[-2.6615773750187572, 0.0, 10.804513886456137, -8.3539146573962, 0.820487594956657],
        &[6.067741434696771, 0.0, -24.711273635911084, 20.427517930788895, -1.9061579788166472, 1.006172249242068],
        &[
            12.054670076253203, 0.0, -49.75478495046899, 41.142888638604674, -4.461760149974004, 2.042334822239175,
            -0.09834843665406108,
        ],
        &[
            10.138146522881808, 0.0, -42.6411360317175, 35.76384003992257, -4.3480228403929075, 2.0098622683770357,
            0.3487490460338272, -0.27143900510483127,
        ],
        &[
            -45.030072034298676, 0.0, 187.3272437654589, -154.02882369350186, 18.56465306347536, -7.141809679295079,
            1.3088085781613785, 0.0, 0.0,
        ],
    ],
};
#[rustfmt::skip]
const WEIGHTS: &[f64] = &[
    0.04715561848627222, 0.0, 0.0, 0.25750564298434153, 0.2621665397741262, 0.15216092656738558, 0.49399691700324844,
    -0.29430311714032503, 0.0813174723249511, 0.0,
];
/// The seventh-order result less the sixth-order one.
#[rustfmt::skip]
const ERROR: &[f64] = &[
    0.0025470118799310456, 0.0, 0.0, -0.00965839487279575, 0.0420647097563969, -0.0666822437469301, 0.26500974646212816,
    -0.29430311714032503, 0.0813174723249511, -0.020295184663356284,
];

pub const RECORD: Record = Record {
    name: "vern7",
    title: "Verner 7(6)",
    other_names: &["Vern7", "Verner 7"],
    false_friends: &["Verner 6(5)", "Verner 8(7)"],
    order: 7,
    family: "Runge-Kutta",
    limit: 0.0,
    needs: Needs::Rates,
    carry: None,
    estimate: Some(Estimate { order: 7, error, coarse: None }),
    section: "not in Hoffmann (2002)",
    reference: "J. H. Verner, Numerically optimal Runge-Kutta pairs with interpolants, Numer. Algorithms 53 (2010) 383",
    about: "Verner's most efficient pair of these orders: nine evaluations and seventh order, for tight tolerances \
            (tolerance=); a tenth evaluation estimates its error by one of sixth order. It very slowly adds energy to an \
            undamped oscillator, r₁² = 1 + 7.5e-7·Φ⁸, and damps it only for Φ between 1.962 and 4.585.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    plus(v, y, WEIGHTS, &TABLEAU.stages(s, t, h, v, y))
}

fn error(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    combined(ERROR, &TABLEAU.stages(s, t, h, v, y))
}

use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    rosenbrock::Rosenbrock,
    tableau::{combined, plus, powers},
};

const METHOD: Rosenbrock = Rosenbrock {
    gamma: 0.25,
    nodes: &[0.0, 0.386, 0.21, 0.63, 1.0, 1.0],
    by_time: &[0.25, -0.1043, 0.1035, -0.036_200_000_000_000_23, 0.0, 0.0],
    rows: &[
        &[],
        &[1.544],
        &[0.946_678_528_081_582_6, 0.255_701_169_898_328_4],
        &[3.314_825_187_068_521, 2.896_124_015_972_201, 0.998_641_913_997_781_7],
        &[1.221_224_509_226_641, 6.019_134_481_288_629, 12.537_083_329_320_87, -0.687_886_036_105_895],
        &[1.221_224_509_226_641, 6.019_134_481_288_629, 12.537_083_329_320_87, -0.687_886_036_105_895, 1.0],
    ],
    of_solutions: &[
        &[],
        &[-5.668_8],
        &[-2.430_093_356_833_875, -0.206_359_915_709_191_5],
        &[-0.107_352_905_815_137_5, -9.594_562_251_023_355, -20.470_286_148_096_16],
        &[7.496_443_313_967_647, -10.246_804_314_643_52, -33.999_903_528_199_05, 11.708_908_932_061_6],
        &[8.083_246_795_921_522, -7.981_132_988_064_893, -31.521_594_328_743_71, 16.319_305_431_231_36, -6.058_818_238_834_054],
    ],
};
const WEIGHTS: &[f64] = &[1.221_224_509_226_641, 6.019_134_481_288_629, 12.537_083_329_320_87, -0.687_886_036_105_895, 1.0, 1.0];
const ERROR: &[f64] = &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
/// The weights of the powers of θ in the state at the share θ of a step: see the reference.
const EXTENSION: &[&[f64]] = &[
    &[11.347_459_592_672_5, -1.468_861_396_321_538, -22.263_835_286_236_6, -8.680_657_743_674_718, 2.025_137_723_295_662, 1.0],
    &[-10.802_515_422_725_985, 13.575_710_529_290_182, 51.231_761_824_482_25, 32.759_996_821_752_69, -7.619_526_849_012_534, 0.0],
    &[
        0.676_280_339_280_125_3,
        -6.087_714_651_680_015,
        -16.430_843_208_924_78,
        -24.767_225_114_183_86,
        6.594_389_125_716_872,
        0.0,
    ],
];

pub const RECORD: Record = Record {
    name: "rodas4",
    title: "Rodas4",
    other_names: &["RODAS", "RODAS4(3)", "Rodas 4"],
    false_friends: &["Rodas5P", "Runge-Kutta 4", "ROS4"],
    order: 4,
    family: "Rosenbrock",
    limit: f64::INFINITY,
    needs: Needs::Rates,
    carry: None,
    estimate: Some(Estimate { order: 4, error, coarse: None, extension: Some(extension) }),
    section: "not in Hoffmann (2002)",
    reference: "E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, second edition (1996), section IV.7",
    about: "For stiff systems: six solutions of linear equations with one matrix, I − hJ/4, and no iteration. L-stable and stiffly \
            accurate: of any step it damps what decays fast, and its estimate of the error does, too. Every step has a Jacobian of \
            its own, from the operations of the rates.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    plus(v, y, WEIGHTS, &METHOD.stages(s, t, h, v, y))
}

fn error(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    combined(ERROR, &METHOD.stages(s, t, h, v, y))
}

fn extension(s: Rates, t: Time, h: Length, v: Block, y: Block) -> Vec<(Block, Block)> {
    powers(EXTENSION, &METHOD.stages(s, t, h, v, y))
}

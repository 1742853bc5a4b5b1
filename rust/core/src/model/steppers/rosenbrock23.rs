use crate::model::{
    method::{Estimate, Needs, Record},
    program::{Block, Length, Rates, Time},
    rosenbrock::Rosenbrock,
    tableau::{combined, plus, powers},
};

/// 1/(2 + √2), the γ in (0, ½) for which the step is L-stable, and its reciprocal.
const GAMMA: f64 = 0.292_893_218_813_452_4;
const OVER: f64 = 3.414_213_562_373_095;
const METHOD: Rosenbrock = Rosenbrock {
    gamma: GAMMA,
    nodes: &[0.0, 0.5, 1.0],
    by_time: &[GAMMA, 0.0, -GAMMA],
    rows: &[&[], &[0.5 * OVER], &[OVER, OVER]],
    of_solutions: &[&[], &[-OVER], &[-2.0 * OVER, -25.313_708_498_984_76]],
};
const WEIGHTS: &[f64] = &[OVER, OVER, 0.0];
const ERROR: &[f64] = &[OVER / 6.0, 3.080_880_229_039_762, OVER / 6.0];

/// The weights of the powers of θ in the state at the share θ of a step: see the reference.
const EXTENSION: &[&[f64]] = &[&[OVER, -2.0 * GAMMA / (1.0 - 2.0 * GAMMA) * OVER], &[0.0, OVER / (1.0 - 2.0 * GAMMA)]];

pub const RECORD: Record = Record {
    name: "rosenbrock23",
    title: "Rosenbrock 2(3)",
    other_names: &["ode23s", "modified Rosenbrock 2(3)", "Rosenbrock23"],
    false_friends: &["Bogacki-Shampine 2(3)", "ROS3P", "Rodas3"],
    order: 2,
    family: "Rosenbrock",
    limit: f64::INFINITY,
    needs: Needs::Rates,
    carry: None,
    estimate: Some(Estimate { order: 3, error, coarse: None, extension: Some(extension) }),
    section: "not in Hoffmann (2002)",
    reference: "L. F. Shampine, M. W. Reichelt, The MATLAB ODE suite, SIAM Journal on Scientific Computing 18 (1997) 1",
    about: "For stiff systems: three solutions of linear equations with one matrix, I − γhJ, and no iteration. L-stable: of any step \
            it damps what decays fast, and an undamped oscillator, too. Its estimate of the error is of third order. Every step has a \
            Jacobian of its own, from the operations of the rates.",
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

use crate::model::{
    method::{Needs, Record},
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "linearly_implicit_euler",
    title: "Linearly Implicit Euler",
    other_names: &["Rosenbrock-Euler", "ROS1", "Baraff-Witkin Euler"],
    false_friends: &["semi-implicit Euler", "Damped Euler", "IMEX Euler"],
    order: 1,
    family: "Rosenbrock",
    limit: f64::INFINITY,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "not in Hoffmann (2002)",
    reference: "D. Baraff, A. Witkin, Large steps in cloth simulation, SIGGRAPH 98 (1998) 43",
    about: "One solution of linear equations with the matrix I − hJ, and no iteration: what is left of Backward Euler after \
            one pass of Newton’s method. L-stable: of any step it damps what decays fast, and an undamped oscillator, too, \
            r₁² = 1/(1 + Φ²).",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    let end = t + h;
    let (dv, dy) = s.implicit(1.0, (s.dv(end, v, y), s.dy(end, v, y)));
    (v + dv, y + dy)
}

use crate::model::{
    method::{Needs, Record},
    newton,
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "backward_euler",
    title: "Backward Euler",
    other_names: &["implicit Euler", "BDF1"],
    false_friends: &["semi-implicit Euler", "Linearly Implicit Euler", "Damped Euler"],
    order: 1,
    family: "implicit",
    limit: f64::INFINITY,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "not in Hoffmann (2002)",
    reference: "E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, second edition (1996), section IV.3",
    about: "The increment is that of the rates at the end of the step, found by three passes of Newton’s method with the \
            Jacobian of its start: exact for linear systems. L-stable: of any step it damps what decays fast, and an \
            undamped oscillator, too, r₁² = 1/(1 + Φ²).",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    let end = t + h;
    let (dv, dy) = newton::solved(s, 1.0, (s.dv(end, v, y), s.dy(end, v, y)), |dv, dy| {
        let (v, y) = (v + dv, y + dy);
        (s.dv(end, v, y), s.dy(end, v, y))
    });
    (v + dv, y + dy)
}

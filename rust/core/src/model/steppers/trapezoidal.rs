use crate::model::{
    method::{Needs, Record},
    newton,
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "trapezoidal",
    title: "Trapezoidal",
    other_names: &["implicit trapezoidal rule", "Crank-Nicolson", "Tustin’s method"],
    false_friends: &["explicit trapezoidal rule", "Implicit Midpoint", "TR-BDF2"],
    order: 2,
    family: "implicit",
    limit: f64::INFINITY,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "not in Hoffmann (2002)",
    reference: "J. Crank, P. Nicolson, A practical method for numerical evaluation of solutions of partial differential equations, Proc. Camb. Phil. Soc. 43 (1947) 50",
    about: "The increment is the mean of the increments by the rates at both ends of the step, found by three passes of \
            Newton’s method with the Jacobian of its start: exact for linear systems. A-stable, and an undamped oscillator \
            keeps its amplitude by any step. What decays fast does not die out, but changes its sign at every step.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    let end = t + h;
    let (start_v, start_y) = (0.5 * s.dv(t, v, y), 0.5 * s.dy(t, v, y));
    let both = |v: Block, y: Block| (start_v + 0.5 * s.dv(end, v, y), start_y + 0.5 * s.dy(end, v, y));
    let (dv, dy) = newton::solved(s, 0.5, both(v, y), |dv, dy| both(v + dv, y + dy));
    (v + dv, y + dy)
}

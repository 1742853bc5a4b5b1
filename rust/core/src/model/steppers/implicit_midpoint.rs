use crate::model::{
    method::{Needs, Record},
    newton,
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "implicit_midpoint",
    title: "Implicit Midpoint",
    other_names: &["the Gauss method of order 2", "Gauss-Legendre with one stage"],
    false_friends: &["midpoint method", "Trapezoidal", "leapfrog"],
    order: 2,
    family: "implicit",
    limit: f64::INFINITY,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "not in Hoffmann (2002)",
    reference: "E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, second edition (2006), section VI.4",
    about: "The increment is that of the rates halfway between both ends of the step, found by three passes of Newton’s \
            method with the Jacobian of its start: exact for linear systems. A-stable, and an undamped oscillator keeps its \
            amplitude by any step. What decays fast does not die out, but changes its sign at every step.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    let middle = t + 0.5 * h;
    let (dv, dy) = newton::solved(s, 0.5, (s.dv(middle, v, y), s.dy(middle, v, y)), |dv, dy| {
        let (v, y) = (v + 0.5 * dv, y + 0.5 * dy);
        (s.dv(middle, v, y), s.dy(middle, v, y))
    });
    (v + dv, y + dy)
}

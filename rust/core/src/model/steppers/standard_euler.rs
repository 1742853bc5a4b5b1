use crate::model::{
    method::{Needs, Record},
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "standard_euler",
    title: "Standard Euler",
    other_names: &["forward Euler", "explicit Euler", "Euler's method"],
    false_friends: &["symplectic Euler", "backward Euler"],
    order: 1,
    family: "Runge-Kutta",
    limit: 0.0,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "§5",
    reference: "L. Euler, Institutionum calculi integralis, vol. 1, 1768",
    about: "Both blocks move by the rates at the start of the step. An undamped oscillator gains energy at every step, \
            however small: its radius grows by √(1 + Φ²).",
    step,
};

fn step(s: Rates, t: Time, _h: Length, v: Block, y: Block) -> (Block, Block) {
    let (dv, dy) = (s.dv(t, v, y), s.dy(t, v, y));
    (v + dv, y + dy)
}

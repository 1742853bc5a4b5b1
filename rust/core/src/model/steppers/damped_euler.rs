use crate::model::{
    method::{Needs, Record},
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "damped_euler",
    title: "Damped Euler",
    other_names: &["symplectic Euler, y first", "semi-implicit Euler (the other variant)"],
    false_friends: &["backward Euler", "Standard Euler with physical damping"],
    order: 1,
    family: "symplectic",
    limit: 2.0,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "§6",
    reference: "G. Hoffmann, Simple Integration Algorithms, 2002, §6",
    about: "Standard Euler, stabilised on the oscillator by an artificial damping D = Φ/2. That damping turns the new v \
            into v − Φ·(y + Φ·v): the force at the new y. So the method is False Euler with the blocks exchanged, y first \
            with the old v, then v with the new y; in this form it needs no ω₀ and runs on every system.",
    step,
};

fn step(s: Rates, t: Time, _h: Length, v: Block, y: Block) -> (Block, Block) {
    let y = y + s.dy(t, v, y);
    (v + s.dv(t, v, y), y) // with the new y
}

use crate::model::{
    method::{Needs, Record},
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "false_euler",
    title: "False Euler",
    other_names: &["symplectic Euler", "semi-implicit Euler", "Euler-Cromer"],
    false_friends: &["backward Euler", "implicit Euler", "Verlet (same frequency, other bookkeeping)"],
    order: 1,
    family: "symplectic",
    limit: 2.0,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "§7",
    reference: "A. Cromer, Stable solutions using the Euler approximation, Am. J. Phys. 49 (1981) 455",
    about: "The new v is used at once in the equation for y; that is all that is false about it. An undamped oscillator \
            neither gains nor loses: r₁ = 1 for every Φ below 2, more than π steps per period.",
    step,
};

fn step(s: Rates, t: Time, _h: Length, v: Block, y: Block) -> (Block, Block) {
    let v = v + s.dv(t, v, y);
    (v, y + s.dy(t, v, y)) // with the new v
}

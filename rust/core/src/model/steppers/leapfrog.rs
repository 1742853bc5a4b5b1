use crate::model::{
    method::{Carry, Needs, Record},
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "leapfrog",
    title: "Leapfrog",
    other_names: &["velocity Verlet", "kick-drift-kick", "Störmer-Verlet"],
    false_friends: &["False Euler", "Verlet"],
    order: 2,
    family: "symplectic",
    limit: 2.0,
    needs: Needs::Acceleration,
    carry: Some(Carry { name: "v_half", starts: &[], start, finish }),
    estimate: None,
    section: "§7",
    reference: "L. Verlet, Phys. Rev. 159 (1967) 98; E. Hairer, C. Lubich, G. Wanner, Acta Numerica 12 (2003) 399",
    about: "False Euler with a half kick at the start: between steps it carries the velocity of half a step ago, v − ½h·a. v and \
            y of a saved state belong to the same time, and both are of second order, for one function evaluation a step. Forces \
            that depend on v are refused, since v at the time of the force is not known when the force is evaluated.",
    step,
};

fn step(s: Rates, t: Time, _h: Length, v_half: Block, y: Block) -> (Block, Block) {
    let v_half = v_half + s.dv(t, v_half, y); // whatever the velocity
    (v_half, y + s.dy(t, v_half, y))
}

/// Half a kick back.
fn start(s: Rates, _choice: usize, t: Time, v: Block, y: Block) -> Block {
    v + -0.5 * s.dv(t, v, y)
}

/// Half a kick forward.
fn finish(s: Rates, _choice: usize, t: Time, v_half: Block, y: Block) -> Block {
    v_half + 0.5 * s.dv(t, v_half, y)
}

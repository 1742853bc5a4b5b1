use crate::model::{
    method::{Carry, Needs, Record},
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "wisdom_holman",
    title: "Wisdom-Holman",
    other_names: &["WHFast", "mixed-variable symplectic", "MVS"],
    false_friends: &["leapfrog", "SABA", "WHFast with a corrector"],
    order: 2,
    family: "symplectic",
    limit: 2.0,
    needs: Needs::Acceleration,
    carry: Some(Carry { name: "v_half", starts: &[], start, finish }),
    estimate: None,
    section: "not in Hoffmann (2002)",
    reference: "J. Wisdom, M. Holman, Symplectic maps for the N-body problem, Astron. J. 102 (1991) 1528",
    about: "Of bodies under Newton's force: Kepler's motion of each about the centre of mass of those before it, exact but for \
            roundings, and kicks by what else they do to each other. So the error is that of leapfrog times the masses of the \
            planets in units of the star's. The body in the middle comes first. A step that is too long for an orbit gives NaN; \
            close encounters need dop853 or taylor with a tolerance. On every other system it is leapfrog.",
    step,
};

fn step(s: Rates, t: Time, _h: Length, v_half: Block, y: Block) -> (Block, Block) {
    s.drift(1.0, v_half + s.kick(t, v_half, y), y)
}

/// Half a kick back.
fn start(s: Rates, _choice: usize, t: Time, v: Block, y: Block) -> Block {
    v + -0.5 * s.kick(t, v, y)
}

/// Half a kick forward.
fn finish(s: Rates, _choice: usize, t: Time, v_half: Block, y: Block) -> Block {
    v_half + 0.5 * s.kick(t, v_half, y)
}

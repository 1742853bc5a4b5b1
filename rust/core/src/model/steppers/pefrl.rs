use crate::model::{
    method::{Needs, Record},
    program::{Block, Length, Rates, Time},
};

const XI: f64 = 0.178_617_895_844_809_1;
const LAMBDA: f64 = -0.212_341_831_062_605_4;
const CHI: f64 = -0.066_264_582_669_818_5;

pub const RECORD: Record = Record {
    name: "pefrl",
    title: "PEFRL",
    other_names: &["position extended Forest-Ruth-like"],
    false_friends: &["Forest-Ruth", "Yoshida 4"],
    order: 4,
    family: "symplectic",
    limit: 2.989_449_545_906_73,
    needs: Needs::Acceleration,
    carry: None,
    estimate: None,
    section: "not in Hoffmann (2002)",
    reference: "I. P. Omelyan, I. M. Mryglod, R. Folk, Comput. Phys. Commun. 146 (2002) 188",
    about: "Five drifts with four kicks between them, symplectic and of fourth order: it keeps the energy of an orbit as \
            leapfrog does and is far more accurate for four times the work. Forces that depend on v are refused.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    let y = y + XI * s.dy(t, v, y);
    let v = v + (0.5 - LAMBDA) * s.dv(t + XI * h, v, y);
    let y = y + CHI * s.dy(t, v, y);
    let v = v + LAMBDA * s.dv(t + (XI + CHI) * h, v, y);
    let y = y + (1.0 - 2.0 * (CHI + XI)) * s.dy(t, v, y);
    let v = v + LAMBDA * s.dv(t + (1.0 - (XI + CHI)) * h, v, y);
    let y = y + CHI * s.dy(t, v, y);
    let v = v + (0.5 - LAMBDA) * s.dv(t + (1.0 - XI) * h, v, y);
    let y = y + XI * s.dy(t, v, y);
    (v, y)
}

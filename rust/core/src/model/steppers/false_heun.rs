use crate::model::{
    method::{Needs, Record},
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "false_heun",
    title: "False Heun",
    other_names: &[],
    false_friends: &["Standard Heun", "Semi-False Heun"],
    order: 1,
    family: "two-block Heun",
    limit: std::f64::consts::SQRT_2,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "§10",
    reference: "G. Hoffmann, Simple Integration Algorithms, 2002, §10",
    about: "Heun with the new v used at once in both equations for y. It damps an undamped oscillator, r₁² = 1 − Φ²/2, \
            and is of first order only. Hoffmann does not recommend it, and neither do we; it is here for comparison.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    let dv1 = s.dv(t, v, y);
    let v1 = v + dv1;
    let dy1 = s.dy(t, v1, y); // with the new v
    let y1 = y + dy1;
    let dv2 = s.dv(t + h, v1, y1);
    let v2 = v + dv2;
    let dy2 = s.dy(t + h, v2, y1); // with the newer v
    (v + 0.5 * (dv1 + dv2), y + 0.5 * (dy1 + dy2))
}

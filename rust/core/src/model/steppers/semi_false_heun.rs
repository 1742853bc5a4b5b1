use crate::model::{
    method::{Needs, Record},
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "semi_false_heun",
    title: "Semi-False Heun",
    other_names: &[],
    false_friends: &["Standard Heun", "False Heun"],
    order: 2,
    family: "two-block Heun",
    // √(2√5 − 2); Hoffmann's "always stable" is an erratum.
    limit: 1.572_302_755_514_846_6,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "§11",
    reference: "G. Hoffmann, Simple Integration Algorithms, 2002, §11",
    about: "Heun with the new v used in the second equation for y only. It damps an undamped oscillator slowly, \
            r₁² = 1 − Φ⁴/4, and is as accurate as Standard Heun, which is unstable.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    let (dv1, dy1) = (s.dv(t, v, y), s.dy(t, v, y));
    let (v1, y1) = (v + dv1, y + dy1);
    let dv2 = s.dv(t + h, v1, y1);
    let v2 = v + dv2;
    let dy2 = s.dy(t + h, v2, y1); // with the newer v
    (v + 0.5 * (dv1 + dv2), y + 0.5 * (dy1 + dy2))
}

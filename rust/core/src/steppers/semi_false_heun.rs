use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct SemiFalseHeun;

impl Stepper for SemiFalseHeun {
    const RECORD: Record = Record {
        name: "semi_false_heun",
        title: "Semi-False Heun",
        other_names: &[],
        false_friends: &["Standard Heun", "False Heun"],
        order: 2,
        evaluations: 2,
        family: "two-block Heun",
        // √(2√5 − 2); the document's "always stable" is an erratum.
        limit: 1.572_302_755_514_846_6,
        nodes: &[0.0, 1.0],
        needs: Needs::Rates,
        carry: None,
        starts: &[],
        error_order: None,
        section: "§11",
        reference: "G. Hoffmann, Simple Integration Algorithms, 2002, §11",
        about: "Heun with the new v used in the second equation for y only. It damps an undamped oscillator slowly, \
                r₁² = 1 − Φ⁴/4, and is as accurate as Standard Heun, which is unstable.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let ([dv1, dv2, ..], [dy1, dy2, ..]) = (&mut w.dv, &mut w.dy);
        s.dv(t, v, y, dv1);
        s.dy(t, v, y, dy1);
        w.v.sum(v, dv1);
        w.y.sum(y, dy1);
        s.dv(t + h, &w.v, &w.y, dv2);
        w.v.sum(v, dv2);
        s.dy(t + h, &w.v, &w.y, dy2); // with the newer v
        v.add_mean(dv1, dv2);
        y.add_mean(dy1, dy2);
    }
}

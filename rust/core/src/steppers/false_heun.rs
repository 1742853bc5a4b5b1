use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct FalseHeun;

impl Stepper for FalseHeun {
    const RECORD: Record = Record {
        name: "false_heun",
        title: "False Heun",
        other_names: &[],
        false_friends: &["Standard Heun", "Semi-False Heun"],
        order: 1,
        evaluations: 2,
        family: "two-block Heun",
        limit: std::f64::consts::SQRT_2,
        nodes: &[0.0, 1.0],
        needs: Needs::Rates,
        carry: None,
        starts: &[],
        error_order: None,
        section: "§10",
        reference: "G. Hoffmann, Simple Integration Algorithms, 2002, §10",
        about: "Heun with the new v used at once in both equations for y. It damps an undamped oscillator, r₁² = 1 − Φ²/2, \
                and is of first order only. The document does not recommend it, and neither do we; it is here to be looked at.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let ([dv1, dv2, ..], [dy1, dy2, ..]) = (&mut w.dv, &mut w.dy);
        s.dv(t, v, y, dv1);
        w.v.sum(v, dv1);
        s.dy(t, &w.v, y, dy1); // with the new v
        w.y.sum(y, dy1);
        s.dv(t + h, &w.v, &w.y, dv2);
        w.v.sum(v, dv2);
        s.dy(t + h, &w.v, &w.y, dy2); // with the newer v
        v.add_mean(dv1, dv2);
        y.add_mean(dy1, dy2);
    }
}

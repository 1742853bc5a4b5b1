use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct Merson;

const THIRD: f64 = 1.0 / 3.0;
const SIXTH: f64 = 1.0 / 6.0;

impl Stepper for Merson {
    const RECORD: Record = Record {
        name: "merson",
        title: "RK-Merson",
        other_names: &["Kutta-Merson", "Merson 4(5)"],
        false_friends: &["Runge-Kutta 4", "RK-Fehlberg"],
        order: 4,
        evaluations: 5,
        family: "Runge-Kutta",
        limit: 3.464_101_615_137_754_6, // 2√3
        nodes: &[0.0, 1.0 / 3.0, 0.5, 1.0],
        needs: Needs::Rates,
        carry: None,
        starts: &[],
        error_order: Some(5),
        section: "§12",
        reference: "R. H. Merson, An operational method for the study of integration processes, Proc. Symp. Data Processing (1957)",
        about: "Five evaluations, fourth order, and an estimate of its own error for steps of chosen length (tolerance=). It \
                damps an undamped oscillator very slightly, r₁² = 1 − Φ⁸/1728, up to Φ = 2√3. The estimate is of fifth order for \
                linear equations and too large for others.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let ([dv1, dv2, dv3, dv4, dv5, ..], [dy1, dy2, dy3, dy4, dy5, ..]) = (&mut w.dv, &mut w.dy);
        let (third, half) = (t + THIRD * h, t + 0.5 * h);
        s.dv(t, v, y, dv1);
        s.dy(t, v, y, dy1);
        w.v.sum_weighted(v, [(THIRD, dv1)]);
        w.y.sum_weighted(y, [(THIRD, dy1)]);
        s.dv(third, &w.v, &w.y, dv2);
        s.dy(third, &w.v, &w.y, dy2);
        w.v.sum_weighted(v, [(SIXTH, dv1), (SIXTH, dv2)]);
        w.y.sum_weighted(y, [(SIXTH, dy1), (SIXTH, dy2)]);
        s.dv(third, &w.v, &w.y, dv3);
        s.dy(third, &w.v, &w.y, dy3);
        w.v.sum_weighted(v, [(0.125, dv1), (0.375, dv3)]);
        w.y.sum_weighted(y, [(0.125, dy1), (0.375, dy3)]);
        s.dv(half, &w.v, &w.y, dv4);
        s.dy(half, &w.v, &w.y, dy4);
        w.v.sum_weighted(v, [(0.5, dv1), (-1.5, dv3), (2.0, dv4)]);
        w.y.sum_weighted(y, [(0.5, dy1), (-1.5, dy3), (2.0, dy4)]);
        s.dv(t + h, &w.v, &w.y, dv5);
        s.dy(t + h, &w.v, &w.y, dy5);
        v.add_weighted([(SIXTH, dv1), (2.0 / 3.0, dv4), (SIXTH, dv5)]);
        y.add_weighted([(SIXTH, dy1), (2.0 / 3.0, dy4), (SIXTH, dy5)]);
    }

    #[inline(always)]
    fn error<S: System>(w: &mut Work<S>) {
        let ([dv1, _, dv3, dv4, dv5, ..], [dy1, _, dy3, dy4, dy5, ..]) = (&w.dv, &w.dy);
        w.v.set_weighted([(1.0 / 15.0, dv1), (-0.3, dv3), (4.0 / 15.0, dv4), (-1.0 / 30.0, dv5)]);
        w.y.set_weighted([(1.0 / 15.0, dy1), (-0.3, dy3), (4.0 / 15.0, dy4), (-1.0 / 30.0, dy5)]);
    }
}

use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct Fehlberg;

impl Stepper for Fehlberg {
    const RECORD: Record = Record {
        name: "fehlberg",
        title: "RK-Fehlberg 4(5)",
        other_names: &["RKF45", "Runge-Kutta-Fehlberg"],
        false_friends: &["RK45, which is Dormand-Prince", "RK-Merson"],
        order: 4,
        evaluations: 6,
        family: "Runge-Kutta",
        limit: 0.0,
        nodes: &[0.0, 0.25, 0.375, 0.5, 12.0 / 13.0, 1.0],
        needs: Needs::Rates,
        carry: None,
        starts: &[],
        error_order: Some(5),
        section: "§12",
        reference: "E. Fehlberg, Low-order classical Runge-Kutta formulas with stepsize control, NASA TR R-315 (1969)",
        about: "Six evaluations; goes on with the fourth-order result and estimates its error by the fifth-order one \
                (tolerance=). It slowly pumps energy into an undamped oscillator at every small step, r₁² = 1 + 0.0053·Φ⁶, and \
                damps it only for Φ between 2.374 and 3.202. Use Merson there. Local extrapolation is fehlberg_5.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        stages(s, t, h, v, y, w);
        let ([dv1, _, dv3, dv4, dv5, _], [dy1, _, dy3, dy4, dy5, _]) = (&w.dv, &w.dy);
        v.add_weighted([(25.0 / 216.0, dv1), (1408.0 / 2565.0, dv3), (2197.0 / 4104.0, dv4), (-0.2, dv5)]);
        y.add_weighted([(25.0 / 216.0, dy1), (1408.0 / 2565.0, dy3), (2197.0 / 4104.0, dy4), (-0.2, dy5)]);
    }

    #[inline(always)]
    fn error<S: System>(w: &mut Work<S>) {
        difference(w);
    }
}

/// Six increments of each block, which both of Fehlberg's results share.
#[inline(always)]
pub fn stages<S: System>(s: &mut S, t: f64, h: f64, v: &S::V, y: &S::Y, w: &mut Work<S>) {
    let ([dv1, dv2, dv3, dv4, dv5, dv6], [dy1, dy2, dy3, dy4, dy5, dy6]) = (&mut w.dv, &mut w.dy);
    s.dv(t, v, y, dv1);
    s.dy(t, v, y, dy1);
    w.v.sum_weighted(v, [(0.25, dv1)]);
    w.y.sum_weighted(y, [(0.25, dy1)]);
    s.dv(t + 0.25 * h, &w.v, &w.y, dv2);
    s.dy(t + 0.25 * h, &w.v, &w.y, dy2);
    w.v.sum_weighted(v, [(3.0 / 32.0, dv1), (9.0 / 32.0, dv2)]);
    w.y.sum_weighted(y, [(3.0 / 32.0, dy1), (9.0 / 32.0, dy2)]);
    s.dv(t + 0.375 * h, &w.v, &w.y, dv3);
    s.dy(t + 0.375 * h, &w.v, &w.y, dy3);
    w.v.sum_weighted(v, [(1932.0 / 2197.0, dv1), (-7200.0 / 2197.0, dv2), (7296.0 / 2197.0, dv3)]);
    w.y.sum_weighted(y, [(1932.0 / 2197.0, dy1), (-7200.0 / 2197.0, dy2), (7296.0 / 2197.0, dy3)]);
    s.dv(t + 12.0 / 13.0 * h, &w.v, &w.y, dv4);
    s.dy(t + 12.0 / 13.0 * h, &w.v, &w.y, dy4);
    w.v.sum_weighted(v, [(439.0 / 216.0, dv1), (-8.0, dv2), (3680.0 / 513.0, dv3), (-845.0 / 4104.0, dv4)]);
    w.y.sum_weighted(y, [(439.0 / 216.0, dy1), (-8.0, dy2), (3680.0 / 513.0, dy3), (-845.0 / 4104.0, dy4)]);
    s.dv(t + h, &w.v, &w.y, dv5);
    s.dy(t + h, &w.v, &w.y, dy5);
    w.v.sum_weighted(v, [(-8.0 / 27.0, dv1), (2.0, dv2), (-3544.0 / 2565.0, dv3), (1859.0 / 4104.0, dv4), (-0.275, dv5)]);
    w.y.sum_weighted(y, [(-8.0 / 27.0, dy1), (2.0, dy2), (-3544.0 / 2565.0, dy3), (1859.0 / 4104.0, dy4), (-0.275, dy5)]);
    s.dv(t + 0.5 * h, &w.v, &w.y, dv6);
    s.dy(t + 0.5 * h, &w.v, &w.y, dy6);
}

/// The fourth-order result less the fifth-order one.
#[inline(always)]
pub fn difference<S: System>(w: &mut Work<S>) {
    let ([dv1, _, dv3, dv4, dv5, dv6], [dy1, _, dy3, dy4, dy5, dy6]) = (&w.dv, &w.dy);
    w.v.set_weighted([
        (-1.0 / 360.0, dv1),
        (128.0 / 4275.0, dv3),
        (2197.0 / 75240.0, dv4),
        (-1.0 / 50.0, dv5),
        (-2.0 / 55.0, dv6),
    ]);
    w.y.set_weighted([
        (-1.0 / 360.0, dy1),
        (128.0 / 4275.0, dy3),
        (2197.0 / 75240.0, dy4),
        (-1.0 / 50.0, dy5),
        (-2.0 / 55.0, dy6),
    ]);
}

use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct Rk4;

impl Stepper for Rk4 {
    const RECORD: Record = Record {
        name: "rk4",
        title: "Runge-Kutta 4",
        other_names: &["the classical Runge-Kutta method", "Kutta's fourth-order method"],
        false_friends: &["Kutta's 3/8 rule", "Gill's method", "RK45"],
        order: 4,
        evaluations: 4,
        family: "Runge-Kutta",
        limit: 2.0 * std::f64::consts::SQRT_2,
        nodes: &[0.0, 0.5, 1.0],
        needs: Needs::Rates,
        carry: None,
        starts: &[],
        error_order: None,
        section: "§12",
        reference: "W. Kutta, Beitrag zur näherungsweisen Integration totaler Differentialgleichungen, Z. Math. Phys. 46 (1901) 435",
        about: "Four evaluations, fourth order. It damps an undamped oscillator slightly, r₁² = 1 − Φ⁶/72 + Φ⁸/576, up to \
                Φ = 2√2.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let ([dv1, dv2, dv3, dv4, ..], [dy1, dy2, dy3, dy4, ..]) = (&mut w.dv, &mut w.dy);
        let half = t + 0.5 * h;
        s.dv(t, v, y, dv1);
        s.dy(t, v, y, dy1);
        w.v.sum_scaled(v, 0.5, dv1);
        w.y.sum_scaled(y, 0.5, dy1);
        s.dv(half, &w.v, &w.y, dv2);
        s.dy(half, &w.v, &w.y, dy2);
        w.v.sum_scaled(v, 0.5, dv2);
        w.y.sum_scaled(y, 0.5, dy2);
        s.dv(half, &w.v, &w.y, dv3);
        s.dy(half, &w.v, &w.y, dy3);
        w.v.sum(v, dv3);
        w.y.sum(y, dy3);
        s.dv(t + h, &w.v, &w.y, dv4);
        s.dy(t + h, &w.v, &w.y, dy4);
        v.add_kutta(dv1, dv2, dv3, dv4);
        y.add_kutta(dy1, dy2, dy3, dy4);
    }
}

use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct StandardHeun;

impl Stepper for StandardHeun {
    const RECORD: Record = Record {
        name: "standard_heun",
        title: "Standard Heun",
        other_names: &["Heun's method", "explicit trapezoidal rule", "improved Euler", "RK2 (trapezoidal)"],
        false_friends: &["midpoint method", "Ralston's method", "Heun's third-order method"],
        order: 2,
        evaluations: 2,
        family: "Runge-Kutta",
        limit: 0.0,
        nodes: &[0.0, 1.0],
        needs: Needs::Rates,
        carry: None,
        starts: &[],
        error_order: None,
        section: "§9",
        reference: "K. Heun, Neue Methoden zur approximativen Integration, Z. Math. Phys. 45 (1900) 23",
        about: "A predictor by Standard Euler, then the mean of the increments at both ends. An undamped oscillator gains \
                energy at every step, but slowly: r₁² = 1 + Φ⁴/4.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let ([dv1, dv2, ..], [dy1, dy2, ..]) = (&mut w.dv, &mut w.dy);
        s.dv(t, v, y, dv1);
        s.dy(t, v, y, dy1);
        w.v.sum(v, dv1);
        w.y.sum(y, dy1);
        s.dv(t + h, &w.v, &w.y, dv2);
        s.dy(t + h, &w.v, &w.y, dy2);
        v.add_mean(dv1, dv2);
        y.add_mean(dy1, dy2);
    }
}

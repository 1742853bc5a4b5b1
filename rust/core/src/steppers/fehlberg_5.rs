use super::fehlberg::{difference, stages};
use crate::{
    block::Work,
    stepper::{Needs, Record, Stepper},
    system::System,
    tableau::go_on,
};

pub struct Fehlberg5;

impl Stepper for Fehlberg5 {
    const RECORD: Record = Record {
        name: "fehlberg_5",
        title: "RK-Fehlberg 5(4)",
        other_names: &["RKF45 with local extrapolation"],
        false_friends: &["RK-Fehlberg 4(5)", "Dormand-Prince 5(4)"],
        order: 5,
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
        about: "RK-Fehlberg with local extrapolation: the same six evaluations, going on with the fifth-order result. It too pumps \
                energy into an undamped oscillator, r₁² = 1 + 0.0018·Φ⁶, and damps it only for Φ between 2.046 and 3.607.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        stages(s, t, h, v, y, w);
        go_on(v, y, w, [(0, 16.0 / 135.0), (2, 6656.0 / 12825.0), (3, 28561.0 / 56430.0), (4, -0.18), (5, 2.0 / 55.0)]);
    }

    #[inline(always)]
    fn error<S: System>(w: &mut Work<S>) {
        difference(w);
    }
}

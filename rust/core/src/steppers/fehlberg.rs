use crate::{
    block::Work,
    stepper::{Needs, Record, Stepper},
    system::System,
    tableau::{estimate, first, go_on, stage},
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
        go_on(v, y, w, [(0, 25.0 / 216.0), (2, 1408.0 / 2565.0), (3, 2197.0 / 4104.0), (4, -0.2)]);
    }

    #[inline(always)]
    fn error<S: System>(w: &mut Work<S>) {
        difference(w);
    }
}

/// Six increments of each block, which both of Fehlberg's results share.
#[inline(always)]
pub fn stages<S: System>(s: &mut S, t: f64, h: f64, v: &S::V, y: &S::Y, w: &mut Work<S>) {
    first(s, t, v, y, w);
    stage(s, t + 0.25 * h, v, y, w, 1, [(0, 0.25)]);
    stage(s, t + 0.375 * h, v, y, w, 2, [(0, 3.0 / 32.0), (1, 9.0 / 32.0)]);
    stage(s, t + 12.0 / 13.0 * h, v, y, w, 3, [(0, 1932.0 / 2197.0), (1, -7200.0 / 2197.0), (2, 7296.0 / 2197.0)]);
    stage(s, t + h, v, y, w, 4, [(0, 439.0 / 216.0), (1, -8.0), (2, 3680.0 / 513.0), (3, -845.0 / 4104.0)]);
    let last = [(0, -8.0 / 27.0), (1, 2.0), (2, -3544.0 / 2565.0), (3, 1859.0 / 4104.0), (4, -0.275)];
    stage(s, t + 0.5 * h, v, y, w, 5, last);
}

/// The fourth-order result less the fifth-order one.
#[inline(always)]
pub fn difference<S: System>(w: &mut Work<S>) {
    estimate(w, [(0, -1.0 / 360.0), (2, 128.0 / 4275.0), (3, 2197.0 / 75240.0), (4, -1.0 / 50.0), (5, -2.0 / 55.0)]);
}

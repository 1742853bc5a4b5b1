use crate::{
    block::Work,
    stepper::{Needs, Record, Stepper},
    system::System,
    tableau::{estimate, first, go_on, stage},
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
        first(s, t, v, y, w);
        stage(s, t + THIRD * h, v, y, w, 1, [(0, THIRD)]);
        stage(s, t + THIRD * h, v, y, w, 2, [(0, SIXTH), (1, SIXTH)]);
        stage(s, t + 0.5 * h, v, y, w, 3, [(0, 0.125), (2, 0.375)]);
        stage(s, t + h, v, y, w, 4, [(0, 0.5), (2, -1.5), (3, 2.0)]);
        go_on(v, y, w, [(0, SIXTH), (3, 2.0 / 3.0), (4, SIXTH)]);
    }

    #[inline(always)]
    fn error<S: System>(w: &mut Work<S>) {
        estimate(w, [(0, 1.0 / 15.0), (2, -0.3), (3, 4.0 / 15.0), (4, -1.0 / 30.0)]);
    }
}

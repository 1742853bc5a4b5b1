use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct StandardEuler;

impl Stepper for StandardEuler {
    const RECORD: Record = Record {
        name: "standard_euler",
        title: "Standard Euler",
        other_names: &["forward Euler", "explicit Euler"],
        false_friends: &["symplectic Euler", "backward Euler"],
        order: 1,
        evaluations: 1,
        family: "Runge-Kutta",
        limit: 0.0,
        nodes: &[0.0],
        needs: Needs::Rates,
        carry: None,
        starts: &[],
        error_order: None,
        section: "§5",
        reference: "L. Euler, Institutionum calculi integralis, vol. 1, 1768",
        about: "Both blocks move by the rates at the start of the step. An undamped oscillator gains energy at every step, \
                however small: its radius grows by √(1 + Φ²).",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, _h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let ([dv, ..], [dy, ..]) = (&mut w.dv, &mut w.dy);
        s.dv(t, v, y, dv);
        s.dy(t, v, y, dy);
        v.add(dv);
        y.add(dy);
    }
}

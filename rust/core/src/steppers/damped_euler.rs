use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct DampedEuler;

impl Stepper for DampedEuler {
    const RECORD: Record = Record {
        name: "damped_euler",
        title: "Damped Euler",
        other_names: &["symplectic Euler, y first", "semi-implicit Euler (the other variant)"],
        false_friends: &["backward Euler", "Standard Euler with physical damping"],
        order: 1,
        evaluations: 1,
        family: "symplectic",
        limit: 2.0,
        nodes: &[0.0],
        needs: Needs::Rates,
        carry: None,
        starts: &[],
        error_order: None,
        section: "§6",
        reference: "G. Hoffmann, Simple Integration Algorithms, 2002, §6",
        about: "Standard Euler, stabilised on the oscillator by an artificial damping D = Φ/2. That damping turns the new v \
                into v − Φ·(y + Φ·v): the force at the new y. So the method is False Euler with the blocks exchanged, y first \
                with the old v, then v with the new y; in this form it needs no ω₀ and runs on every system.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, _h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let ([dv, ..], [dy, ..]) = (&mut w.dv, &mut w.dy);
        s.dy(t, v, y, dy);
        y.add(dy);
        s.dv(t, v, y, dv); // with the new y
        v.add(dv);
    }
}

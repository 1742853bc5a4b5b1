use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct FalseEuler;

impl Stepper for FalseEuler {
    const RECORD: Record = Record {
        name: "false_euler",
        title: "False Euler",
        other_names: &["symplectic Euler", "semi-implicit Euler", "Euler-Cromer"],
        false_friends: &["backward Euler", "implicit Euler", "Verlet (same frequency, other bookkeeping)"],
        order: 1,
        evaluations: 1,
        family: "symplectic",
        limit: 2.0,
        nodes: &[0.0],
        needs: Needs::Rates,
        carry: None,
        starts: &[],
        error_order: None,
        section: "§7",
        reference: "A. Cromer, Stable solutions using the Euler approximation, Am. J. Phys. 49 (1981) 455",
        about: "The new v is used at once in the equation for y; that is all that is false about it. An undamped oscillator \
                neither gains nor loses: r₁ = 1 for every Φ below 2, more than π steps per period.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, _h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let ([dv, ..], [dy, ..]) = (&mut w.dv, &mut w.dy);
        s.dv(t, v, y, dv);
        v.add(dv);
        s.dy(t, v, y, dy); // with the new v
        y.add(dy);
    }
}

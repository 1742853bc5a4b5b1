use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct Leapfrog;

impl Stepper for Leapfrog {
    const RECORD: Record = Record {
        name: "leapfrog",
        title: "Leapfrog",
        other_names: &["velocity Verlet", "kick-drift-kick", "Störmer-Verlet"],
        false_friends: &["False Euler", "Verlet"],
        order: 2,
        evaluations: 1,
        family: "symplectic",
        limit: 2.0,
        nodes: &[0.0],
        needs: Needs::Acceleration,
        carry: Some("v_half"),
        starts: &[],
        error_order: None,
        section: "§7",
        reference: "L. Verlet, Phys. Rev. 159 (1967) 98; E. Hairer, C. Lubich, G. Wanner, Acta Numerica 12 (2003) 399",
        about: "False Euler with a half kick at the start: between steps it carries the velocity of half a step ago, v − ½h·a. v and \
                y of a kept state belong to the same instant, and both are of second order, for one rate evaluation a step. Forces \
                that depend on v are refused, since no v of the force's instant is known when it is asked for.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, _h: f64, v_half: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let ([dv, ..], [dy, ..]) = (&mut w.dv, &mut w.dy);
        s.dv(t, v_half, y, dv); // whatever the velocity
        v_half.add(dv);
        s.dy(t, v_half, y, dy);
        y.add(dy);
    }

    #[inline(always)]
    fn start<S: System>(s: &mut S, _choice: usize, t: f64, v: &mut S::V, y: &S::Y, w: &mut Work<S>) {
        let [dv, ..] = &mut w.dv;
        s.dv(t, v, y, dv);
        v.add_scaled(-0.5, dv);
    }

    #[inline(always)]
    fn finish<S: System>(s: &mut S, _choice: usize, t: f64, v: &mut S::V, y: &S::Y, w: &mut Work<S>) {
        let [dv, ..] = &mut w.dv;
        s.dv(t, v, y, dv);
        v.add_scaled(0.5, dv);
    }
}

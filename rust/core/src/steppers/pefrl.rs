use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct Pefrl;

const XI: f64 = 0.178_617_895_844_809_1;
const LAMBDA: f64 = -0.212_341_831_062_605_4;
const CHI: f64 = -0.066_264_582_669_818_5;

impl Stepper for Pefrl {
    const RECORD: Record = Record {
        name: "pefrl",
        title: "PEFRL",
        other_names: &["position extended Forest-Ruth-like"],
        false_friends: &["Forest-Ruth", "Yoshida 4"],
        order: 4,
        evaluations: 4,
        family: "symplectic",
        limit: 2.989_449_545_906_73,
        nodes: &[XI + CHI, XI, 1.0 - XI, 1.0 - (XI + CHI)],
        needs: Needs::Acceleration,
        carry: None,
        starts: &[],
        error_order: None,
        section: "not in the document",
        reference: "I. P. Omelyan, I. M. Mryglod, R. Folk, Comput. Phys. Commun. 146 (2002) 188",
        about: "Five drifts with four kicks between them, symplectic and of fourth order: it keeps the energy of an orbit as \
                leapfrog does and is far more exact for four times the work. Forces that depend on v are refused.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let ([dv, ..], [dy, ..]) = (&mut w.dv, &mut w.dy);
        s.dy(t, v, y, dy);
        y.add_scaled(XI, dy);
        s.dv(t + XI * h, v, y, dv);
        v.add_scaled(0.5 - LAMBDA, dv);
        s.dy(t, v, y, dy);
        y.add_scaled(CHI, dy);
        s.dv(t + (XI + CHI) * h, v, y, dv);
        v.add_scaled(LAMBDA, dv);
        s.dy(t, v, y, dy);
        y.add_scaled(1.0 - 2.0 * (CHI + XI), dy);
        s.dv(t + (1.0 - (XI + CHI)) * h, v, y, dv);
        v.add_scaled(LAMBDA, dv);
        s.dy(t, v, y, dy);
        y.add_scaled(CHI, dy);
        s.dv(t + (1.0 - XI) * h, v, y, dv);
        v.add_scaled(0.5 - LAMBDA, dv);
        s.dy(t, v, y, dy);
        y.add_scaled(XI, dy);
    }
}

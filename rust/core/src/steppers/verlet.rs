use crate::{
    block::{Block, Work},
    stepper::{Needs, Record, Stepper},
    system::System,
};

pub struct Verlet;

impl Stepper for Verlet {
    const RECORD: Record = Record {
        name: "verlet",
        title: "Verlet",
        other_names: &["Störmer-Verlet", "position Verlet of games", "leapfrog without velocities"],
        false_friends: &["velocity Verlet", "Beeman"],
        order: 2,
        evaluations: 1,
        family: "symplectic",
        limit: 2.0,
        nodes: &[0.0],
        needs: Needs::Acceleration,
        carry: Some("y_prev"),
        starts: &["second_order", "first_order"],
        error_order: None,
        section: "§8",
        reference: "L. Verlet, Computer experiments on classical fluids, Phys. Rev. 159 (1967) 98",
        about: "y is advanced from its last two values: y + (y − y_prev) + h²·a. There is no v between steps. With the start \
                \"second_order\", y₋₁ = y₀ − h·v₀ + ½h²·a₀, v is the velocity at the same instant as y, \
                (y − y_prev)/h + ½h·a, and both are of second order. With \"first_order\", y₋₁ = y₀ − h·v₀ (the document's \
                y₋₁ = y₀ for v₀ = 0), v is the secant (y − y_prev)/h, half a step old; y and v are then those of False Euler, \
                of first order. Forces that depend on v are refused: the v of the present instant is known only after \
                the step, and any older one makes the method lose its order and its stability.",
    };

    #[inline(always)]
    fn step<S: System>(s: &mut S, t: f64, _h: f64, v: &mut S::V, y: &mut S::Y, w: &mut Work<S>) {
        let y_prev = v;
        let ([dv, ..], [dy, ..]) = (&mut w.dv, &mut w.dy);
        s.dv(t, y_prev, y, dv); // h·a, whatever the velocity
        s.dy(t, dv, y, dy); // h²·a
        for ((p, y), d) in y_prev.numbers_mut().iter_mut().zip(y.numbers_mut()).zip(dy.numbers()) {
            let next = (2.0 * *y - *p) + *d;
            *p = *y;
            *y = next;
        }
    }

    #[inline(always)]
    fn start<S: System>(s: &mut S, choice: usize, t: f64, v: &mut S::V, y: &S::Y, w: &mut Work<S>) {
        let ([dv, ..], [dy, ..]) = (&mut w.dv, &mut w.dy);
        s.dv(t, v, y, dv);
        s.dy(t, v, y, dy); // h·v₀
        for ((p, y), d) in v.numbers_mut().iter_mut().zip(y.numbers()).zip(dy.numbers()) {
            *p = *y - *d;
        }
        if choice == 0 {
            s.dy(t, dv, y, dy); // h²·a₀
            v.add_scaled(0.5, dy);
        }
    }

    #[inline(always)]
    fn finish<S: System>(s: &mut S, choice: usize, t: f64, v: &mut S::V, y: &S::Y, w: &mut Work<S>) {
        let ([dv, ..], [dy, ..]) = (&mut w.dv, &mut w.dy);
        s.dv(t, v, y, dv);
        for ((d, y), p) in dy.numbers_mut().iter_mut().zip(y.numbers()).zip(v.numbers()) {
            *d = *y - *p;
        }
        s.velocity(dy, v);
        if choice == 0 {
            v.add_scaled(0.5, dv);
        }
    }
}

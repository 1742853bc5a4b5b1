use crate::model::{
    method::{Carry, Needs, Record},
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "verlet",
    title: "Verlet",
    other_names: &["Störmer-Verlet", "position Verlet of games", "leapfrog without velocities"],
    false_friends: &["velocity Verlet", "Beeman"],
    order: 2,
    family: "symplectic",
    limit: 2.0,
    needs: Needs::Acceleration,
    carry: Some(Carry { name: "y_prev", starts: &["second_order", "first_order"], start, finish }),
    estimate: None,
    section: "§8",
    reference: "L. Verlet, Computer experiments on classical fluids, Phys. Rev. 159 (1967) 98",
    about: "y is advanced from its last two values: y + (y − y_prev) + h²·a. There is no v between steps. With the start \
            \"second_order\", y₋₁ = y₀ − h·v₀ + ½h²·a₀, v is the velocity at the same instant as y, \
            (y − y_prev)/h + ½h·a, and both are of second order. With \"first_order\", y₋₁ = y₀ − h·v₀ (Hoffmann's \
            y₋₁ = y₀ for v₀ = 0), v is the secant (y − y_prev)/h, half a step old; y and v are then those of False Euler, \
            of first order. Forces that depend on v are refused: the v of the present instant is known only after \
            the step, and any older one makes the method lose its order and its stability.",
    step,
};

/// h²·a is the increment of y that the increment of v makes, whatever the velocity.
fn step(s: Rates, t: Time, _h: Length, y_prev: Block, y: Block) -> (Block, Block) {
    let d = s.dy(t, s.dv(t, y_prev, y), y);
    (y, (2.0 * y - y_prev) + d)
}

/// y one step ago: y₀ − h·v₀, and ½h²·a₀ more for the second-order start.
fn start(s: Rates, choice: usize, t: Time, v: Block, y: Block) -> Block {
    let y_prev = y - s.dy(t, v, y);
    if choice == 0 { y_prev + 0.5 * s.dy(t, s.dv(t, v, y), y) } else { y_prev }
}

/// The velocity: what `start` would have begun with.
fn finish(s: Rates, choice: usize, t: Time, y_prev: Block, y: Block) -> Block {
    let v = s.velocity(y - y_prev);
    if choice == 0 { v + 0.5 * s.dv(t, y_prev, y) } else { v }
}

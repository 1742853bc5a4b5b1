use crate::model::{
    method::{Needs, Record},
    program::{Block, Length, Rates, Time},
};

pub const RECORD: Record = Record {
    name: "standard_heun",
    title: "Standard Heun",
    other_names: &["Heun's method", "explicit trapezoidal rule", "improved Euler", "RK2 (trapezoidal)"],
    false_friends: &["midpoint method", "Ralston's method", "Heun's third-order method"],
    order: 2,
    family: "Runge-Kutta",
    limit: 0.0,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "§9",
    reference: "K. Heun, Neue Methoden zur approximativen Integration, Z. Math. Phys. 45 (1900) 23",
    about: "A predictor by Standard Euler, then the mean of the increments at both ends. An undamped oscillator gains \
            energy at every step, but slowly: r₁² = 1 + Φ⁴/4.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    let (dv1, dy1) = (s.dv(t, v, y), s.dy(t, v, y));
    let (v1, y1) = (v + dv1, y + dy1);
    let (dv2, dy2) = (s.dv(t + h, v1, y1), s.dy(t + h, v1, y1));
    (v + 0.5 * (dv1 + dv2), y + 0.5 * (dy1 + dy2))
}

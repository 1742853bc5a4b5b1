use crate::model::{
    method::{Needs, Record},
    program::{Block, Length, Rates, Time},
};

const SIXTH: f64 = 1.0 / 6.0;

pub const RECORD: Record = Record {
    name: "rk4",
    title: "Runge-Kutta 4",
    other_names: &["the classical Runge-Kutta method", "Kutta's fourth-order method"],
    false_friends: &["Kutta's 3/8 rule", "Gill's method", "RK45"],
    order: 4,
    family: "Runge-Kutta",
    limit: 2.0 * std::f64::consts::SQRT_2,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "§12",
    reference: "W. Kutta, Beitrag zur näherungsweisen Integration totaler Differentialgleichungen, Z. Math. Phys. 46 (1901) 435",
    about: "Four evaluations, fourth order. It damps an undamped oscillator slightly, r₁² = 1 − Φ⁶/72 + Φ⁸/576, up to \
            Φ = 2√2.",
    step,
};

fn step(s: Rates, t: Time, h: Length, v: Block, y: Block) -> (Block, Block) {
    let middle = t + 0.5 * h;
    let (dv1, dy1) = (s.dv(t, v, y), s.dy(t, v, y));
    let (v2, y2) = (v + 0.5 * dv1, y + 0.5 * dy1);
    let (dv2, dy2) = (s.dv(middle, v2, y2), s.dy(middle, v2, y2));
    let (v3, y3) = (v + 0.5 * dv2, y + 0.5 * dy2);
    let (dv3, dy3) = (s.dv(middle, v3, y3), s.dy(middle, v3, y3));
    let (v4, y4) = (v + dv3, y + dy3);
    let (dv4, dy4) = (s.dv(t + h, v4, y4), s.dy(t + h, v4, y4));
    // (d1 + 2·d2 + 2·d3 + d4)/6: half of d1 is known already, and halves and doubles are exact.
    let v = v + SIXTH * (2.0 * ((0.5 * dv1 + dv2) + dv3) + dv4);
    let y = y + SIXTH * (2.0 * ((0.5 * dy1 + dy2) + dy3) + dy4);
    (v, y)
}

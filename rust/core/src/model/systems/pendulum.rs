//! The pendulum v̇ = −ω₀²·sin y − 2Dω₀v + a, ẏ = v: y is the angle from below and v its velocity.

use crate::{
    error::Error,
    functions::sin,
    model::{
        signal::Signal,
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: `omega`; optional `damping`, input `a`.
pub const KIND: Kind = Kind {
    name: "pendulum",
    shape,
    velocity_term: |signature| signature.has("damping").then_some("damping"),
    quantities: |_| vec![("energy".to_owned(), 1)],
    controllable: false,
    operations: |_| 60,
    make,
};

fn shape(signature: &Signature) -> Result<Shape, Error> {
    signature.expect("omega", 1)?;
    Ok(Shape { v: 1, y: 1 })
}

struct Pendulum<N: Number> {
    h: N,
    /// ω₀²
    square: N,
    stiffness: N,
    drag: Option<N>,
    input: Option<Signal<N>>,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let (h, omega) = (p.h, p.number("omega"));
    let input = p.signal("a").map(|a| a.scaled(h));
    // A driven pendulum always has its damping term.
    let damping = p.maybe("damping").or(input.is_some().then(|| N::of(0.0)));
    let drag = damping.map(|damping| (N::of(2.0) * damping) * (h * omega));
    let square = omega * omega;
    Box::new(Pendulum { h, square, stiffness: h * square, drag, input })
}

impl<N: Number> System<N> for Pendulum<N> {
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let mut dv = -(self.stiffness * sin(y[0]));
        if let Some(drag) = self.drag {
            dv -= drag * v[0];
        }
        if let Some(input) = self.input {
            dv += input.at(t);
        }
        Block::from_element(1, dv)
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v * self.h
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }

    /// ½v² + ω₀²(1 − cos y), by the sine of half the angle: 1 − cos y would lose digits near 0.
    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        let half = sin(N::of(0.5) * y[0]);
        (quantity == "energy").then(|| vec![N::of(0.5) * (v[0] * v[0]) + (N::of(2.0) * self.square) * (half * half)])
    }
}

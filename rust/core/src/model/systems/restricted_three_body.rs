//! The restricted problem of three bodies: one without mass moves in the plane between two that circle each other, seen from a
//! frame that turns with them. The heavy one, 1 − μ, stands at (−μ, 0), the light one, μ, at (1 − μ, 0).
//!
//! ẍ = x + 2ẏ − (1 − μ)(x + μ)/r₁³ − μ(x − 1 + μ)/r₂³, ÿ = y − 2ẋ − (1 − μ)y/r₁³ − μy/r₂³

use crate::{
    error::Error,
    model::{
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: `mu`.
pub const KIND: Kind = Kind {
    name: "restricted_three_body",
    shape,
    velocity_term: |_| Some("the Coriolis force"),
    quantities: |_| vec![("energy".to_owned(), 1)],
    controllable: false,
    operations: |_| 40,
    make,
};

fn shape(signature: &Signature) -> Result<Shape, Error> {
    signature.expect("mu", 1)?;
    Ok(Shape { v: 2, y: 2 })
}

struct RestrictedThreeBody<N: Number> {
    h: N,
    mu: N,
    heavy: N,
    light: N,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let (h, mu) = (p.h, p.number("mu"));
    Box::new(RestrictedThreeBody { h, mu, heavy: h * (N::of(1.0) - mu), light: h * mu })
}

impl<N: Number> System<N> for RestrictedThreeBody<N> {
    fn dv(&self, _t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let h = self.h;
        let from_heavy = y[0] + self.mu;
        let from_light = (y[0] - N::of(1.0)) + self.mu; // in this order, because near the light body the difference is exact
        let across = y[1] * y[1];
        let square = from_heavy * from_heavy + across;
        let by_heavy = self.heavy / (square * square.sqrt());
        let square = from_light * from_light + across;
        let by_light = self.light / (square * square.sqrt());
        let turn = h + h;
        let along = ((h * y[0] + turn * v[1]) - by_heavy * from_heavy) - by_light * from_light;
        let beside = ((h * y[1] - turn * v[0]) - by_heavy * y[1]) - by_light * y[1];
        Block::from_vec(vec![along, beside])
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v * self.h
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }

    /// Jacobi's integral: ½|v|² − ½(x² + y²) − (1 − μ)/r₁ − μ/r₂.
    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        let (half, one) = (N::of(0.5), N::of(1.0));
        let from_heavy = y[0] + self.mu;
        let from_light = (y[0] - one) + self.mu;
        let across = y[1] * y[1];
        let pull = (one - self.mu) / (from_heavy * from_heavy + across).sqrt();
        let pull = pull + self.mu / (from_light * from_light + across).sqrt();
        let energy = half * (v[0] * v[0] + v[1] * v[1]) - half * (y[0] * y[0] + across) - pull;
        (quantity == "energy").then(|| vec![energy])
    }
}

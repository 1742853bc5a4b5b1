//! A chain of n masses between two walls, joined by n + 1 springs.
//!
//! Spring j pulls between masses j − 1 and j with f_j = k_j·(y_j − y_{j−1}); the walls stand still at 0. A spring of no
//! stiffness at an end leaves that end free. v̇ᵢ = (f_{i+1} − f_i)/mᵢ, ẏ = v.

use super::nbody::total;
use crate::{
    error::Error,
    model::{
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: `stiffness` of the n + 1 springs, `mass` of the n masses.
pub const KIND: Kind = Kind {
    name: "chain",
    shape,
    velocity_term: |_| None,
    quantities: |_| vec![("energy".to_owned(), 1)],
    controllable: false,
    operations: |signature| 6 * signature.count("mass"),
    make,
};

fn shape(signature: &Signature) -> Result<Shape, Error> {
    let n = signature.count("mass").max(1);
    signature.expect("mass", n)?;
    signature.expect("stiffness", n + 1)?;
    Ok(Shape { v: n, y: n })
}

struct Chain<N: Number> {
    h: N,
    stiffness: Vec<N>,
    mass: Vec<N>,
    by_mass: Vec<N>,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let by_mass = p.numbers("mass").iter().map(|mass| p.h / *mass).collect();
    let [stiffness, mass] = ["stiffness", "mass"].map(|name| p.numbers(name).to_vec());
    Box::new(Chain { h: p.h, stiffness, mass, by_mass })
}

/// How much longer each spring is than at rest.
fn stretches<N: Number>(y: &[N]) -> Vec<N> {
    let wall = std::iter::once(N::of(0.0));
    let places: Vec<N> = wall.clone().chain(y.iter().copied()).chain(wall).collect();
    places.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// ½·Σ m·v² + ½·Σ k·(stretch of a spring)².
pub(crate) fn energy<N: Number>([stiffness, mass]: [&[N]; 2], v: &[N], y: &[N]) -> N {
    let motion = total(mass.iter().zip(v).map(|(m, v)| (*m * *v) * *v));
    let springs = total(stiffness.iter().zip(stretches(y)).map(|(k, stretch)| (*k * stretch) * stretch));
    N::of(0.5) * motion + N::of(0.5) * springs
}

impl<N: Number> System<N> for Chain<N> {
    fn dv(&self, _t: N, _v: &Block<N>, y: &Block<N>) -> Block<N> {
        let f: Vec<N> = self.stiffness.iter().zip(stretches(y.as_slice())).map(|(k, stretch)| *k * stretch).collect();
        Block::from_iterator(y.len(), self.by_mass.iter().zip(f.windows(2)).map(|(by_mass, pair)| (pair[1] - pair[0]) * *by_mass))
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v * self.h
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        (quantity == "energy").then(|| vec![energy([&self.stiffness, &self.mass], v.as_slice(), y.as_slice())])
    }
}

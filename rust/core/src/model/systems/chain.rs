//! A chain of n masses between two walls, joined by n + 1 springs.
//!
//! Spring j pulls between masses j − 1 and j with f_j = k_j·(y_j − y_{j−1}); the walls stand still at 0. A spring of no
//! stiffness at an end leaves that end free. v̇ᵢ = (f_{i+1} − f_i)/mᵢ, ẏ = v.

use crate::{
    error::Error,
    model::{
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// What the core knows of it. Given: `stiffness` of the n + 1 springs, `mass` of the n masses.
pub const KIND: Kind = Kind {
    name: "chain",
    shape,
    velocity_term: |_| None,
    quantities: |_| Vec::new(),
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
    by_mass: Vec<N>,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let by_mass = p.numbers("mass").iter().map(|mass| p.h / *mass).collect();
    Box::new(Chain { h: p.h, stiffness: p.numbers("stiffness").to_vec(), by_mass })
}

impl<N: Number> System<N> for Chain<N> {
    fn dv(&self, _t: N, _v: &Block<N>, y: &Block<N>) -> Block<N> {
        let wall = std::iter::once(N::of(0.0));
        let places: Vec<N> = wall.clone().chain(y.iter().copied()).chain(wall).collect();
        let f: Vec<N> = self.stiffness.iter().zip(places.windows(2)).map(|(k, pair)| *k * (pair[1] - pair[0])).collect();
        Block::from_iterator(y.len(), self.by_mass.iter().zip(f.windows(2)).map(|(by_mass, pair)| (pair[1] - pair[0]) * *by_mass))
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v * self.h
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }
}

//! Free points in a uniform field, with viscous drag: v̇ = g − (d/m)·v, ẏ = v.

use super::{
    nbody::{square, total},
    rods::dot,
};
use crate::{
    error::Error,
    model::{
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: the whole number `dim`; `masses` of the points; `gravity`, a vector; optional `drag`.
pub const KIND: Kind = Kind {
    name: "particles",
    shape,
    velocity_term: |signature| signature.has("drag").then_some("drag"),
    quantities: |_| vec![("energy".to_owned(), 1)],
    controllable: false,
    operations: |signature| 3 * signature.count("masses") * signature.whole("dim"),
    make,
};

fn shape(signature: &Signature) -> Result<Shape, Error> {
    let (n, dim) = (signature.count("masses").max(1), signature.whole("dim").max(1));
    signature.expect("masses", n)?;
    signature.expect("gravity", dim)?;
    Ok(Shape { v: n * dim, y: n * dim })
}

struct Particles<N: Number> {
    h: N,
    masses: Vec<N>,
    gravity: Vec<N>,
    /// h·g
    kick: Vec<N>,
    /// h·d/m of each point.
    drag: Option<Vec<N>>,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let [masses, gravity] = ["masses", "gravity"].map(|name| p.numbers(name).to_vec());
    let kick = gravity.iter().map(|g| p.h * *g).collect();
    let drag = p.maybe("drag").map(|drag| masses.iter().map(|mass| (p.h * drag) / *mass).collect());
    Box::new(Particles { h: p.h, masses, gravity, kick, drag })
}

impl<N: Number> System<N> for Particles<N> {
    fn dv(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        let dim = self.kick.len();
        Block::from_fn(v.len(), |i, _| match &self.drag {
            None => self.kick[i % dim],
            Some(drag) => self.kick[i % dim] - drag[i / dim] * v[i],
        })
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v * self.h
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }

    /// Σ m·(½v² − g·y).
    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        let dim = self.gravity.len();
        let points = self.masses.iter().zip(v.as_slice().chunks(dim).zip(y.as_slice().chunks(dim)));
        let of_point = |(mass, (v, y)): (&N, (&[N], &[N]))| *mass * (N::of(0.5) * square(v) - dot(&self.gravity, y));
        (quantity == "energy").then(|| vec![total(points.map(of_point))])
    }
}

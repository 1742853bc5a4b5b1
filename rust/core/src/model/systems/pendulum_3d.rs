//! One rod from the origin to a point in space: v̇ = −pull·y − g, where the pull follows from the length (§12).

use super::rods::{Keeps, cross, dot, largest};
use crate::{
    error::Error,
    model::{
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: `length` and `gravity`; the optional word `keeps`, and for a control its `strength`.
pub const KIND: Kind = Kind {
    name: "pendulum_3d",
    shape,
    velocity_term: |_| Some("the pull of its rod"),
    quantities: |_| [("energy", 1), ("length_error", 1), ("angular_momentum", 3)].map(|(name, n)| (name.to_owned(), n)).to_vec(),
    controllable: false,
    operations: |_| 25,
    make,
};

fn shape(signature: &Signature) -> Result<Shape, Error> {
    signature.expect("length", 1)?;
    signature.expect("gravity", 1)?;
    Keeps::<f64>::check(signature)?;
    Ok(Shape { v: 3, y: 3 })
}

/// C̈ = 0, with C = ½(y·y − l²); under control C̈ + 2αĊ + α²C = 0, α = c/h.
struct Pendulum3D<N: Number> {
    h: N,
    length: N,
    square: N,
    gravity: N,
    fall: N,
    keeps: Keeps<N>,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let (h, length, gravity) = (p.h, p.number("length"), p.number("gravity"));
    Box::new(Pendulum3D { h, length, square: length * length, gravity, fall: h * gravity, keeps: Keeps::new(p) })
}

impl<N: Number> System<N> for Pendulum3D<N> {
    fn dv(&self, _t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let (v, y) = (v.as_slice(), y.as_slice());
        let square = dot(y, y);
        let mut pull = self.h * dot(v, v) - self.fall * y[2];
        if let Keeps::Control { damping, stiffness } = self.keeps {
            pull = (pull + damping * dot(y, v)) + stiffness * (square - self.square);
        }
        let pull = pull / square;
        let mut dv = Block::from_iterator(3, y.iter().map(|y| -(pull * *y)));
        dv[2] -= self.fall;
        dv
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v.map(|v| self.h * v)
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }

    fn project(&self, v: Block<N>, y: Block<N>) -> (Block<N>, Block<N>) {
        if !matches!(self.keeps, Keeps::Projection) {
            return (v, y);
        }
        let scale = self.length / dot(y.as_slice(), y.as_slice()).sqrt();
        let y = y.map(|y| y * scale);
        let along = dot(y.as_slice(), v.as_slice()) / self.square;
        (v.zip_map(&y, |v, y| v - along * y), y)
    }

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        let (v, y) = (v.as_slice(), y.as_slice());
        match quantity {
            "energy" => Some(vec![N::of(0.5) * dot(v, v) + self.gravity * y[2]]),
            "length_error" => Some(vec![largest([dot(y, y).sqrt() / self.length - N::of(1.0)])]),
            "angular_momentum" => Some(cross(y, v)),
            _ => None,
        }
    }
}

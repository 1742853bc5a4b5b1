//! The linear oscillator ÿ + 2Dω₀ẏ + ω₀²y = ω₀²x + a (§3), in canonical and physical form.
//!
//! | form | v̇ | ẏ |
//! |---|---|---|
//! | canonical | −ω₀(y + 2Dv − x) + a/ω₀ | ω₀v |
//! | physical | −ω₀²y − 2Dω₀v + ω₀²x + a | v |

use crate::{
    error::Error,
    model::{
        signal::Signal,
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: `form`; `omega`; optional `damping` or `drag`; optional inputs `x` and `a`.
pub const KIND: Kind = Kind {
    name: "oscillator",
    shape,
    velocity_term: |signature| ["damping", "drag"].into_iter().find(|term| signature.has(term)),
    quantities: |_| vec![("energy".to_owned(), 1)],
    controllable: false,
    operations: |_| 40,
    make,
};

fn shape(signature: &Signature) -> Result<Shape, Error> {
    signature.expect("omega", 1)?;
    match signature.word("form") {
        "canonical" | "physical" => Ok(Shape { v: 1, y: 1 }),
        _ => Err(signature.unknown("form")),
    }
}

struct Oscillator<N: Number> {
    stiffness: N,
    speed: N,
    /// ω₀² in physical form.
    square: Option<N>,
    drag: Option<N>,
    inputs: Vec<Signal<N>>,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let (h, omega) = (p.h, p.number("omega"));
    let canonical = p.signature.word("form") == "canonical";
    let square = (!canonical).then(|| omega * omega);
    let stiffness = h * square.unwrap_or(omega);
    let (speed, by_a) = if canonical { (stiffness, h / omega) } else { (h, h) };
    let inputs: Vec<_> =
        [(p.signal("x"), stiffness), (p.signal("a"), by_a)].into_iter().filter_map(|(x, by)| Some(x?.scaled(by))).collect();
    // A driven oscillator always has its damping term.
    let damping = p.maybe("damping").or((!inputs.is_empty()).then(|| N::of(0.0)));
    let drag = p.maybe("drag").map(|drag| h * drag).or(damping.map(|damping| (N::of(2.0) * damping) * (h * omega)));
    Box::new(Oscillator { stiffness, speed, square, drag, inputs })
}

impl<N: Number> System<N> for Oscillator<N> {
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let mut dv = -(self.stiffness * y[0]);
        if let Some(drag) = self.drag {
            dv -= drag * v[0];
        }
        let drive = self.inputs.iter().map(|input| input.at(t)).reduce(|sum, input| sum + input);
        if let Some(drive) = drive {
            dv += drive;
        }
        Block::from_element(1, dv)
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v * self.speed
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.speed)
    }

    /// ½ẏ² + ½ω₀²y²; in canonical form divided by ω₀².
    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        let square = y[0] * y[0];
        let spring = self.square.map_or(square, |by| by * square);
        (quantity == "energy").then(|| vec![N::of(0.5) * (v[0] * v[0] + spring)])
    }
}

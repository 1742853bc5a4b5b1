//! The rigid body: J·ω̇ = τ − ω × J·ω − d·ω in body axes, q̇ = ½·q ⊗ (0, ω), and k·(1 − q·q)·q under control of the norm.
//!
//! v is ω along body axes, y is q, which turns body axes into those of space, scalar first. J is diagonal.

use crate::{
    error::Error,
    model::{
        signal::Signal,
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: `inertia`, three principal moments; optional `damping`, one for each axis; optional inputs `torque[0]`, … along
/// body axes and `space_torque[0]`, … along those of space; optional `weight` and `centre`, both or none; the word `keeps`,
/// "control" with its `strength`, or "projection".
pub const KIND: Kind = Kind {
    name: "rigid_body",
    shape,
    velocity_term: |_| Some("the gyroscopic torque"),
    quantities: |_| [("energy", 1), ("angular_momentum", 3), ("norm_error", 1)].map(|(name, n)| (name.to_owned(), n)).to_vec(),
    controllable: false,
    operations: |signature| if signature.has("weight") || signature.whole("space_torque") > 0 { 130 } else { 50 },
    make,
};

fn shape(signature: &Signature) -> Result<Shape, Error> {
    signature.expect("inertia", 3)?;
    if signature.has("damping") {
        signature.expect("damping", 3)?;
    }
    if signature.has("weight") {
        signature.expect("weight", 1)?;
        signature.expect("centre", 3)?;
    }
    match signature.word("keeps") {
        "control" => signature.expect("strength", 1)?,
        "" | "projection" => {}
        _ => return Err(signature.unknown("keeps")),
    }
    Ok(Shape { v: 3, y: 4 })
}

/// Three numbers.
type Vector<N> = [N; 3];

struct RigidBody<N: Number> {
    half: N,
    inertia: Vector<N>,
    by_inertia: Vector<N>,
    gyration: Vector<N>,
    drag: Option<Vector<N>>,
    torque: [Option<Signal<N>>; 3],
    space_torque: [Option<Signal<N>>; 3],
    /// The weight times the place of the centre of mass in the body.
    moment: Option<Vector<N>>,
    /// The weight, and where it acts.
    weight: Option<(N, Vector<N>)>,
    gain: Option<N>,
    projects: bool,
}

/// The numbers of a parameter along the axes.
fn along<N: Number>(p: &Parameters<N>, name: &str) -> Option<Vector<N>> {
    p.numbers(name).try_into().ok()
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let h = p.h;
    let inertia = along(p, "inertia").unwrap_or([N::of(f64::NAN); 3]); // `shape` has seen that there are three
    let by_inertia = inertia.map(|inertia| h / inertia);
    let [a, b, c] = inertia;
    let [x, y, z] = by_inertia;
    let gyration = [x * (b - c), y * (c - a), z * (a - b)];
    let drag = along(p, "damping").map(|[a, b, c]| [x * a, y * b, z * c]);
    let input = |name: &str, i: usize| p.signal(&format!("{name}[{i}]"));
    let torque = std::array::from_fn(|i| input("torque", i).map(|torque| torque.scaled(by_inertia[i])));
    let space_torque = std::array::from_fn(|i| input("space_torque", i));
    let weight = p.maybe("weight").zip(along(p, "centre"));
    let moment = weight.map(|(weight, centre)| centre.map(|centre| weight * centre));
    let keeps = p.signature.word("keeps");
    let gain = p.maybe("strength").filter(|_| keeps == "control").map(|strength| h * strength);
    let projects = keeps == "projection";
    let half = N::of(0.5) * h;
    Box::new(RigidBody { half, inertia, by_inertia, gyration, drag, torque, space_torque, moment, weight, gain, projects })
}

/// q·q
fn square<N: Number>(q: &Block<N>) -> N {
    ((q[0] * q[0] + q[1] * q[1]) + q[2] * q[2]) + q[3] * q[3]
}

/// q·q times the axes of space along those of the body, the rows of the matrix of rotation R, and q·q.
///
/// R is divided by q·q, so that a quaternion whose length has drifted still turns without stretching.
fn turned<N: Number>(q: &Block<N>) -> ([Vector<N>; 3], N) {
    let (a, b, c, d, two) = (q[0], q[1], q[2], q[3], N::of(2.0));
    let (aa, bb, cc, dd) = (a * a, b * b, c * c, d * d);
    let (bc, bd, cd, ab, ac, ad) = (b * c, b * d, c * d, a * b, a * c, a * d);
    let x = [(aa + bb) - (cc + dd), two * (bc - ad), two * (bd + ac)];
    let y = [two * (bc + ad), (aa + cc) - (bb + dd), two * (cd - ab)];
    let z = [two * (bd - ac), two * (cd + ab), (aa + dd) - (bb + cc)];
    ([x, y, z], square(q))
}

/// The sum of a vector and the total so far, if there is one.
fn plus<N: Number>(total: Option<Vector<N>>, more: Vector<N>) -> Option<Vector<N>> {
    Some(total.map_or(more, |total| std::array::from_fn(|i| total[i] + more[i])))
}

impl<N: Number> RigidBody<N> {
    /// The torques from outside along body axes: R(q)ᵀ·(space torque) + centre × R(q)ᵀ·(weight); None without any.
    fn outer(&self, t: N, y: &Block<N>) -> Option<Vector<N>> {
        if self.space_torque.iter().all(Option::is_none) && self.moment.is_none() {
            return None;
        }
        let (axes, square) = turned(y);
        let mut sum = None;
        for (row, signal) in axes.iter().zip(&self.space_torque) {
            if let Some(signal) = signal {
                let pull = signal.at(t);
                sum = plus(sum, row.map(|along| pull * along));
            }
        }
        if let Some([a, b, c]) = self.moment {
            let [x, y, z] = axes[2];
            sum = plus(sum, [c * y - b * z, a * z - c * x, b * x - a * y]); // up × moment
        }
        sum.map(|sum| sum.map(|each| each / square))
    }
}

impl<N: Number> System<N> for RigidBody<N> {
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let [a, b, c] = self.gyration;
        let mut dv = [a * (v[1] * v[2]), b * (v[2] * v[0]), c * (v[0] * v[1])];
        if let Some(drag) = self.drag {
            dv = std::array::from_fn(|i| dv[i] - drag[i] * v[i]);
        }
        for (dv, torque) in dv.iter_mut().zip(&self.torque) {
            if let Some(torque) = torque {
                *dv += torque.at(t);
            }
        }
        if let Some(outer) = self.outer(t, y) {
            dv = std::array::from_fn(|i| dv[i] + self.by_inertia[i] * outer[i]);
        }
        Block::from_column_slice(&dv)
    }

    fn dy(&self, _t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let (a, b, c, d, half) = (y[0], y[1], y[2], y[3], self.half);
        let mut dy = [
            half * -((b * v[0] + c * v[1]) + d * v[2]),
            half * ((a * v[0] + c * v[2]) - d * v[1]),
            half * ((a * v[1] + d * v[0]) - b * v[2]),
            half * ((a * v[2] + b * v[1]) - c * v[0]),
        ];
        if let Some(gain) = self.gain {
            let pull = gain * (N::of(1.0) - square(y));
            dy = std::array::from_fn(|i| dy[i] + pull * y[i]);
        }
        Block::from_column_slice(&dy)
    }

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        match quantity {
            "energy" => {
                let [a, b, c]: Vector<N> = std::array::from_fn(|i| (self.inertia[i] * v[i]) * v[i]);
                let turning = N::of(0.5) * ((a + b) + c);
                let Some((weight, centre)) = self.weight else { return Some(vec![turning]) };
                let ([_, _, up], square) = turned(y);
                let height = ((up[0] * centre[0] + up[1] * centre[1]) + up[2] * centre[2]) / square;
                Some(vec![turning + weight * height])
            }
            "angular_momentum" => {
                let own: Vector<N> = std::array::from_fn(|i| self.inertia[i] * v[i]);
                let (axes, square) = turned(y);
                Some(axes.map(|row| ((row[0] * own[0] + row[1] * own[1]) + row[2] * own[2]) / square).to_vec())
            }
            "norm_error" => Some(vec![square(y) - N::of(1.0)]),
            _ => None,
        }
    }

    fn project(&self, v: Block<N>, y: Block<N>) -> (Block<N>, Block<N>) {
        if !self.projects {
            return (v, y);
        }
        let length = square(&y).sqrt();
        (v, y.map(|part| part / length))
    }
}

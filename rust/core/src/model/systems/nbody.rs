//! Bodies that attract each other (Appendix C, D): v̇ᵢ = Σⱼ G·mⱼ·(yⱼ − yᵢ)·f(r² + ε²), ẏ = v, each pair computed once.
//!
//! | force | f | potential of a pair |
//! |---|---|---|
//! | `logarithmic` | 1/r² | G·m·m·ln r |
//! | `newton` | 1/r³ | −G·m·m/r |
//! | `printed` | 1/r² | −G·m·m/r, which belongs to the other force |
//!
//! Body i is paired with body i + k (modulo n) for k = 1 … n/2, so every pair comes once. The forces from partners after a body
//! and from those before it are summed separately, the latter over two rounds (body n + j is body j), so that no index wraps
//! where bodies are taken side by side. The order of these sums depends on the number of bodies only, not on the code that
//! computes them.

use stepwell_base::bodies::{LANES, Law, meeting, partners};

use crate::{
    error::Error,
    model::{
        spec::{Parameters, Signature},
        system::{Block, Energies, Gradient, Kind, Shape, System},
    },
    tape::number::Number,
};

/// What the core knows of it. Given: the word `force`; the whole number `dim`; `masses` and `strength`, G·m, of the bodies;
/// `softening`, ε.
pub const KIND: Kind = Kind {
    name: "nbody",
    shape,
    velocity_term: |_| None,
    quantities,
    controllable: true,
    operations: |signature| 11 * signature.count("masses").pow(2),
    make,
};

fn shape(signature: &Signature) -> Result<Shape, Error> {
    let dim = signature.whole("dim");
    if !matches!(dim, 2 | 3) {
        return Err(Error::Options { system: signature.system.clone(), options: format!("dim = {dim}") });
    }
    if law(signature).is_none() {
        return Err(signature.unknown("force"));
    }
    let n = signature.count("masses").max(1);
    signature.expect("masses", n)?;
    signature.expect("strength", n)?;
    signature.expect("softening", 1)?;
    Ok(Shape { v: n * dim, y: n * dim })
}

fn quantities(signature: &Signature) -> Vec<(String, usize)> {
    let dim = signature.whole("dim");
    let spin = if dim == 2 { 1 } else { 3 };
    let sizes = [("energy", 1), ("momentum", dim), ("angular_momentum", spin), ("closest", 1)];
    sizes.map(|(name, numbers)| (name.to_owned(), numbers)).to_vec()
}

pub(crate) fn law(signature: &Signature) -> Option<Law> {
    match signature.word("force") {
        "logarithmic" => Some(Law::Logarithmic),
        "newton" => Some(Law::Newton),
        "printed" => Some(Law::Printed),
        _ => None,
    }
}

/// The sum of a number of each body: body i in part i mod `LANES`, then part after part.
pub(crate) fn total<N: Number>(values: impl IntoIterator<Item = N>) -> N {
    let mut parts: Vec<N> = Vec::with_capacity(LANES);
    for (i, value) in values.into_iter().enumerate() {
        match parts.get_mut(i % LANES) {
            Some(part) => *part += value,
            None => parts.push(value),
        }
    }
    parts.into_iter().reduce(|whole, part| whole + part).unwrap_or(N::of(0.0))
}

/// d·d
pub(crate) fn square<N: Number>(d: &[N]) -> N {
    d.iter().map(|d| *d * *d).reduce(|length, d| length + d).unwrap_or(N::of(0.0))
}

/// The bodies of one member, scaled to the step.
struct Bodies<N: Number> {
    h: N,
    law: Law,
    dim: usize,
    masses: Vec<N>,
    /// h·G·m
    strength: Vec<N>,
    soft: N,
    /// ½·h·m
    half: Vec<N>,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let (h, masses, softening) = (p.h, p.numbers("masses").to_vec(), p.number("softening"));
    let strength = p.numbers("strength").iter().map(|strength| h * *strength).collect();
    let half = masses.iter().map(|mass| (N::of(0.5) * h) * *mass).collect();
    let law = law(p.signature).unwrap_or(Law::Logarithmic); // `shape` has seen that there is one
    Box::new(Bodies { h, law, dim: p.signature.whole("dim"), masses, strength, soft: softening * softening, half })
}

impl<N: Number> Bodies<N> {
    /// h·v̇ from every pair once, and with `wells` h·G·Σⱼ mⱼ·φ for each body, else zeros.
    fn meet(&self, y: &Block<N>, with_wells: bool) -> (Block<N>, Vec<N>) {
        let (n, dim, zero) = (self.masses.len(), self.dim, N::of(0.0));
        // Sums of pushes start from −0, for x + −0 is x, also where x is a zero: the first term costs no operation.
        let none = N::of(-0.0);
        let (mut dv, mut potential) = (Block::from_element(n * dim, none), vec![zero; n]);
        for slab in partners(n) {
            let (mut after, mut before, mut wells) = (vec![none; n * dim], vec![none; 2 * n * dim], vec![zero; n]);
            for group in slab {
                // Body after body, so that what belongs to one is at hand for all of its partners: a body gets what those before
                // it push from the farthest distance to the nearest, which is a single push in each round.
                for i in 0..n {
                    for &k in group.iter().filter(|k| i < meeting(n, **k)) {
                        let j = (i + k) % n;
                        let d: Vec<N> = (0..dim).map(|c| y[dim * j + c] - y[dim * i + c]).collect();
                        let r2 = square(&d) + self.soft;
                        let pull = self.law.pull(r2);
                        let (to_i, to_j) = (pull * self.strength[j], pull * self.strength[i]);
                        for (c, d) in d.into_iter().enumerate() {
                            after[dim * i + c] += d * to_i;
                            before[dim * (i + k) + c] += d * to_j;
                        }
                        if with_wells {
                            wells[i] += self.law.potential(r2, pull, self.strength[j]);
                        }
                    }
                }
            }
            for r in 0..n * dim {
                dv[r] += after[r] - (before[r] + before[n * dim + r]);
            }
            potential.iter_mut().zip(wells).for_each(|(sum, well)| *sum += well);
        }
        (dv, potential)
    }

    /// What is said of each body in turn: its mass, its place and its velocity.
    fn each<'a>(&'a self, v: &'a Block<N>, y: &'a Block<N>) -> impl Iterator<Item = (N, &'a [N], &'a [N])> {
        let (v, y) = (v.as_slice().chunks(self.dim), y.as_slice().chunks(self.dim));
        self.masses.iter().zip(y.zip(v)).map(|(mass, (y, v))| (*mass, y, v))
    }
}

impl<N: Number> System<N> for Bodies<N> {
    fn dv(&self, _t: N, _v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.meet(y, false).0
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v * self.h
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }

    fn energies(&self, v: &Block<N>, y: &Block<N>) -> Option<Energies<N>> {
        let (dv, potential) = self.meet(y, true);
        let kinetic = total(self.half.iter().zip(v.as_slice().chunks(self.dim)).map(|(half, v)| *half * square(v)));
        let whole = kinetic + total(self.masses.iter().zip(potential).map(|(mass, potential)| *mass * potential));
        Some(Energies { dv, kinetic, whole })
    }

    /// m·v in the velocities and −m·a in the coordinates.
    fn gradient(&self, v: &Block<N>, _y: &Block<N>, energies: &Energies<N>) -> Option<Gradient<N>> {
        let of =
            |block: &Block<N>| Block::from_iterator(block.len(), (0..block.len()).map(|r| self.masses[r / self.dim] * block[r]));
        let (v, y) = (of(v), -of(&energies.dv.map(|dv| dv / self.h)));
        let bodies = v.as_slice().chunks(self.dim).zip(y.as_slice().chunks(self.dim));
        let square = total(bodies.map(|(v, y)| square(v) + square(y)));
        Some(Gradient { v, y, square })
    }

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        match quantity {
            "energy" => Some(vec![self.energies(v, y)?.whole / self.h]),
            "momentum" => Some((0..self.dim).map(|c| total(self.each(v, y).map(|(mass, _, v)| mass * v[c]))).collect()),
            "angular_momentum" => {
                let axes: &[(usize, usize)] = if self.dim == 2 { &[(0, 1)] } else { &[(1, 2), (2, 0), (0, 1)] };
                let spin =
                    |&(a, b): &(usize, usize)| total(self.each(v, y).map(|(mass, y, v)| mass * (y[a] * v[b] - y[b] * v[a])));
                Some(axes.iter().map(spin).collect())
            }
            "closest" => {
                let places: Vec<&[N]> = y.as_slice().chunks(self.dim).collect();
                let mut least = N::of(f64::INFINITY);
                for (i, from) in places.iter().enumerate() {
                    for to in &places[i + 1..] {
                        let d: Vec<N> = to.iter().zip(*from).map(|(to, from)| *to - *from).collect();
                        let r2 = square(&d);
                        least = N::choose(r2.below(least), r2, least);
                    }
                }
                Some(vec![least.sqrt()])
            }
            _ => None,
        }
    }
}

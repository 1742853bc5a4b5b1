//! Particles joined by springs, in one to three dimensions.
//!
//! A spring between the particles i and j, d = yⱼ − yᵢ apart, of length ℓ = |d|, pulls i with f·d and j with −f·d, where
//!
//! f = k − (k·ℓ₀ − c·((vⱼ − vᵢ)·d)/ℓ)/ℓ.
//!
//! Written so, f stays finite where the square of ℓ is too large for a number. A spring of no length has no direction: 1 stands
//! in place of a divisor of zero, and f·d is zero since d is. The forces on a particle are summed in the order of the springs,
//! from −0, which changes no sum. v̇ = Σ f·d/m + g − (drag/m)·v, ẏ = v. The rate of a fixed particle is −0, so that its velocity
//! stays what it is.

use super::nbody::{square, total};
use crate::{
    error::Error,
    model::{
        spec::{Parameters, Signature},
        system::{Block, Energies, Gradient, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: the whole numbers `n`, of particles, and `dim`; the lists `pairs`, both ends of each spring, and `fixed`,
/// particles; `masses` and `drag` of the particles, `stiffness`, `rest` and `damping` of the springs, each one or one for all;
/// `gravity`, a vector.
pub const KIND: Kind = Kind { name: "springs", shape, velocity_term, quantities, controllable: true, operations, make };

fn shape(signature: &Signature) -> Result<Shape, Error> {
    let (n, dim, ends) = (signature.whole("n"), signature.whole("dim"), signature.list("pairs"));
    let options = |options: String| Err(Error::Options { system: signature.system.clone(), options });
    if !matches!(dim, 1..=3) {
        return options(format!("dim = {dim}"));
    }
    let far = |list: &[u32]| list.iter().copied().find(|particle| *particle as usize >= n);
    for name in ["pairs", "fixed"] {
        if let Some(particle) = far(signature.list(name)) {
            return options(format!("{name} with particle {particle} of {n}"));
        }
    }
    if ends.is_empty() || ends.len() % 2 == 1 {
        return options(format!("pairs of {} ends", ends.len()));
    }
    for (what, most, must) in [
        ("masses", n, true),
        ("stiffness", ends.len() / 2, true),
        ("rest", ends.len() / 2, true),
        ("damping", ends.len() / 2, false),
        ("drag", n, false),
    ] {
        let got = signature.count(what);
        if got != 1 && (must || got > 0) {
            signature.expect(what, most)?;
        }
    }
    if signature.has("gravity") {
        signature.expect("gravity", dim)?;
    }
    Ok(Shape { v: n * dim, y: n * dim })
}

fn velocity_term(signature: &Signature) -> Option<&'static str> {
    ["damping", "drag"].into_iter().find(|term| signature.has(term))
}

fn quantities(signature: &Signature) -> Vec<(String, usize)> {
    [("energy", 1), ("momentum", signature.whole("dim")), ("stretch", 1)]
        .map(|(name, numbers)| (name.to_owned(), numbers))
        .to_vec()
}

fn operations(signature: &Signature) -> usize {
    let (n, dim, springs) = (signature.whole("n"), signature.whole("dim"), signature.list("pairs").len() / 2);
    let damping = if signature.has("damping") { 3 * dim + 3 } else { 0 };
    springs * (6 * dim + 5 + damping) + n * dim * (2 + signature.count("gravity").min(1) + 2 * signature.count("drag").min(1))
}

/// The number of a spring or of a particle: one may serve for all.
fn of<N: Copy>(numbers: &[N], i: usize) -> N {
    if let [one] = numbers { *one } else { numbers[i] }
}

/// A net of one member, scaled to the step.
pub(crate) struct Springs<N: Number> {
    h: N,
    dim: usize,
    /// The particles at both ends of each spring.
    ends: Vec<[usize; 2]>,
    pub(crate) is_fixed: Vec<bool>,
    stiffness: Vec<N>,
    rest: Vec<N>,
    /// k·ℓ₀
    held: Vec<N>,
    /// None if there is no damping.
    damping: Vec<N>,
    masses: Vec<N>,
    /// h/m
    by_mass: Vec<N>,
    /// h·g, or none.
    fall: Vec<N>,
    /// h/m·drag, or none.
    slowing: Vec<N>,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    Box::new(net(p))
}

/// The net of these parameters.
pub(crate) fn net<N: Number>(p: &Parameters<N>) -> Springs<N> {
    let h = p.h;
    let (ends, _) = p.signature.list("pairs").as_chunks::<2>();
    let mut is_fixed = vec![false; p.signature.whole("n")];
    p.signature.list("fixed").iter().for_each(|particle| is_fixed[*particle as usize] = true);
    let by_mass: Vec<N> = p.numbers("masses").iter().map(|mass| h / *mass).collect();
    let [stiffness, rest, drag] = ["stiffness", "rest", "drag"].map(|name| p.numbers(name));
    let slowing = if drag.is_empty() {
        Vec::new()
    } else {
        (0..drag.len().max(by_mass.len())).map(|i| of(&by_mass, i) * of(drag, i)).collect()
    };
    Springs {
        h,
        dim: p.signature.whole("dim"),
        ends: ends.iter().map(|ends| ends.map(|particle| particle as usize)).collect(),
        is_fixed,
        stiffness: stiffness.to_vec(),
        held: (0..stiffness.len().max(rest.len())).map(|s| of(stiffness, s) * of(rest, s)).collect(),
        rest: rest.to_vec(),
        damping: p.numbers("damping").to_vec(),
        masses: p.numbers("masses").to_vec(),
        by_mass,
        fall: p.numbers("gravity").iter().map(|g| h * *g).collect(),
        slowing,
    }
}

impl<N: Number> Springs<N> {
    /// k, k·ℓ₀ and the damping of a spring.
    pub(crate) fn spring(&self, s: usize) -> [N; 3] {
        let damping = if self.damping.is_empty() { N::of(0.0) } else { of(&self.damping, s) };
        [of(&self.stiffness, s), of(&self.held, s), damping]
    }

    /// h/m of a particle.
    pub(crate) fn by_mass(&self, i: usize) -> N {
        of(&self.by_mass, i)
    }

    /// h/m·drag of a particle, if there is drag.
    pub(crate) fn slowing(&self, i: usize) -> Option<N> {
        if self.slowing.is_empty() { None } else { Some(of(&self.slowing, i)) }
    }

    /// h·g, or nothing.
    pub(crate) fn fall(&self) -> &[N] {
        &self.fall
    }

    /// The vector from the one end of a spring to the other.
    fn across(&self, s: usize, places: &[N]) -> Vec<N> {
        let [i, j] = self.ends[s].map(|particle| self.dim * particle);
        (0..self.dim).map(|c| places[j + c] - places[i + c]).collect()
    }

    /// The force on the first end of a spring.
    fn force(&self, s: usize, v: &[N], y: &[N]) -> Vec<N> {
        let d = self.across(s, y);
        let length = square(&d).sqrt();
        let divisor = N::choose(N::of(0.0).below(length), length, N::of(1.0));
        let push = if self.damping.is_empty() {
            of(&self.held, s) / divisor
        } else {
            let inverse = N::of(1.0) / divisor;
            let w = self.across(s, v);
            let along = w.iter().zip(&d).map(|(w, d)| *w * *d).reduce(|sum, product| sum + product).unwrap_or(N::of(0.0));
            (of(&self.held, s) - (of(&self.damping, s) * along) * inverse) * inverse
        };
        let pull = of(&self.stiffness, s) - push;
        d.into_iter().map(|d| pull * d).collect()
    }

    /// How much longer than at rest a spring is.
    fn stretch(&self, s: usize, y: &[N]) -> N {
        square(&self.across(s, y)).sqrt() - of(&self.rest, s)
    }

    /// Particles that move.
    fn free(&self) -> impl Iterator<Item = usize> {
        (0..self.is_fixed.len()).filter(|i| !self.is_fixed[*i])
    }

    /// h times the kinetic and h times the whole energy of what moves and of the springs.
    pub(crate) fn kinetic_and_whole(&self, v: &[N], y: &[N]) -> [N; 2] {
        let (half, dim) = (N::of(0.5) * self.h, self.dim);
        let kinetic = total(self.free().map(|i| (half * of(&self.masses, i)) * square(&v[dim * i..][..dim])));
        let stretched = |s: usize| {
            let stretch = self.stretch(s, y);
            ((half * of(&self.stiffness, s)) * stretch) * stretch
        };
        let whole = kinetic + total((0..self.ends.len()).map(stretched));
        if self.fall.is_empty() {
            return [kinetic, whole];
        }
        let weight = |i: usize| {
            let along = self.fall.iter().zip(&y[dim * i..]).map(|(g, y)| *g * *y);
            of(&self.masses, i) * along.reduce(|sum, product| sum + product).unwrap_or(N::of(0.0))
        };
        [kinetic, whole - total(self.free().map(weight))]
    }

    /// The gradient of the energy of the state with these velocities and h·v̇: m·v and −m·v̇, nothing for what is fixed; and its
    /// square.
    pub(crate) fn along(&self, v: &[N], dv: &[N], [of_v, of_y]: [&mut [N]; 2]) -> N {
        let dim = self.dim;
        for i in self.free() {
            let mass = of(&self.masses, i);
            for r in dim * i..dim * (i + 1) {
                of_v[r] = mass * v[r];
                of_y[r] = -(mass * (dv[r] / self.h));
            }
        }
        let part = |block: &[N], i: usize| square(&block[dim * i..][..dim]);
        total(self.free().map(|i| part(of_v, i) + part(of_y, i)))
    }

    /// A quantity of a state.
    pub(crate) fn quantity(&self, name: &str, v: &[N], y: &[N]) -> Option<Vec<N>> {
        match name {
            "energy" => Some(vec![self.kinetic_and_whole(v, y)[1] / self.h]),
            "momentum" => {
                let along = |c: usize| total(self.free().map(|i| of(&self.masses, i) * v[self.dim * i + c]));
                Some((0..self.dim).map(along).collect())
            }
            "stretch" => {
                let longer = |most: N, s: usize| {
                    let stretch = self.stretch(s, y);
                    N::choose(most.below(stretch), stretch, most)
                };
                Some(vec![(0..self.ends.len()).fold(N::of(f64::NEG_INFINITY), longer)])
            }
            _ => None,
        }
    }
}

impl<N: Number> System<N> for Springs<N> {
    fn dv(&self, _t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let (dim, v, y) = (self.dim, v.as_slice(), y.as_slice());
        let mut sums = vec![N::of(-0.0); y.len()];
        for (s, [i, j]) in self.ends.iter().copied().enumerate() {
            if self.is_fixed[i] && self.is_fixed[j] {
                continue;
            }
            for (c, force) in self.force(s, v, y).into_iter().enumerate() {
                if !self.is_fixed[i] {
                    sums[dim * i + c] += force;
                }
                if !self.is_fixed[j] {
                    sums[dim * j + c] -= force;
                }
            }
        }
        let rate = |(r, sum): (usize, N)| {
            let i = r / dim;
            if self.is_fixed[i] {
                return N::of(-0.0);
            }
            let mut rate = sum * of(&self.by_mass, i);
            if let Some(fall) = self.fall.get(r % dim) {
                rate += *fall;
            }
            if let Some(slowing) = self.slowing(i) {
                rate -= slowing * v[r];
            }
            rate
        };
        Block::from_iterator(y.len(), sums.into_iter().enumerate().map(rate))
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v * self.h
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }

    fn energies(&self, v: &Block<N>, y: &Block<N>) -> Option<Energies<N>> {
        let [kinetic, whole] = self.kinetic_and_whole(v.as_slice(), y.as_slice());
        Some(Energies { dv: self.dv(N::of(0.0), v, y), kinetic, whole })
    }

    fn gradient(&self, v: &Block<N>, _y: &Block<N>, energies: &Energies<N>) -> Option<Gradient<N>> {
        let (mut of_v, mut of_y) = (Block::from_element(v.len(), N::of(0.0)), Block::from_element(v.len(), N::of(0.0)));
        let square = self.along(v.as_slice(), energies.dv.as_slice(), [of_v.as_mut_slice(), of_y.as_mut_slice()]);
        Some(Gradient { v: of_v, y: of_y, square })
    }

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        self.quantity(quantity, v.as_slice(), y.as_slice())
    }
}

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
//!
//! Fused, every product of the forces that is added is rounded with its sum only: `r²` is a sum from ε² on, and a pull an
//! addend of what a body gets. Newton's f is then made without a root and a quotient (`Law::pull`). What is recorded is rounded
//! as without; what a method makes of the forces, too, unless that is asked for as of any tape.
//!
//! Bodies without mass, if it is known which these are, attract no other: the rest move as if these were not there, and each of
//! these as if it were alone with the rest, which pull it one after the other. No sum over bodies has a term of theirs.

use stepwell_base::bodies::{LANES, Law, Rounding, meeting, partners};

use crate::{
    error::Error,
    model::{
        kepler,
        spec::{Parameters, Signature},
        system::{Block, Energies, Gradient, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: the word `force`; the whole number `dim`; `masses` and `strength`, G·m, of the bodies; `softening`, ε; the whole
/// number `fused`, 1 if products are; the optional list `massless` of bodies without mass, in ascending order.
pub const KIND: Kind = Kind { name: "nbody", shape, velocity_term: |_| None, quantities, controllable: true, operations, make };

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
    let massless = signature.list("massless");
    if massless.iter().any(|i| *i as usize >= n) || !massless.is_sorted_by(|one, other| one < other) {
        return Err(Error::Options { system: signature.system.clone(), options: format!("massless of {n} bodies") });
    }
    Ok(Shape { v: n * dim, y: n * dim })
}

fn quantities(signature: &Signature) -> Vec<(String, usize)> {
    let dim = signature.whole("dim");
    let spin = if dim == 2 { 1 } else { 3 };
    let sizes = [("energy", 1), ("momentum", dim), ("angular_momentum", spin), ("closest", 1)];
    sizes.map(|(name, numbers)| (name.to_owned(), numbers)).to_vec()
}

fn operations(signature: &Signature) -> usize {
    let massless = signature.list("massless").len();
    let massive = signature.count("masses").saturating_sub(massless);
    11 * massive * (massive + 2 * massless)
}

/// The bodies with mass, in ascending order.
pub(crate) fn massive(signature: &Signature) -> Vec<usize> {
    let massless = signature.list("massless");
    (0..signature.count("masses")).filter(|i| massless.binary_search(&(*i as u32)).is_err()).collect()
}

pub(crate) fn law(signature: &Signature) -> Option<Law> {
    match signature.word("force") {
        "logarithmic" => Some(Law::Logarithmic),
        "newton" => Some(Law::Newton),
        "printed" => Some(Law::Printed),
        _ => None,
    }
}

/// How often products of forces are rounded, but for those of recorded quantities.
pub(crate) fn rounding(signature: &Signature) -> Rounding {
    Rounding::of(signature.whole("fused") == 1)
}

/// Whether bodies of that signature have Kepler motions, which [`System::drift`] makes.
pub(crate) fn splits(signature: &Signature) -> bool {
    signature.system == KIND.name && law(signature) == Some(Law::Newton) && signature.count("masses") > 1
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
    /// How often products of forces are rounded.
    rounding: Rounding,
    dim: usize,
    masses: Vec<N>,
    /// G·m
    alone: Vec<N>,
    /// h·G·m
    strength: Vec<N>,
    soft: N,
    /// ½·h·m
    half: Vec<N>,
    /// Bodies with mass, and those without.
    massive: Vec<usize>,
    massless: Vec<usize>,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let (h, masses, softening) = (p.h, p.numbers("masses").to_vec(), p.number("softening"));
    let alone = p.numbers("strength").to_vec();
    let strength = alone.iter().map(|strength| h * *strength).collect();
    let half = masses.iter().map(|mass| (N::of(0.5) * h) * *mass).collect();
    let law = law(p.signature).unwrap_or(Law::Logarithmic); // `shape` has seen that there is one
    let (rounding, massless) = (rounding(p.signature), p.signature.list("massless").iter().map(|i| *i as usize).collect());
    let (dim, soft, massive) = (p.signature.whole("dim"), softening * softening, massive(p.signature));
    Box::new(Bodies { h, law, rounding, dim, masses, alone, strength, soft, half, massive, massless })
}

impl<N: Number> Bodies<N> {
    /// h·v̇ from every pair once, and with `wells` h·G·Σⱼ mⱼ·φ for each body with mass, else zeros.
    fn meet(&self, rounding: Rounding, y: &Block<N>, with_wells: bool) -> (Block<N>, Vec<N>) {
        let dim = self.dim;
        let (among, potential) = self.among(rounding, y, with_wells);
        let mut dv = Block::from_element(dim * self.masses.len(), N::of(-0.0));
        for (pushes, i) in among.chunks(dim).zip(&self.massive) {
            pushes.iter().enumerate().for_each(|(c, push)| dv[dim * i + c] = *push);
        }
        for &i in &self.massless {
            for &j in &self.massive {
                let d: Vec<N> = (0..dim).map(|c| y[dim * j + c] - y[dim * i + c]).collect();
                let to_i = self.law.pull(rounding, rounding.softened(&d, self.soft)) * self.strength[j];
                d.into_iter().enumerate().for_each(|(c, d)| dv[dim * i + c] = rounding.plus(dv[dim * i + c], d, to_i));
            }
        }
        (dv, potential)
    }

    /// The accelerations and potentials of bodies with mass among each other.
    fn among(&self, rounding: Rounding, y: &Block<N>, with_wells: bool) -> (Vec<N>, Vec<N>) {
        let (bodies, n, dim, zero) = (&self.massive, self.massive.len(), self.dim, N::of(0.0));
        // Sums of pushes start from −0, for x + −0 is x, also where x is a zero: the first term costs no operation.
        let none = N::of(-0.0);
        let (mut dv, mut potential) = (vec![none; n * dim], vec![zero; n]);
        for slab in partners(n) {
            let (mut after, mut before, mut wells) = (vec![none; n * dim], vec![none; 2 * n * dim], vec![zero; n]);
            for group in slab {
                // Body after body, so that what belongs to one is at hand for all of its partners: a body gets what those before
                // it push from the farthest distance to the nearest, which is a single push in each round.
                for i in 0..n {
                    for &k in group.iter().filter(|k| i < meeting(n, **k)) {
                        let (one, other) = (bodies[i], bodies[(i + k) % n]);
                        let d: Vec<N> = (0..dim).map(|c| y[dim * other + c] - y[dim * one + c]).collect();
                        let r2 = rounding.softened(&d, self.soft);
                        let pull = self.law.pull(rounding, r2);
                        let (to_i, to_j) = (pull * self.strength[other], pull * self.strength[one]);
                        for (c, d) in d.into_iter().enumerate() {
                            after[dim * i + c] = rounding.plus(after[dim * i + c], d, to_i);
                            before[dim * (i + k) + c] = rounding.plus(before[dim * (i + k) + c], d, to_j);
                        }
                        if with_wells {
                            wells[i] += self.law.potential(r2, pull, self.strength[other]);
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

    /// For each body but the first its share in the mass of all up to it, and G times that mass (Jacobi's hierarchy); None under
    /// another force than Newton's, which has no Kepler motions.
    fn hierarchy(&self) -> Option<Vec<(N, N)>> {
        if self.law != Law::Newton || self.masses.len() < 2 {
            return None;
        }
        let (mut mass, mut mu) = (self.masses[0], self.alone[0]);
        let each = self.masses.iter().zip(&self.alone).skip(1).map(|(own, strength)| {
            mass += *own;
            mu += *strength;
            (*own / mass, mu)
        });
        Some(each.collect())
    }

    /// Each body but the first from the centre of mass of those before it, and the centre of mass of all.
    fn apart(&self, hierarchy: &[(N, N)], block: &Block<N>) -> (Vec<Vec<N>>, Vec<N>) {
        let mut bodies = block.as_slice().chunks(self.dim);
        let mut centre = bodies.next().map_or_else(Vec::new, <[N]>::to_vec);
        let mut rows = Vec::with_capacity(hierarchy.len());
        for (body, (share, _)) in bodies.zip(hierarchy) {
            let row: Vec<N> = body.iter().zip(&centre).map(|(body, centre)| *body - *centre).collect();
            centre.iter_mut().zip(&row).for_each(|(centre, row)| *centre += *share * *row);
            rows.push(row);
        }
        (rows, centre)
    }

    /// The inverse: all bodies. The centre of mass is the origin if None.
    fn gathered(&self, hierarchy: &[(N, N)], rows: &[Vec<N>], mut centre: Option<Vec<N>>) -> Block<N> {
        let mut all = Block::from_element(self.dim * (rows.len() + 1), N::of(0.0));
        for (k, (row, (share, _))) in rows.iter().zip(hierarchy).enumerate().rev() {
            let lever = row.iter().map(|row| *share * *row);
            let before: Vec<N> = match &centre {
                None => lever.map(|lever| -lever).collect(),
                Some(centre) => centre.iter().zip(lever).map(|(centre, lever)| *centre - lever).collect(),
            };
            for (c, (before, row)) in before.iter().zip(row).enumerate() {
                all[self.dim * (k + 1) + c] = *before + *row;
            }
            centre = Some(before);
        }
        centre.into_iter().flatten().enumerate().for_each(|(c, centre)| all[c] = centre);
        all
    }

    fn energies_by(&self, rounding: Rounding, v: &Block<N>, y: &Block<N>) -> Energies<N> {
        let (dv, potential) = self.meet(rounding, y, true);
        let halves = self.massive.iter().map(|i| self.half[*i]);
        let kinetic = total(halves.zip(self.each(v, y)).map(|(half, (_, _, v))| half * square(v)));
        let whole = kinetic + total(self.each(v, y).zip(potential).map(|((mass, ..), potential)| mass * potential));
        Energies { dv, kinetic, whole }
    }

    /// The mass, the place and the velocity of each body with mass in turn.
    fn each<'a>(&'a self, v: &'a Block<N>, y: &'a Block<N>) -> impl Iterator<Item = (N, &'a [N], &'a [N])> {
        let row = |block: &'a Block<N>, i: usize| &block.as_slice()[self.dim * i..][..self.dim];
        self.massive.iter().map(move |&i| (self.masses[i], row(y, i), row(v, i)))
    }
}

impl<N: Number> System<N> for Bodies<N> {
    fn dv(&self, _t: N, _v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.meet(self.rounding, y, false).0
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v * self.h
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }

    fn central(&self, y: &Block<N>) -> Option<Block<N>> {
        let hierarchy = self.hierarchy()?;
        let (mut rows, _) = self.apart(&hierarchy, y);
        for (row, (_, mu)) in rows.iter_mut().zip(&hierarchy) {
            let inverse = N::of(1.0) / square(row).sqrt();
            let pull = (-self.h * *mu) * (inverse * (inverse * inverse));
            row.iter_mut().for_each(|row| *row *= pull);
        }
        Some(self.gathered(&hierarchy, &rows, None))
    }

    fn drift(&self, share: f64, v: &Block<N>, y: &Block<N>) -> Option<[Block<N>; 2]> {
        let hierarchy = self.hierarchy()?;
        let h = if share == 1.0 { self.h } else { N::of(share) * self.h };
        let ((places, _), (velocities, flight)) = (self.apart(&hierarchy, y), self.apart(&hierarchy, v));
        let (mut dv, mut dy) = (Vec::with_capacity(hierarchy.len()), Vec::with_capacity(hierarchy.len()));
        for ((y, v), (_, mu)) in places.iter().zip(&velocities).zip(&hierarchy) {
            let [by_v, by_y] = kepler::moved(*mu, h, v, y);
            dv.push(by_v);
            dy.push(by_y);
        }
        let flight = flight.into_iter().map(|flight| h * flight).collect();
        let (dv, dy) = (self.gathered(&hierarchy, &dv, None), self.gathered(&hierarchy, &dy, Some(flight)));
        Some([v + dv, y + dy])
    }

    fn energies(&self, v: &Block<N>, y: &Block<N>) -> Option<Energies<N>> {
        Some(self.energies_by(self.rounding, v, y))
    }

    /// m·v in the velocities and −m·a in the coordinates.
    fn gradient(&self, v: &Block<N>, _y: &Block<N>, energies: &Energies<N>) -> Option<Gradient<N>> {
        let of =
            |block: &Block<N>| Block::from_iterator(block.len(), (0..block.len()).map(|r| self.masses[r / self.dim] * block[r]));
        let (v, y) = (of(v), -of(&energies.dv.map(|dv| dv / self.h)));
        let square = total(self.each(&v, &y).map(|(_, y, v)| square(v) + square(y)));
        Some(Gradient { v, y, square })
    }

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        match quantity {
            "energy" => Some(vec![self.energies_by(Rounding::Twice, v, y).whole / self.h]),
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
                for (k, &i) in self.massive.iter().enumerate() {
                    for &j in self.massive[k + 1..].iter().chain(&self.massless) {
                        let d: Vec<N> = places[j].iter().zip(places[i]).map(|(to, from)| *to - *from).collect();
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

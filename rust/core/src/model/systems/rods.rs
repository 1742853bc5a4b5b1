//! Points joined by rods: the rods' pulls are found from equations that they share, one for each rod.
//!
//! v̇ᵢ = −(Σ ±pullₖ·dₖ)/mᵢ − g, where d points from the first end of a rod to its second. The pulls are those for which C̈ = 0,
//! with C = ½(d·d − l²); under control C̈ + 2αĊ + α²C = 0, α = c/h.

use crate::{
    error::Error,
    model::{
        elimination::Factors,
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
    },
    tape::number::Number,
};

/// Parameters: the whole numbers `dim` and `rods`, and of each rod its ends, `rods[k][0]` and `rods[k][1]`; `masses` of the
/// points, `lengths` of the rods, optional coordinates of the `anchors`, `gravity`; the optional word `keeps`, and for a control
/// its `strength`. Anchors count on from the last point, and are first ends only.
pub const KIND: Kind = Kind {
    name: "rods",
    shape,
    velocity_term: |_| Some("the pull of its rods"),
    quantities: |signature| {
        let spin = if signature.whole("dim") == 2 { 1 } else { 3 };
        [("energy", 1), ("length_error", 1), ("angular_momentum", spin)].map(|(name, n)| (name.to_owned(), n)).to_vec()
    },
    controllable: false,
    operations,
    make,
};

/// Newton's corrections of the points in a projection. Each squares the relative error of the lengths, over 2: 2 % becomes
/// 2·10⁻⁴, 2·10⁻⁸ and 2·10⁻¹⁶, which is rounding.
const CORRECTIONS: usize = 3;

/// The way in which the lengths are kept.
#[derive(Clone, Copy)]
pub(crate) enum Keeps<N: Number> {
    Nothing,
    /// 2c, and c²/2h.
    Control {
        damping: N,
        stiffness: N,
    },
    Projection,
}

impl<N: Number> Keeps<N> {
    pub(crate) fn new(p: &Parameters<N>) -> Self {
        match (p.signature.word("keeps"), p.maybe("strength")) {
            ("control", Some(c)) => Keeps::Control { damping: N::of(2.0) * c, stiffness: N::of(0.5) * ((c * c) / p.h) },
            ("projection", _) => Keeps::Projection,
            _ => Keeps::Nothing,
        }
    }

    /// An error if that is not known.
    pub(crate) fn check(signature: &Signature) -> Result<(), Error> {
        match signature.word("keeps") {
            "" | "projection" => signature.expect("strength", 0),
            "control" => signature.expect("strength", 1),
            _ => Err(signature.unknown("keeps")),
        }
    }
}

/// The sum of products.
pub(crate) fn dot<N: Number>(a: &[N], b: &[N]) -> N {
    a.iter().zip(b).map(|(a, b)| *a * *b).reduce(|whole, each| whole + each).unwrap_or(N::of(0.0))
}

/// The largest absolute value.
pub(crate) fn largest<N: Number>(values: impl IntoIterator<Item = N>) -> N {
    let size = |value: N| N::choose(value.below(N::of(0.0)), -value, value);
    values.into_iter().map(size).reduce(|most, size| N::choose(most.below(size), size, most)).unwrap_or(N::of(0.0))
}

/// y × v: one number in the plane, three in space.
pub(crate) fn cross<N: Number>(y: &[N], v: &[N]) -> Vec<N> {
    let axes: &[(usize, usize)] = if y.len() == 2 { &[(0, 1)] } else { &[(1, 2), (2, 0), (0, 1)] };
    axes.iter().map(|&(a, b)| y[a] * v[b] - y[b] * v[a]).collect()
}

fn ends(signature: &Signature) -> Vec<[usize; 2]> {
    (0..signature.whole("rods")).map(|k| [0, 1].map(|end| signature.whole(&format!("rods[{k}][{end}]")))).collect()
}

fn shape(signature: &Signature) -> Result<Shape, Error> {
    let (n, dim, rods) = (signature.count("masses"), signature.whole("dim"), ends(signature));
    let options = |options: String| Error::Options { system: signature.system.clone(), options };
    if !matches!(dim, 2 | 3) {
        return Err(options(format!("dim = {dim}")));
    }
    let places = n + signature.count("anchors") / dim;
    if let Some([a, b]) = rods.iter().find(|[a, b]| a == b || *a >= places || *b >= n) {
        return Err(options(format!("a rod from {a} to {b}")));
    }
    if let Some(free) = (0..n).find(|point| !rods.iter().flatten().any(|end| end == point)) {
        return Err(options(format!("point {free} without a rod")));
    }
    signature.expect("lengths", rods.len())?;
    signature.expect("anchors", (places - n) * dim)?;
    signature.expect("gravity", 1)?;
    Keeps::<f64>::check(signature)?;
    Ok(Shape { v: n * dim, y: n * dim })
}

/// Rods that share a point are coupled, and so are then all of them there.
fn operations(signature: &Signature) -> usize {
    let (n, dim, rods) = (signature.count("masses"), signature.whole("dim"), ends(signature));
    let degree = |point: usize| rods.iter().flatten().filter(|end| **end == point).count();
    let coupled = (0..n).map(degree).map(|k| k * k * dim + k * k * k / 3).sum::<usize>();
    rods.len() * (9 * dim + 4) + coupled
}

/// Points and the rods between them.
pub(crate) struct Links<N: Number> {
    pub(crate) dim: usize,
    pub(crate) ends: Vec<[usize; 2]>,
    pub(crate) masses: Vec<N>,
    /// 1/m and −1/m.
    pub(crate) inverse: Vec<N>,
    pub(crate) minus: Vec<N>,
    pub(crate) lengths: Vec<N>,
    pub(crate) anchors: Vec<N>,
}

struct Rods<N: Number> {
    h: N,
    links: Links<N>,
    squares: Vec<N>,
    gravity: N,
    fall: N,
    keeps: Keeps<N>,
}

pub(super) fn make<N: Number>(p: &Parameters<N>) -> Box<dyn System<N>> {
    let (links, gravity) = (Links::new(p), p.number("gravity"));
    Box::new(Rods {
        h: p.h,
        squares: links.lengths.iter().map(|l| *l * *l).collect(),
        gravity,
        fall: p.h * gravity,
        keeps: Keeps::new(p),
        links,
    })
}

/// A vector for each rod, or for each point.
pub(crate) type Vectors<N> = Vec<Vec<N>>;

impl<N: Number> Links<N> {
    fn new(p: &Parameters<N>) -> Self {
        let (dim, masses) = (p.signature.whole("dim"), p.numbers("masses").to_vec());
        Links::of(dim, ends(p.signature), masses, p.numbers("lengths").to_vec(), p.numbers("anchors").to_vec())
    }

    /// Rods from the dimensions, the ends of each rod, the points' masses, the rods' lengths and the anchors.
    pub(crate) fn of(dim: usize, ends: Vec<[usize; 2]>, masses: Vec<N>, lengths: Vec<N>, anchors: Vec<N>) -> Self {
        let (inverse, minus) = [1.0, -1.0].map(|one| masses.iter().map(|m| N::of(one) / *m).collect()).into();
        Links { dim, ends, masses, inverse, minus, lengths, anchors }
    }

    /// The rods of the model, if it has rods.
    pub(crate) fn from_parameters(p: &Parameters<N>) -> Option<Self> {
        match p.signature.system.as_str() {
            "rods" => Some(Links::new(p)),
            "pendulum_3d" => Some(Links::of(3, vec![[1, 0]], vec![N::of(1.0)], vec![p.number("length")], vec![N::of(0.0); 3])),
            _ => None,
        }
    }

    pub(crate) fn is_point(&self, end: usize) -> bool {
        end < self.masses.len()
    }

    /// The numbers of a point, or of an anchor.
    pub(crate) fn at<'a>(&'a self, block: &'a [N], end: usize) -> &'a [N] {
        let n = self.masses.len();
        let (all, i) = if end < n { (block, end) } else { (&self.anchors[..], end - n) };
        &all[i * self.dim..][..self.dim]
    }

    /// The vector of each rod.
    pub(crate) fn spans(&self, y: &[N]) -> Vectors<N> {
        let span = |[a, b]: &[usize; 2]| self.at(y, *b).iter().zip(self.at(y, *a)).map(|(b, a)| *b - *a).collect();
        self.ends.iter().map(span).collect()
    }

    /// The rate of each rod's vector.
    pub(crate) fn closing(&self, v: &[N]) -> Vectors<N> {
        let rate = |[a, b]: &[usize; 2]| {
            if self.is_point(*a) {
                self.at(v, *b).iter().zip(self.at(v, *a)).map(|(b, a)| *b - *a).collect()
            } else {
                self.at(v, *b).to_vec()
            }
        };
        self.ends.iter().map(rate).collect()
    }

    /// How a pull of a rod changes C̈ of another: nothing unless they share a point.
    pub(crate) fn factors(&self, d: &Vectors<N>) -> Factors<N> {
        let (mut rows, mut diagonal) = (Vec::new(), Vec::new());
        for (k, [a, b]) in self.ends.iter().enumerate() {
            let entry = |other: usize| self.shared(k, other).map(|w| w * dot(&d[k], &d[other]));
            rows.push((0..k).map(entry).collect());
            let own = if self.is_point(*a) { self.inverse[*b] + self.inverse[*a] } else { self.inverse[*b] };
            diagonal.push(own * dot(&d[k], &d[k]));
        }
        Factors::new(rows, diagonal)
    }

    /// 1/m of the point that two rods share, with the sign of their directions there.
    fn shared(&self, k: usize, other: usize) -> Option<N> {
        let ([a, b], [first, second]) = (self.ends[k], self.ends[other]);
        if b == second {
            Some(self.inverse[b])
        } else if a == first && self.is_point(a) {
            Some(self.inverse[a])
        } else if a == second {
            Some(self.minus[a])
        } else {
            (b == first).then(|| self.minus[b])
        }
    }

    /// The sum of the pulls of the rods on each point.
    fn pushed(&self, d: &Vectors<N>, pulls: &[N]) -> Vectors<N> {
        let pulls: Vec<Option<N>> = pulls.iter().copied().map(Some).collect();
        // `shape` has seen that each point has a rod.
        self.pushed_by_some(d, &pulls).into_iter().map(Option::unwrap_or_default).collect()
    }

    /// As `pushed`, for some pulls; `None` for points that none acts on.
    pub(crate) fn pushed_by_some(&self, d: &Vectors<N>, pulls: &[Option<N>]) -> Vec<Option<Vec<N>>> {
        let mut sums: Vec<Option<Vec<N>>> = vec![None; self.masses.len()];
        for (([a, b], span), pull) in self.ends.iter().zip(d).zip(pulls) {
            let Some(pull) = pull else { continue };
            let along: Vec<N> = span.iter().map(|d| *pull * *d).collect();
            if self.is_point(*a) {
                sums[*a] = Some(match &sums[*a] {
                    None => along.iter().map(|x| -*x).collect(),
                    Some(sum) => sum.iter().zip(&along).map(|(sum, x)| *sum - *x).collect(),
                });
            }
            sums[*b] = Some(match &sums[*b] {
                None => along,
                Some(sum) => sum.iter().zip(&along).map(|(sum, x)| *sum + *x).collect(),
            });
        }
        let each = |(sum, minus): (Option<Vec<N>>, &N)| sum.map(|sum| sum.into_iter().map(|x| *minus * x).collect());
        sums.into_iter().zip(&self.minus).map(each).collect()
    }
}

impl<N: Number> Rods<N> {
    /// A block, changed along the rods by what takes these errors away.
    fn moved(&self, block: &Block<N>, d: &Vectors<N>, off: Vec<N>) -> Block<N> {
        let pushed = self.links.pushed(d, &self.links.factors(d).solve(off));
        Block::from_iterator(block.len(), block.iter().zip(pushed.iter().flatten()).map(|(x, push)| *x + *push))
    }
}

impl<N: Number> System<N> for Rods<N> {
    fn dv(&self, _t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let (d, u) = (self.links.spans(y.as_slice()), self.links.closing(v.as_slice()));
        let mut right = Vec::with_capacity(d.len());
        for (k, [first, _]) in self.links.ends.iter().enumerate() {
            let mut pull = self.h * dot(&u[k], &u[k]);
            if !self.links.is_point(*first) {
                pull -= self.fall * d[k][self.links.dim - 1];
            }
            if let Keeps::Control { damping, stiffness } = self.keeps {
                pull = (pull + damping * dot(&d[k], &u[k])) + stiffness * (dot(&d[k], &d[k]) - self.squares[k]);
            }
            right.push(pull);
        }
        let pushed = self.links.pushed(&d, &self.links.factors(&d).solve(right));
        let mut dv = Block::from_iterator(v.len(), pushed.into_iter().flatten());
        for point in 0..self.links.masses.len() {
            dv[(point + 1) * self.links.dim - 1] -= self.fall;
        }
        dv
    }

    fn dy(&self, _t: N, v: &Block<N>, _y: &Block<N>) -> Block<N> {
        v.map(|v| self.h * v)
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        d.map(|d| d / self.h)
    }

    fn project(&self, v: Block<N>, mut y: Block<N>) -> (Block<N>, Block<N>) {
        if !matches!(self.keeps, Keeps::Projection) {
            return (v, y);
        }
        for _ in 0..CORRECTIONS {
            let d = self.links.spans(y.as_slice());
            let off = d.iter().zip(&self.squares).map(|(d, square)| N::of(0.5) * (dot(d, d) - *square)).collect();
            y = self.moved(&y, &d, off);
        }
        let d = self.links.spans(y.as_slice());
        let off = d.iter().zip(self.links.closing(v.as_slice())).map(|(d, u)| dot(d, &u)).collect();
        (self.moved(&v, &d, off), y)
    }

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        match quantity {
            "energy" => {
                let energy = |(i, mass): (usize, &N)| {
                    let (v, y) = (self.links.at(v.as_slice(), i), self.links.at(y.as_slice(), i));
                    *mass * (N::of(0.5) * dot(v, v) + self.gravity * y[self.links.dim - 1])
                };
                self.links.masses.iter().enumerate().map(energy).reduce(|sum, each| sum + each).map(|sum| vec![sum])
            }
            "length_error" => {
                let (d, one) = (self.links.spans(y.as_slice()), N::of(1.0));
                Some(vec![largest(d.iter().zip(&self.links.lengths).map(|(d, length)| dot(d, d).sqrt() / *length - one))])
            }
            "angular_momentum" => {
                let of = |(i, mass): (usize, &N)| {
                    cross(self.links.at(y.as_slice(), i), self.links.at(v.as_slice(), i))
                        .into_iter()
                        .map(|part| *mass * part)
                        .collect::<Vec<N>>()
                };
                let sum = |whole: Vec<N>, each: Vec<N>| whole.iter().zip(each).map(|(a, b)| *a + b).collect();
                self.links.masses.iter().enumerate().map(of).reduce(sum)
            }
            _ => None,
        }
    }
}

//! Planes and spheres: where a point is to them, and how their springs push.

use crate::{
    error::Error,
    model::spec::{Parameters, Signature},
    tape::number::Number,
};

/// The relative error of a distance, of the numbers that it is computed from: eight roundings.
const ROUNDING: f64 = 1.0 / (1u64 << 50) as f64;

/// The relative error of a distance in numbers of 32 bits.
const SINGLE_ROUNDING: f64 = 1.0 / (1u64 << 21) as f64;

/// The relative error of a distance in this type of number.
pub(crate) fn rounding<N: Number>() -> N {
    N::of(if N::is_single() { SINGLE_ROUNDING } else { ROUNDING })
}

/// The response of a point that met a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ContactMode {
    /// It leaves with e² of the energy of impact, or rests.
    Safe,
    /// Its normal velocity becomes −e times what it was; without e, its opposite.
    Turn,
    /// A spring pushes it back.
    Spring,
}

/// The form of a surface, and the side on which points are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    Plane,
    Inside,
    Outside,
}

/// The numbers that say how near a point is to a surface.
pub(crate) struct Reach<'a> {
    pub form: Form,
    /// The normal, or the centre.
    pub place: &'a [f64],
    /// The offset, or the radius.
    pub size: f64,
}

/// The place of a surface.
enum Location<N: Number> {
    Plane { normal: Vec<N>, offset: N },
    Sphere { is_inside: bool, centre: Vec<N>, radius: N },
}

/// A surface.
pub(crate) struct Surface<N: Number> {
    pub way: ContactMode,
    /// e; None where it is 1 by the way.
    pub restitution: Option<N>,
    /// Coulomb's coefficient, if there is friction.
    pub friction: Option<N>,
    /// h·ω² of a spring.
    stiffness: Option<N>,
    location: Location<N>,
}

/// Where a point is to a surface after a step.
pub(crate) struct Place<N: Number> {
    /// Whether it reached the surface.
    pub near: N::Truth,
    /// Out of the surface, at the point.
    pub normal: Vec<N>,
    /// From the plane that touches the surface there; negative behind it.
    pub distance: N,
    /// The distance at the start of the step.
    pub before: N,
    /// How exact these distances are.
    pub slack: N,
}

/// a·b, from the first component on.
#[inline(always)]
pub(crate) fn dot<N: Number>(a: &[N], b: &[N]) -> N {
    a.iter().zip(b).map(|(a, b)| *a * *b).reduce(|sum, next| sum + next).unwrap_or(N::of(0.0))
}

/// |x|
pub(crate) fn magnitude<N: Number>(x: N) -> N {
    x.and_bits(u64::MAX >> 1)
}

/// a − b
pub(crate) fn difference<N: Number>(a: &[N], b: &[N]) -> Vec<N> {
    a.iter().zip(b).map(|(a, b)| *a - *b).collect()
}

/// An error if a surface that is given is wrong.
pub(crate) fn check(signature: &Signature, i: usize, dim: usize) -> Result<(), Error> {
    let name = |part: &str| format!("contact_{i}{part}");
    let count = |part: &str| signature.count(&name(part));
    let expect = |what: &'static str, part: &str, expected: usize| match count(part) {
        got if got == expected => Ok(()),
        got => Err(Error::Shape { what, expected, got }),
    };
    match signature.word(&name("")) {
        "plane" => {
            expect("normal", "_normal", dim)?;
            expect("offset", "_offset", 1)?;
        }
        "sphere" => {
            expect("centre", "_centre", dim)?;
            expect("radius", "_radius", 1)?;
            if !matches!(signature.word(&name("_side")), "inside" | "outside") {
                return Err(signature.unknown(&name("_side")));
            }
        }
        _ => return Err(signature.unknown(&name(""))),
    }
    match signature.word(&name("_way")) {
        "safe" | "restitution" => expect("restitution", "_restitution", 1),
        "flip" => Ok(()),
        "spring" => expect("omega", "_omega", 1),
        _ => Err(signature.unknown(&name("_way"))),
    }
}

/// The ways of all surfaces.
pub(crate) fn ways(signature: &Signature) -> impl Iterator<Item = &str> {
    (0..signature.whole("contacts")).map(|i| signature.word(&format!("contact_{i}_way")))
}

/// The surfaces of some ways.
pub(crate) fn all<N: Number>(p: &Parameters<N>, is_wanted: impl Fn(ContactMode) -> bool) -> Vec<Surface<N>> {
    (0..p.signature.whole("contacts")).map(|i| Surface::new(p, i)).filter(|surface| is_wanted(surface.way)).collect()
}

impl<N: Number> Surface<N> {
    fn new(p: &Parameters<N>, i: usize) -> Surface<N> {
        let name = |part: &str| format!("contact_{i}{part}");
        let location = if p.signature.word(&name("")) == "plane" {
            Location::Plane { normal: p.numbers(&name("_normal")).to_vec(), offset: p.number(&name("_offset")) }
        } else {
            let is_inside = p.signature.word(&name("_side")) == "inside";
            Location::Sphere { is_inside, centre: p.numbers(&name("_centre")).to_vec(), radius: p.number(&name("_radius")) }
        };
        let way = match p.signature.word(&name("_way")) {
            "safe" => ContactMode::Safe,
            "spring" => ContactMode::Spring,
            _ => ContactMode::Turn,
        };
        Surface {
            way,
            restitution: p.maybe(&name("_restitution")),
            friction: p.maybe(&name("_friction")),
            stiffness: p.maybe(&name("_omega")).map(|omega| p.h * (omega * omega)),
            location,
        }
    }

    /// Whether it is a sphere.
    pub(crate) fn is_curved(&self) -> bool {
        matches!(self.location, Location::Sphere { .. })
    }

    /// Where a point is that began the step at `y0`.
    ///
    /// To a sphere it is measured from the plane that touches it where the straight way from `y0` to `y` meets it, or else
    /// nearest to `y`.
    pub(crate) fn place(&self, y0: &[N], y: &[N]) -> Place<N> {
        match &self.location {
            Location::Plane { normal, offset } => {
                let distance = dot(y, normal) - *offset;
                let sizes = y.iter().zip(normal).map(|(y, n)| magnitude(*y * *n)).reduce(|sum, next| sum + next);
                let slack = rounding::<N>() * (sizes.unwrap_or(N::of(0.0)) + magnitude(*offset));
                let before = dot(y0, normal) - *offset;
                Place { near: distance.at_most(slack), normal: normal.clone(), distance, before, slack }
            }
            Location::Sphere { is_inside, centre, radius } => {
                let (from0, along, from1) = (difference(y0, centre), difference(y, y0), difference(y, centre));
                let (zero, one) = (N::of(0.0), N::of(1.0));
                let (a, b, square) = (dot(&along, &along), dot(&from0, &along), dot(&from0, &from0));
                let c = square - *radius * *radius;
                let sizes = centre.iter().map(|c| magnitude(*c)).reduce(|sum, next| sum + next);
                let slack = rounding::<N>() * (*radius + sizes.unwrap_or(zero));
                let disc = b * b - a * c;
                let root = N::choose(zero.below(disc), disc, zero).sqrt();
                let (part, hits) = if *is_inside {
                    let part = N::choose(b.below(zero), (root - b) / a, -(c / (b + root)));
                    (part, c.at_most(zero) & part.at_most(one))
                } else {
                    let part = c / (root - b);
                    // Or on the sphere, but for rounding.
                    let outside = (-(*radius * (slack + slack))).at_most(c);
                    (part, zero.below(disc) & b.below(zero) & outside & part.at_most(one))
                };
                let met: Vec<N> = (0..y.len()).map(|i| N::choose(hits, from0[i] + part * along[i], from1[i])).collect();
                let length = dot(&met, &met).sqrt();
                let normal: Vec<N> = met.iter().map(|m| *m / length).map(|n| if *is_inside { -n } else { n }).collect();
                let through = dot(&from1, &normal);
                let distance = if *is_inside { through + *radius } else { through - *radius };
                let near = hits | self.depth(dot(&from1, &from1).sqrt()).at_most(slack);
                Place { near, normal, distance, before: self.depth(square.sqrt()), slack }
            }
        }
    }

    /// The distance of a point from a sphere, from that from its centre.
    #[inline(always)]
    fn depth(&self, length: N) -> N {
        match self.location {
            Location::Sphere { is_inside: true, radius, .. } => radius - length,
            Location::Sphere { is_inside: false, radius, .. } => length - radius,
            Location::Plane { .. } => length,
        }
    }

    /// The distance of a point from the surface itself.
    pub(crate) fn depth_of(&self, y: &[N]) -> N {
        match &self.location {
            Location::Plane { normal, offset } => dot(y, normal) - *offset,
            Location::Sphere { centre, .. } => {
                let way = difference(y, centre);
                self.depth(dot(&way, &way).sqrt())
            }
        }
    }

    /// A point near the surface, put at that distance from it along the radius; on a plane it is already.
    pub(crate) fn back(&self, y: &[N], distance: N) -> Vec<N> {
        match &self.location {
            Location::Plane { .. } => y.to_vec(),
            Location::Sphere { is_inside, centre, radius } => {
                let way = difference(y, centre);
                let length = if *is_inside { *radius - distance } else { *radius + distance };
                let scale = length / dot(&way, &way).sqrt();
                centre.iter().zip(way).map(|(c, w)| *c + scale * w).collect()
            }
        }
    }

    /// Adds the push of its spring to increments of the velocities of points in D directions.
    #[inline(always)]
    pub(crate) fn push<const D: usize>(&self, y: &[[N; D]], dv: &mut [[N; D]]) {
        let (zero, stiffness) = (N::of(0.0), self.stiffness.unwrap_or(N::of(f64::NAN)));
        match &self.location {
            Location::Plane { normal, offset } => {
                let (mut along, offset) = ([zero; D], *offset);
                along.copy_from_slice(normal);
                for (y, dv) in y.iter().zip(dv) {
                    let distance = dot(y, &along) - offset;
                    let strength = stiffness * N::choose(distance.below(zero), distance, zero);
                    (0..D).for_each(|c| dv[c] -= strength * along[c]);
                }
            }
            Location::Sphere { is_inside, centre, .. } => {
                let mut middle = [zero; D];
                middle.copy_from_slice(centre);
                for (y, dv) in y.iter().zip(dv) {
                    let way: [N; D] = std::array::from_fn(|c| y[c] - middle[c]);
                    let length = dot(&way, &way).sqrt();
                    let distance = self.depth(length);
                    let strength = stiffness * N::choose(distance.below(zero), distance / length, zero);
                    (0..D).for_each(|c| dv[c] -= strength * if *is_inside { -way[c] } else { way[c] });
                }
            }
        }
    }
}

impl Surface<f64> {
    /// How near points are to it.
    pub(crate) fn reach(&self) -> Reach<'_> {
        match &self.location {
            Location::Plane { normal, offset } => Reach { form: Form::Plane, place: normal, size: *offset },
            Location::Sphere { is_inside, centre, radius } => {
                Reach { form: if *is_inside { Form::Inside } else { Form::Outside }, place: centre, size: *radius }
            }
        }
    }
}

//! Contact of points with planes and spheres (§1, elastic reflection): what happens to a point after the step that met one.
//!
//! The rows of the blocks are points. A surface of the way `spring` adds a force to the rates; the others act after the step, on
//! the state that the method made, knowing the one before. What is computed, and why no energy is added, is in
//! `reference/contact.py` and docs/howto/contact.md.
//!
//! Given: the list `fixed` (maybe), points that no surface acts on; the whole number `contacts`; for surface i, with `contact_i`
//! before each name, a word, `plane` or `sphere`, the word `_way`, and `_restitution`, `_friction` (maybe), `_omega` (of a
//! spring); of a plane the vector `_normal` and `_offset`; of a sphere the word `_side`, `inside` or `outside`, the vector
//! `_centre` and `_radius`.

mod joined;
mod meet;
mod rods;
mod surface;

use meet::{OPERATIONS, Step};
use rods::RodContacts;
use surface::{ContactMode, Surface};
pub(crate) use surface::{Form, Reach, ways};

use super::{
    controls,
    part::{Attempts, Part},
};
use crate::{
    error::Error,
    model::{
        methods::Method,
        program::Program,
        spec::{Parameters, Signature},
        system::{Block, Shape, System},
    },
    tape::number::Number,
};

/// Whether points meet any surface.
pub(crate) fn is_given(signature: &Signature) -> bool {
    signature.whole("contacts") > 0
}

/// Approximate number of operations that surfaces add to a step of blocks of this size.
pub(crate) fn operations(signature: &Signature, shape: Shape) -> usize {
    let dim = dimensions(signature);
    if is_given(signature) && are_rods(signature) {
        return rods::operations(signature, shape.y / dim, dim);
    }
    OPERATIONS * signature.whole("contacts") * shape.y / dim
}

/// Whether the points are joined by rods.
fn are_rods(signature: &Signature) -> bool {
    matches!(signature.system.as_str(), "rods" | "pendulum_3d")
}

/// The part: springs. Other surfaces act after a step, see [`Contacts`].
pub(crate) fn part<N: Number>() -> Part<N> {
    Part {
        name: "contacts",
        is_given,
        check: |_, signature, shape| check(signature, shape),
        velocity_term: |_, _| None,
        attempts: Attempts::Scaled,
        is_for_carry: true,
        is_only_fixed: |signature| ways(signature).any(|way| way != "spring"), // a bounce is an instant within a step
        has_rows: true,
        wrap: |p, system, _| match Springs::new(p) {
            Some(springs) => Box::new(Sprung { system, springs }),
            None => system,
        },
    }
}

/// An error if the surfaces are wrong, or beside a control, which would undo what they do.
fn check(signature: &Signature, shape: Shape) -> Result<(), Error> {
    if controls::is_given(signature) {
        return Err(signature.unknown("control"));
    }
    let dim = dimensions(signature);
    for i in 0..signature.whole("contacts") {
        surface::check(signature, i, dim)?;
        if are_rods(signature) && signature.word(&format!("contact_{i}_way")) != "safe" {
            return Err(signature.unknown(&format!("contact_{i}_way")));
        }
    }
    if shape.v != shape.y || !shape.y.is_multiple_of(dim) {
        return Err(Error::Shape { what: "points that meet a surface", expected: dim, got: shape.y });
    }
    Ok(())
}

/// How many numbers a point has.
pub(crate) fn dimensions(signature: &Signature) -> usize {
    signature.count("contact_0_normal").max(signature.count("contact_0_centre")).max(1)
}

/// Fixed points, sorted: no surface acts on them.
fn fixed(signature: &Signature) -> Vec<u32> {
    let mut fixed = signature.list("fixed").to_vec();
    fixed.sort_unstable();
    fixed
}

fn is_among(points: &[u32], point: usize) -> bool {
    u32::try_from(point).is_ok_and(|point| points.binary_search(&point).is_ok())
}

/// The surfaces that act after a step.
pub struct Contacts<N: Number> {
    h: N,
    dim: usize,
    fixed: Vec<u32>,
    surfaces: Vec<Surface<N>>,
    /// The rods, if they join the points.
    rods: Option<RodContacts<N>>,
    /// Whether the energy is compared: along one plane without friction it is right by itself.
    is_limited: bool,
}

impl<N: Number> Contacts<N> {
    /// The surfaces that are given; None if none acts after a step.
    pub fn new(p: &Parameters<N>) -> Option<Contacts<N>> {
        let surfaces = surface::all(p, |way| way != ContactMode::Spring);
        let safe: Vec<_> = surfaces.iter().filter(|surface| surface.way == ContactMode::Safe).collect();
        let is_limited = safe.len() > 1 || safe.iter().any(|surface| surface.is_curved() || surface.friction.is_some());
        let (dim, fixed) = (dimensions(p.signature), fixed(p.signature));
        (!surfaces.is_empty()).then(|| Contacts { h: p.h, dim, fixed, surfaces, rods: RodContacts::new(p), is_limited })
    }

    /// Whether the points are joined by rods, so that all of them are to be resolved together.
    pub(crate) fn are_joined(&self) -> bool {
        self.rods.is_some()
    }

    /// Applies contact to points on rods, in place. The state before the step comes first.
    pub(crate) fn resolve_joined(&self, before: [&[N]; 2], [v, y]: [&mut [N]; 2]) {
        if let Some(rods) = &self.rods {
            rods.resolve(&self.surfaces, before, v, y);
        }
    }

    /// Applies contact to a point, in place, and returns whether it met a surface. The state before the step comes first.
    pub(crate) fn resolve_point(&self, before: [&[N]; 2], [v, y]: [&mut [N]; 2]) -> Option<N::Truth> {
        let step = Step::new(self.h, before, [v, y]);
        let mut touched: Option<N::Truth> = None;
        for surface in &self.surfaces {
            let touches = meet::meet(surface, &step, v, y);
            touched = Some(touched.map_or(touches, |before| before | touches));
        }
        if let (true, Some(touched)) = (self.is_limited, touched) {
            meet::limit(&step, touched, v, y);
        }
        touched
    }

    /// Whether surfaces act on a point: not if it is fixed.
    pub(crate) fn acts_on(&self, point: usize) -> bool {
        !is_among(&self.fixed, point)
    }

    /// The points that met a surface in a step, None for those that no surface acts on, and the state after that.
    fn resolve(&self, before: [&Block<N>; 2], [mut v, mut y]: [Block<N>; 2]) -> (Vec<Option<N::Truth>>, [Block<N>; 2]) {
        let mut touched = vec![None; y.len() / self.dim];
        if self.are_joined() {
            self.resolve_joined(before.map(Block::as_slice), [v.as_mut_slice(), y.as_mut_slice()]);
            return (touched, [v, y]); // only methods without a carry step them
        }
        for (i, touched) in touched.iter_mut().enumerate().filter(|(i, _)| self.acts_on(*i)) {
            let (from, to) = (self.dim * i, self.dim * (i + 1));
            let [v0, y0] = before.map(|block| &block.as_slice()[from..to]);
            *touched = self.resolve_point([v0, y0], [&mut v.as_mut_slice()[from..to], &mut y.as_mut_slice()[from..to]]);
        }
        (touched, [v, y])
    }

    /// The state after a step of a method. What it carries or keeps begins anew where a point met a surface.
    pub fn after(
        &self,
        carry: Carry,
        s: &dyn System<N>,
        t: N,
        before: [&Block<N>; 2],
        after: [Block<N>; 2],
        kept: &mut [Block<N>],
    ) -> [Block<N>; 2] {
        let Some(start) = carry.start else { return self.resolve(before, after).1 };
        let finished = |t: N, slot: &Block<N>, y: &Block<N>| match carry.finish {
            Some(finish) => finish.run(s, t, self.h, slot, y).into_iter().next().unwrap_or_else(|| slot.clone()),
            None => slot.clone(),
        };
        let (end, [slot, y1]) = (t + self.h, after);
        let (v0, v1) = (finished(t, before[0], before[1]), finished(end, &slot, &y1));
        let (touched, [v, y]) = self.resolve([&v0, before[1]], [v1, y1]);
        let anew = start.run(s, end, self.h, &v, &y);
        let renewed = |old: &Block<N>, new: &Block<N>| {
            Block::from_fn(old.len(), |i, _| touched[i / self.dim].map_or(old[i], |it| N::choose(it, new[i], old[i])))
        };
        for (old, new) in kept.iter_mut().zip(&anew[1..]) {
            *old = renewed(old, new);
        }
        [if carry.finish.is_some() { renewed(&slot, &anew[0]) } else { v }, y]
    }
}

impl Contacts<f64> {
    /// Whether any point on rods may have met a surface in a step.
    pub(crate) fn is_any_near(&self, before: &[f64], y: &[f64]) -> bool {
        self.rods.as_ref().is_some_and(|rods| rods.is_near(&self.surfaces, before, y))
    }

    /// How near points are to each surface.
    pub(crate) fn reaches(&self) -> impl Iterator<Item = Reach<'_>> {
        self.surfaces.iter().map(Surface::reach)
    }
}

/// The programs with which a method goes from velocities to what it carries or keeps, and back.
#[derive(Clone, Copy)]
pub struct Carry<'a> {
    start: Option<&'a Program>,
    finish: Option<&'a Program>,
}

/// The programs that carry the velocities of this method across a bounce.
pub fn carry(method: &Method, choice: usize) -> Carry<'_> {
    Carry { start: method.start(choice), finish: method.finish(choice) }
}

/// Surfaces that push points back by springs.
pub(crate) struct Springs<N: Number> {
    dim: usize,
    fixed: Vec<u32>,
    surfaces: Vec<Surface<N>>,
}

impl<N: Number> Springs<N> {
    /// The springs of this model's surfaces, or None.
    pub(crate) fn new(p: &Parameters<N>) -> Option<Springs<N>> {
        let surfaces = surface::all(p, |way| way == ContactMode::Spring);
        (!surfaces.is_empty()).then(|| Springs { dim: dimensions(p.signature), fixed: fixed(p.signature), surfaces })
    }

    /// Adds their pushes to increments of the velocities of points that are there.
    #[inline(always)]
    pub(crate) fn push(&self, y: &[N], dv: &mut [N]) {
        match self.dim {
            1 => self.push_points::<1>(y, dv),
            2 => self.push_points::<2>(y, dv),
            _ => self.push_points::<3>(y, dv),
        }
    }

    /// The pushes in D directions, to the points between those that are fixed.
    #[inline(always)]
    fn push_points<const D: usize>(&self, y: &[N], dv: &mut [N]) {
        let (y, dv) = (y.as_chunks::<D>().0, dv.as_chunks_mut::<D>().0);
        let mut first = 0;
        for end in self.fixed.iter().map(|point| *point as usize).chain([y.len()]) {
            if first < end {
                self.surfaces.iter().for_each(|surface| surface.push(&y[first..end], &mut dv[first..end]));
            }
            first = end + 1;
        }
    }
}

struct Sprung<N: Number> {
    system: Box<dyn System<N>>,
    springs: Springs<N>,
}

impl<N: Number> System<N> for Sprung<N> {
    fn inner(&self) -> Option<&dyn System<N>> {
        Some(self.system.as_ref())
    }

    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let mut dv = self.system.dv(t, v, y);
        self.springs.push(y.as_slice(), dv.as_mut_slice());
        dv
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.system.dy(t, v, y)
    }
}

//! The points that may have met a surface: a test of many side by side, which may name too many points but never too few.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use crate::{
    isa::{Level, Task, with_isa},
    model::around::contact::{Contacts, Form, Reach},
};

/// Lanes of a test: numbers of eight points of one member, or of one or two points of several.
const SIDE: usize = 8;

type Vector = [f64; SIDE];

/// A surface, with the numbers that it has for each lane of a vector.
struct Wall {
    form: Form,
    /// The normal, or the centre.
    place: [Vector; 3],
    /// The offset, or the radius.
    size: Vector,
    /// The rounding error of a distance, beyond its share of the tested point's size.
    slack: Vector,
}

/// The surfaces of a group of members.
pub(super) struct Near {
    level: Level,
    dim: usize,
    lanes: usize,
    walls: Vec<Wall>,
}

/// Shares by which numbers are taken larger than they are, far more than what rounding can do.
const PLANE_MARGIN: f64 = 1.0 / (1u64 << 40) as f64;
const SPHERE_MARGIN: f64 = 1.0 / (1u64 << 20) as f64;

impl Near {
    /// The surfaces of each lane; all lanes have the same ones, with other numbers.
    pub(super) fn new(level: Level, dim: usize, lanes: &[Contacts<f64>]) -> Near {
        let reaches: Vec<Vec<Reach>> = lanes.iter().map(|contacts| contacts.reaches().collect()).collect();
        let wall = |i: usize| {
            let (mut place, mut size, mut slack) = ([[0.0; SIDE]; 3], [0.0; SIDE], [0.0; SIDE]);
            for l in 0..SIDE {
                let reach = &reaches[l % lanes.len()][i];
                let numbers = &reach.place;
                (0..dim).for_each(|c| place[c][l] = numbers[c]);
                size[l] = reach.size;
                slack[l] = match reach.form {
                    Form::Plane => PLANE_MARGIN * size[l].abs(),
                    Form::Inside | Form::Outside => SPHERE_MARGIN * numbers.iter().fold(size[l], |sum, c| sum + c.abs()),
                };
            }
            Wall { form: reaches[0][i].form, place, size, slack }
        };
        let walls = (0..reaches.first().map_or(0, Vec::len)).map(wall).collect();
        Near { level, dim, lanes: lanes.len(), walls }
    }

    /// Appends the points that may have met a surface in any lane, by the coordinates before and after a step.
    pub(super) fn find(&self, y0: &[f64], y: &[f64], points: &mut Vec<u32>) {
        let Near { level, dim, lanes, .. } = *self;
        macro_rules! find {
            ($dim:literal, $one:literal) => {
                with_isa!(level, |isa| isa.run(Search::<$dim, $one> { near: self, y0, y, points }))
            };
        }
        match (dim, lanes) {
            (1, 1) => find!(1, true),
            (2, 1) => find!(2, true),
            (_, 1) => find!(3, true),
            (1, _) => find!(1, false),
            (2, _) => find!(2, false),
            _ => find!(3, false),
        }
    }
}

/// The search, in D directions, of one member or of several side by side.
struct Search<'a, const D: usize, const ONE: bool> {
    near: &'a Near,
    y0: &'a [f64],
    y: &'a [f64],
    points: &'a mut Vec<u32>,
}

/// The coordinates of a vector of points of one member, a vector for each direction.
#[inline(always)]
fn apart<const D: usize>(points: &[[f64; D]; SIDE]) -> [Vector; D] {
    let mut vectors = [[0.0; SIDE]; D];
    for c in 0..D {
        for l in 0..SIDE {
            vectors[c][l] = points[l][c];
        }
    }
    vectors
}

/// The numbers of a vector from place `i` on; what is past the end repeats the last place.
#[inline(always)]
fn gather<const D: usize>(block: &[f64], i: usize, lanes: usize) -> [Vector; D] {
    let (mut vectors, last) = ([[0.0; SIDE]; D], block.len() / D - 1);
    for l in 0..SIDE {
        let place = (i + l).min(last);
        for c in 0..D {
            vectors[c][l] = block[(place / lanes * D + c) * lanes + place % lanes];
        }
    }
    vectors
}

/// The square of a length.
#[inline(always)]
fn square<const D: usize>(way: &[Vector; D]) -> Vector {
    let mut square = [0.0; SIDE];
    for c in 0..D {
        for l in 0..SIDE {
            square[l] += way[c][l] * way[c][l];
        }
    }
    square
}

impl Wall {
    /// Adds the lanes that may have met it. What is not a number may have.
    #[inline(always)]
    fn meets<const D: usize>(&self, y0: impl Fn() -> [Vector; D], y: &[Vector; D], near: &mut [u64; SIDE]) {
        let Wall { form, place, size, slack } = self;
        let (mut from, mut least) = ([[0.0; SIDE]; D], [0.0; SIDE]);
        match form {
            Form::Plane => {
                let (mut sum, mut sizes) = ([0.0; SIDE], [0.0; SIDE]);
                for c in 0..D {
                    for l in 0..SIDE {
                        let product = y[c][l] * place[c][l];
                        sum[l] += product;
                        sizes[l] += product.abs();
                    }
                }
                for l in 0..SIDE {
                    let is_far = sum[l] - size[l] > PLANE_MARGIN * sizes[l] + slack[l];
                    near[l] |= u64::from(!is_far);
                }
                return;
            }
            Form::Outside => {
                let y0 = y0();
                for c in 0..D {
                    for l in 0..SIDE {
                        from[c][l] = y[c][l] - y0[c][l];
                    }
                }
                // A way that crosses a sphere ends no farther from it than it is long.
                let way = square(&from);
                for l in 0..SIDE {
                    least[l] = way[l].sqrt() * (1.0 + SPHERE_MARGIN);
                }
            }
            Form::Inside => {} // a way that leaves a sphere ends outside
        }
        for c in 0..D {
            for l in 0..SIDE {
                from[c][l] = y[c][l] - place[c][l];
            }
        }
        let way = square(&from);
        for l in 0..SIDE {
            let depth = way[l].sqrt() - size[l];
            let is_far = if matches!(form, Form::Inside) { depth < -slack[l] } else { depth - slack[l] > least[l] };
            near[l] |= u64::from(!is_far);
        }
    }
}

impl<const D: usize, const ONE: bool> Search<'_, D, ONE> {
    /// Tests the `places` places from `i` on.
    #[inline(always)]
    fn vector(&mut self, [i, places]: [usize; 2], y0: impl Fn() -> [Vector; D], y: &[Vector; D]) {
        let (mut near, lanes) = ([0; SIDE], if ONE { 1 } else { self.near.lanes });
        for wall in &self.near.walls {
            wall.meets(&y0, y, &mut near);
        }
        if near.iter().fold(0, |any, one| any | one) == 0 {
            return;
        }
        for (k, near) in near[..places].chunks(lanes).enumerate() {
            if near.contains(&1) {
                self.points.push((i / lanes + k) as u32);
            }
        }
    }
}

impl<const D: usize, const ONE: bool> Task for Search<'_, D, ONE> {
    #[inline(always)]
    fn run(mut self) {
        let (y0, y) = (self.y0, self.y);
        let (vectors, places) = (y.as_chunks::<D>().0.as_chunks::<SIDE>().0, y.len() / D);
        let whole = if ONE { vectors.len() } else { 0 };
        let before = y0.as_chunks::<D>().0.as_chunks::<SIDE>().0;
        for (k, (y0, y)) in before.iter().zip(vectors).take(whole).enumerate() {
            self.vector([SIDE * k, SIDE], || apart(y0), &apart(y));
        }
        let lanes = if ONE { 1 } else { self.near.lanes };
        for i in (SIDE * whole..places).step_by(SIDE) {
            self.vector([i, (places - i).min(SIDE)], || gather(y0, i, lanes), &gather(y, i, lanes));
        }
    }
}

//! Contact of points that are joined by rods: impulses of surfaces and pulls of rods are found together.
//!
//! The formulas, and the reasons for them, are in `reference/rod_contact.py` and docs/howto/contact.md.

use super::{
    joined::{Column, Joined, add},
    meet::{Change, OPERATIONS, Rest, Step, bounce},
    surface::{Place, Surface, dot, magnitude, rounding},
};
use crate::{
    model::{
        elimination::Factors,
        spec::{Parameters, Signature},
        systems::rods::Links,
    },
    tape::number::Number,
};

/// Visits of points that surfaces have changed together.
const SWEEPS: usize = 10;

/// Rounds in which points are put on surfaces and rods are given their lengths, and the visits of a round.
const ROUNDS: usize = 3;
const VISITS: usize = 3;

/// Below this share of 1/m of the point alone, 1/m at a contact is rounding: rods hold the point in that direction.
const HELD: f64 = 1.0 / (1u64 << 40) as f64;

/// A point at most this many rounding errors of its distance behind a surface at the start is lifted onto it: rounding, added up.
const SHALLOW: f64 = (1u64 << 20) as f64;

/// Rods rest if contact leaves less than this share of the square of their speeds: only rounding is left.
const REST: f64 = 1.0 / ((1u128 << 90) as f64);

/// Approximate number of operations that surfaces add to a step of `points` points on rods.
pub(crate) fn operations(signature: &Signature, points: usize, dim: usize) -> usize {
    let (surfaces, rods) = (signature.whole("contacts"), signature.whole("rods").max(1));
    let rough = (0..surfaces).filter(|i| signature.has(&format!("contact_{i}_friction"))).count();
    let (columns, visits) = (surfaces + (dim - 1) * rough, SWEEPS + (2 * ROUNDS - 1) * VISITS);
    let column = 4 * rods + 2 * points * dim;
    let (visit, rub) = (2 * dim + 6 + 2 * points * dim, (dim - 1) * (2 * points * dim + 2 * dim + 10));
    points * (OPERATIONS * surfaces + columns * column + visits * surfaces * visit + SWEEPS * rough * rub)
}

/// A point and a surface, where it met it, and what an impulse there does.
struct Contact<'a, N: Number> {
    point: usize,
    surface: &'a Surface<N>,
    place: Place<N>,
    touches: N::Truth,
    change: Change<N>,
    rest: Rest<N>,
    /// The velocity along the normal that it leaves with at least.
    aim: N,
    /// The distance below which it is not left.
    low: N,
    /// The change of all velocities by a unit impulse along the normal.
    column: Column<N>,
    /// The velocity of the point itself along the normal by that impulse, infinite where there is no contact.
    give: N,
    /// This velocity, infinite only where rods hold the point.
    yields: N,
    /// Directions along the surface with the columns of these, and the factored matrix of their mutual effects; with friction.
    tangents: Vec<(Vec<N>, Column<N>)>,
    grip: Option<Factors<N>>,
}

/// Unit vectors at right angles to a unit vector and to each other (Duff et al. 2017).
fn tangents<N: Number>(n: &[N]) -> Vec<Vec<N>> {
    if let [x, y] = *n {
        return vec![vec![-y, x]];
    }
    let one = N::of(1.0);
    let sign = N::choose(n[2].below(N::of(0.0)), -one, one);
    let a = -one / (sign + n[2]);
    let b = (n[0] * n[1]) * a;
    vec![vec![one + (sign * (n[0] * n[0])) * a, sign * b, -(sign * n[0])], vec![b, sign + (n[1] * n[1]) * a, -n[1]]]
}

/// The impulses of contacts: along the normals, along the tangents, and whether these hold the point.
struct Impulses<N: Number> {
    normal: Vec<N>,
    shear: Vec<Vec<N>>,
    sticks: Vec<Option<N::Truth>>,
}

/// The surfaces that the points of rods meet.
pub(crate) struct RodContacts<N: Number> {
    h: N,
    links: Links<N>,
    gravity: N,
    /// Points that are joined, directly or by others.
    groups: Vec<Vec<usize>>,
}

impl<N: Number> RodContacts<N> {
    /// None if the points are not on rods.
    pub(crate) fn new(p: &Parameters<N>) -> Option<Self> {
        let links = Links::from_parameters(p)?;
        let mut of: Vec<usize> = (0..links.masses.len()).collect();
        for [a, b] in &links.ends {
            if links.is_point(*a) {
                let (low, high) = (of[*a].min(of[*b]), of[*a].max(of[*b]));
                of.iter_mut().filter(|group| **group == high).for_each(|group| *group = low);
            }
        }
        let members = |group: usize| (0..of.len()).filter(|i| of[*i] == group).collect::<Vec<_>>();
        let groups = (0..of.len()).map(members).filter(|group| !group.is_empty()).collect();
        Some(RodContacts { h: p.h, links, gravity: p.number("gravity"), groups })
    }

    /// Applies contact to the points after a step, in place. The state before the step comes first.
    pub(crate) fn resolve(&self, surfaces: &[Surface<N>], before: [&[N]; 2], v: &mut [N], y: &mut [N]) {
        let after = [v.to_vec(), y.to_vec()];
        let after = [&after[0][..], &after[1][..]];
        let joined = Joined::new(&self.links, y);
        let contacts = self.contacts(surfaces, &joined, before, after);
        let mut impulses = strike(&contacts, v);
        self.shift(&contacts, &impulses, before, after[0], y);
        let turned = self.put(&contacts, &impulses, &joined.squares(), y);
        make_consistent(&contacts, &mut impulses, &turned, v);
        for points in &self.groups {
            self.limit(points, &contacts, before, after, (v, y));
        }
    }

    /// Where a point is to a surface, with distances as exact as those of points that rods have moved.
    pub(crate) fn place(&self, surface: &Surface<N>, i: usize, y0: &[N], y1: &[N]) -> Place<N> {
        let mut place = surface.place(y0, y1);
        let size = y1.iter().map(|y| magnitude(*y)).reduce(|sum, next| sum + next).unwrap_or(N::of(0.0));
        let at_it = self.links.ends.iter().zip(&self.links.lengths).filter(|(ends, _)| ends.contains(&i));
        place.slack += rounding::<N>() * at_it.fold(size, |size, (_, length)| size + *length);
        place.near = place.near | place.distance.at_most(place.slack);
        place
    }

    fn point<'a>(&self, block: &'a [N], i: usize) -> &'a [N] {
        &block[i * self.links.dim..][..self.links.dim]
    }

    /// The contacts of each point with each surface.
    fn contacts<'a>(
        &self,
        surfaces: &'a [Surface<N>],
        joined: &Joined<N>,
        before: [&[N]; 2],
        after: [&[N]; 2],
    ) -> Vec<Contact<'a, N>> {
        let (zero, held, infinite) = (N::of(0.0), N::of(HELD), N::of(f64::INFINITY));
        let (factors, mut found) = (joined.factors(), Vec::new());
        for i in 0..self.links.masses.len() {
            let ([v0, y0], [v1, y1]) = (before.map(|block| self.point(block, i)), after.map(|block| self.point(block, i)));
            let (step, inverse) = (Step::new(self.h, [v0, y0], [v1, y1]), self.links.inverse[i]);
            for surface in surfaces {
                let place = self.place(surface, i, y0, y1);
                let speed = dot(v1, &place.normal);
                let (touches, mut change) = bounce(surface, &step, &place, speed);
                let Some(rest) = change.rest.take() else { continue };
                let aim = N::choose(touches, change.speed, N::choose(speed.below(zero), speed, zero));
                let deep = (place.before + N::of(SHALLOW) * place.slack).below(zero);
                let low = N::choose(deep, place.before, zero);
                let own = |column: &Column<N>| column[i].clone().unwrap_or_default();
                let column = joined.column(&factors, i, &place.normal);
                let weight = dot(&place.normal, &own(&column));
                let yields = N::choose((held * inverse).below(weight), weight, infinite);
                let give = N::choose(place.near, yields, infinite);
                let (mut along, mut grip) = (Vec::new(), None);
                if surface.friction.is_some() {
                    let columned = |t: Vec<N>| (joined.column(&factors, i, &t), t);
                    along = tangents(&place.normal).into_iter().map(columned).map(|(column, t)| (t, column)).collect();
                    let entry = |r: usize, c: usize| dot(&along[r].0, &own(&along[c].1));
                    let rows = (0..along.len()).map(|r| (0..r).map(|c| Some(entry(r, c))).collect()).collect();
                    let pivots = (0..along.len()).map(|r| entry(r, r) + held * inverse).collect();
                    grip = Some(Factors::new(rows, pivots));
                }
                found.push(Contact {
                    point: i,
                    surface,
                    place,
                    touches,
                    change,
                    rest,
                    aim,
                    low,
                    column,
                    give,
                    yields,
                    tangents: along,
                    grip,
                });
            }
        }
        found
    }

    /// Moves the points to where they are if each impulse acted since the impact, or where they rest during all of the step.
    ///
    /// Points that stick do not move by the lag of a method.
    fn shift(&self, contacts: &[Contact<N>], impulses: &Impulses<N>, before: [&[N]; 2], v1: &[N], y: &mut [N]) {
        let half = N::of(0.5) * self.h;
        for points in &self.groups {
            let stuck = contacts.iter().zip(&impulses.sticks).filter(|(each, _)| points.contains(&each.point));
            let held = stuck.filter_map(|(each, stuck)| Some(each.touches & each.rest.rests & (*stuck)?));
            let Some(held) = held.reduce(|held, next| held | next) else { continue };
            for k in points.iter().flat_map(|i| i * self.links.dim..(i + 1) * self.links.dim) {
                y[k] = N::choose(held, before[1][k] + half * (before[0][k] + v1[k]), y[k]);
            }
        }
        for (k, each) in contacts.iter().enumerate() {
            let since = N::choose(each.touches, N::choose(each.rest.rests, half, each.rest.since), N::of(0.0));
            add(y, &each.column, Some(since * impulses.normal[k]));
            for ((_, slide), shear) in each.tangents.iter().zip(&impulses.shear[k]) {
                add(y, slide, Some(since * *shear));
            }
        }
    }

    /// Puts the points where their bounces end, and not behind any surface, with rods of these lengths.
    fn put(&self, contacts: &[Contact<N>], impulses: &Impulses<N>, squares: &[N], y: &mut [N]) -> Joined<'_, N> {
        let zero = N::of(0.0);
        let (mut goals, mut least, mut pushes) = (Vec::new(), Vec::new(), vec![zero; contacts.len()]);
        for (each, impulse) in contacts.iter().zip(&impulses.normal) {
            let rests = each.touches & each.rest.rests;
            let bounces = each.touches & each.low.below(each.change.distance);
            goals.push(N::choose(bounces, each.change.distance, each.low));
            least.push(N::choose(rests & zero.below(*impulse), N::of(f64::NEG_INFINITY), zero));
        }
        for _ in 0..ROUNDS {
            for _ in 0..VISITS {
                for (k, each) in contacts.iter().enumerate() {
                    let more = (goals[k] - each.surface.depth_of(self.point(y, each.point))) / each.yields;
                    let more = N::choose((pushes[k] + more).below(least[k]), -pushes[k], more);
                    add(y, &each.column, Some(more));
                    pushes[k] += more;
                }
            }
            let joined = Joined::new(&self.links, y);
            let off = joined.squares().iter().zip(squares).map(|(now, square)| N::of(0.5) * (*now - *square)).collect();
            joined.correct(&joined.factors(), y, off);
        }
        Joined::new(&self.links, y)
    }

    /// Limits the energy of joined points to that before the step, or after it without contact.
    ///
    /// The excess is taken from their velocities. Where even at rest they would have more, they stay where they were.
    fn limit(&self, points: &[usize], contacts: &[Contact<N>], before: [&[N]; 2], after: [&[N]; 2], made: (&mut [N], &mut [N])) {
        let (zero, one, (v, y)) = (N::of(0.0), N::of(1.0), made);
        let touching = contacts.iter().filter(|each| points.contains(&each.point)).map(|each| each.touches);
        let Some(touched) = touching.reduce(|touched, next| touched | next) else { return };
        let total = |of: &dyn Fn(&[N]) -> N, block: &[N]| {
            let each = points.iter().map(|i| self.links.masses[*i] * of(self.point(block, *i)));
            each.reduce(|sum, next| sum + next).unwrap_or(zero)
        };
        let kinetic = |v: &[N]| total(&|v| dot(v, v), v);
        let fall = self.gravity + self.gravity;
        let potential = |y: &[N]| fall * total(&|y| y[self.links.dim - 1], y);
        let (begun, high, square, raw) = (kinetic(before[0]), potential(y), kinetic(v), kinetic(after[0]));
        let (most, free) = (begun + (potential(before[1]) - high), raw + (potential(after[1]) - high));
        let most = N::choose(most.below(free), free, most);
        let rests = square.at_most(N::of(REST) * raw);
        let stays = (most.at_most(zero) | (rests & begun.at_most(zero))) & square.below(N::of(f64::INFINITY));
        let factor = N::choose(most.below(square), (most / square).sqrt(), one);
        for k in points.iter().flat_map(|i| i * self.links.dim..(i + 1) * self.links.dim) {
            v[k] = N::choose(touched, N::choose(stays | rests, zero, factor * v[k]), after[0][k]);
            y[k] = N::choose(touched, N::choose(stays, before[1][k], y[k]), after[1][k]);
        }
    }
}

impl RodContacts<f64> {
    /// Whether any point may have met a surface in a step, from where they were and are.
    pub(crate) fn is_near(&self, surfaces: &[Surface<f64>], before: &[f64], y: &[f64]) -> bool {
        let near = |i: usize, surface: &Surface<f64>| self.place(surface, i, self.point(before, i), self.point(y, i)).near;
        (0..self.links.masses.len()).any(|i| surfaces.iter().any(|surface| near(i, surface)))
    }
}

/// An impulse along the normal is corrected, but not to one that pulls.
fn visit<N: Number>(each: &Contact<N>, give: N, impulse: &mut N, v: &mut [N]) {
    let dim = each.place.normal.len();
    let more = (each.aim - dot(&each.place.normal, &v[each.point * dim..][..dim])) / give;
    let more = N::choose((*impulse + more).below(N::of(0.0)), -*impulse, more);
    add(v, &each.column, Some(more));
    *impulse += more;
}

/// Finds all impulses, and sets the velocities after them.
fn strike<N: Number>(contacts: &[Contact<N>], v: &mut [N]) -> Impulses<N> {
    let (zero, one) = (N::of(0.0), N::of(1.0));
    let shear = contacts.iter().map(|each| vec![zero; each.tangents.len()]).collect();
    let mut made = Impulses { normal: vec![zero; contacts.len()], shear, sticks: vec![None; contacts.len()] };
    for _ in 0..SWEEPS {
        for (k, each) in contacts.iter().enumerate() {
            visit(each, each.give, &mut made.normal[k], v);
            let (Some(grip), Some(friction)) = (&each.grip, each.surface.friction) else { continue };
            let dim = each.place.normal.len();
            let at = &v[each.point * dim..][..dim];
            let slip = each.tangents.iter().map(|(along, _)| -dot(along, at)).collect();
            let wanted: Vec<N> = made.shear[k].iter().zip(grip.solve(slip)).map(|(p, x)| *p + x).collect();
            let (size, most) = (dot(&wanted, &wanted).sqrt(), friction * made.normal[k]);
            let sticks = size.at_most(most);
            made.sticks[k] = Some(sticks);
            let share = N::choose(sticks, one, most / size);
            for ((shear, wanted), (_, slide)) in made.shear[k].iter_mut().zip(wanted).zip(&each.tangents) {
                let p = share * wanted;
                add(v, slide, Some(p - *shear));
                *shear = p;
            }
        }
    }
    made
}

/// Velocities with none along the rods, and with none into the surfaces on which points rest, in place.
///
/// A point that bounced turns with its rods since the impact, by which its velocity along the normal changes.
fn make_consistent<N: Number>(contacts: &[Contact<N>], impulses: &mut Impulses<N>, joined: &Joined<N>, v: &mut [N]) {
    let factors = joined.factors();
    let resting =
        |each: &Contact<N>| N::choose(each.touches, N::choose(each.rest.rests, each.give, N::of(f64::INFINITY)), each.give);
    let gives: Vec<N> = contacts.iter().map(resting).collect();
    for _ in 1..ROUNDS {
        joined.correct(&factors, v, joined.closing(v));
        for _ in 0..VISITS {
            for (k, each) in contacts.iter().enumerate() {
                visit(each, gives[k], &mut impulses.normal[k], v);
            }
        }
    }
    joined.correct(&factors, v, joined.closing(v));
}

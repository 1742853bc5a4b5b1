//! The effect of a surface on a point that met it.

use super::surface::{ContactMode, Place, Surface, difference, dot, magnitude};
use crate::tape::number::Number;

/// Operations of a point that meets a surface, approximately.
pub(crate) const OPERATIONS: usize = 60;

/// The effect of a step of the method on a point, whatever the method.
pub(crate) struct Step<N: Number> {
    h: N,
    v0: Vec<N>,
    y0: Vec<N>,
    v1: Vec<N>,
    y1: Vec<N>,
    /// The increment of v.
    kick: Vec<N>,
    /// (y₁ − y₀)/h − ½(v₀ + v₁): in a uniform field 0, or half an increment of v for the methods of the Euler family.
    lag: Vec<N>,
}

impl<N: Number> Step<N> {
    /// The step between the states before and after.
    pub(crate) fn new(h: N, [v0, y0]: [&[N]; 2], [v1, y1]: [&[N]; 2]) -> Step<N> {
        let lag = (0..y0.len()).map(|i| (y1[i] - y0[i]) / h - N::of(0.5) * (v0[i] + v1[i])).collect();
        let kick = difference(v1, v0);
        Step { h, v0: v0.to_vec(), y0: y0.to_vec(), v1: v1.to_vec(), y1: y1.to_vec(), kick, lag }
    }
}

/// The effect of contact on a point.
pub(crate) struct Change<N: Number> {
    /// Its velocity along the normal.
    pub speed: N,
    /// Its distance from the plane that touches the surface.
    pub distance: N,
    /// None if the way knows no rest.
    pub rest: Option<Rest<N>>,
}

/// Whether a point rests, at which distance from the surface, and if it does not the time from the impact to the end of the step.
pub(crate) struct Rest<N: Number> {
    pub rests: N::Truth,
    pub low: N,
    pub since: N,
}

/// Whether a point meets a surface; if so it is changed in place.
pub(crate) fn meet<N: Number>(surface: &Surface<N>, step: &Step<N>, v: &mut [N], y: &mut [N]) -> N::Truth {
    let place = surface.place(&step.y0, y);
    let speed = dot(v, &place.normal);
    let (touches, change) = if surface.way == ContactMode::Safe {
        bounce(surface, step, &place, speed)
    } else {
        let leaving = -surface.restitution.map_or(speed, |restitution| restitution * speed);
        let touches = place.distance.below(N::of(0.0)) & speed.below(N::of(0.0));
        (touches, Change { speed: leaving, distance: place.distance, rest: None })
    };
    let (turn, lift) = (change.speed - speed, change.distance - place.distance);
    let lifted = y.iter().zip(&place.normal).map(|(y, n)| *y + lift * *n);
    let (new_v, mut new_y): (Vec<N>, Vec<N>) = match surface.friction {
        None => (v.iter().zip(&place.normal).map(|(v, n)| *v + turn * *n).collect(), lifted.collect()),
        Some(friction) => {
            let mut new_y: Vec<N> = lifted.collect();
            let slide: Vec<N> = v.iter().zip(&place.normal).map(|(v, n)| *v - speed * *n).collect();
            let kept = rub(friction * turn, step, y, &slide, (&place.normal, &change), &mut new_y);
            let new_v = slide.iter().zip(&place.normal).map(|(slide, n)| kept * *slide + change.speed * *n);
            (new_v.collect(), new_y)
        }
    };
    if let Some(Rest { rests, low, .. }) = change.rest {
        let resting = surface.back(&new_y, low);
        new_y.iter_mut().zip(resting).for_each(|(y, rest)| *y = N::choose(rests, rest, *y));
    }
    v.iter_mut().zip(new_v).for_each(|(v, new)| *v = N::choose(touches, new, *v));
    y.iter_mut().zip(new_y).for_each(|(y, new)| *y = N::choose(touches, new, *y));
    touches
}

/// It leaves with e² of the energy of impact, or rests if the flight would be shorter than two steps.
///
/// `w` is the velocity that belongs to the same time as y. In a uniform field w² + 2G·d is constant for every method, and so is
/// (e·u − G·τ)² + 2G·τ(e·u − ½G·τ) for every time τ since the bounce.
pub(crate) fn bounce<N: Number>(surface: &Surface<N>, step: &Step<N>, place: &Place<N>, speed: N) -> (N::Truth, Change<N>) {
    let (zero, half, h) = (N::of(0.0), N::of(0.5), step.h);
    let (push, late) = (-dot(&step.kick, &place.normal), dot(&step.lag, &place.normal));
    let size = magnitude(push);
    let quarter = N::of(0.25) * size;
    let ahead = N::choose(quarter.below(late), half * size, zero);
    let gains = push.below(zero) & quarter.below(-late);
    let w = speed + ahead;
    let touches = place.near & w.below(zero);
    let pull = push / h;
    let square = (w * w + (pull + pull) * place.distance) - N::choose(gains, push * push, zero);
    let impact = N::choose(zero.below(square), square, zero).sqrt();
    let leaving = surface.restitution.map_or(impact, |restitution| restitution * impact);
    let rests = leaving.at_most(push) | square.at_most(zero);
    let since = -(place.distance + place.distance) / (impact - w);
    let since = N::choose(since.below(zero), zero, since);
    let since = N::choose(h.below(since), h, since);
    let low = N::choose((place.before + place.slack).below(zero) | push.below(zero), place.before, zero);
    let height = since * (leaving - (half * pull) * since);
    let rising = (leaving - pull * since) - ahead;
    let (speed, distance) = (N::choose(rests, zero, rising), N::choose(rests, low, height));
    (touches, Change { speed, distance, rest: Some(Rest { rests, low, since }) })
}

/// Coulomb's friction: the tangential velocity loses the grip, μ times what the normal one gains. Returns the fraction that is
/// left.
///
/// A point that rests is slowed during the whole step, so it slides by the mean velocity, and one that sticks stays.
fn rub<N: Number>(grip: N, step: &Step<N>, y: &[N], slide: &[N], (normal, change): (&[N], &Change<N>), new_y: &mut [N]) -> N {
    let (zero, one) = (N::of(0.0), N::of(1.0));
    let fast = dot(slide, slide).sqrt();
    let sticks = fast.at_most(grip);
    let kept = N::choose(sticks, zero, one - grip / fast);
    if let Some(Rest { rests, .. }) = change.rest {
        let half = N::of(0.5) * step.h;
        let share = half * N::choose(zero.below(fast), fast / grip, zero);
        let way: Vec<N> = (0..y.len()).map(|i| (step.y0[i] - y[i]) + share * step.v0[i]).collect();
        let (through, shorter) = (dot(&way, normal), half * (one - kept));
        for i in 0..y.len() {
            let shift = N::choose(sticks, way[i] - through * normal[i], -(shorter * slide[i]));
            new_y[i] = N::choose(rests, new_y[i] + shift, new_y[i]);
        }
    }
    kept
}

/// No more energy than before the step, or after it without contact; the work is that of the mean acceleration.
pub(crate) fn limit<N: Number>(step: &Step<N>, touched: N::Truth, v: &mut [N], y: &mut [N]) {
    let (zero, one) = (N::of(0.0), N::of(1.0));
    let allowed = |v_from: &[N], y_from: &[N]| {
        let work = dot(&step.kick, &difference(y, y_from));
        dot(v_from, v_from) + (work + work) / step.h
    };
    let (most, raw, square) = (allowed(&step.v0, &step.y0), allowed(&step.v1, &step.y1), dot(v, v));
    let most = N::choose(most.below(raw), raw, most);
    let stays = touched & most.at_most(zero) & square.below(N::of(f64::INFINITY));
    let factor = N::choose(touched & most.below(square), (most / square).sqrt(), one);
    v.iter_mut().for_each(|v| *v = N::choose(stays, zero, factor * *v));
    y.iter_mut().zip(&step.y0).for_each(|(y, at)| *y = N::choose(stays, *at, *y));
}

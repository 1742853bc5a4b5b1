//! Contact of the points of a large system: [`crate::model::around::contact`] over rows, member by member and point by point.

mod near;
mod tile;

use std::sync::Arc;

use self::{
    near::Near,
    tile::{Ends, Tile},
};
use super::{
    blocks::Blocks,
    executor::Executor,
    rates::{RateTraits, Rates, RatesRequest},
};
use crate::{
    aligned::Aligned,
    isa::{Level, Task, with_isa},
    model::{
        around::contact::{Contacts, Springs, dimensions, ways},
        spec::{Parameters, Spec},
    },
};

/// The parameters of one member.
fn parameters<'a>(spec: &'a Spec, h: f64, member: usize) -> Parameters<'a, f64> {
    let numbers = spec.rows.iter().map(|row| row.at(member)).collect();
    Parameters { signature: &spec.signature, h, numbers, sample: |_, _| f64::NAN }
}

/// The surfaces of the members of a group, and the state before a step.
pub(crate) struct RowContacts {
    /// One for each lane.
    lanes: Vec<Contacts<f64>>,
    near: Near,
    /// The tile that applies contact to points; none if rods join them.
    tile: Option<Tile>,
    /// The points that may have met a surface in a step, in any lane.
    points: Vec<u32>,
    /// The slots before the step.
    before: [Aligned; 2],
    /// The slots after the step, what the method keeps, and the velocities at both ends; used if it carries something other than
    /// v or keeps anything.
    after: [Vec<f64>; 2],
    kept: Vec<f64>,
    velocities: [Vec<f64>; 2],
    /// Whether each number belongs to a point that met a surface.
    touched: Vec<bool>,
}

impl RowContacts {
    /// The surfaces of `lanes` members from `first`; lanes past the `count`-th repeat the last one. None if no surface acts after
    /// a step.
    pub(crate) fn new(spec: &Spec, level: Level, h: f64, members: [usize; 3]) -> Option<RowContacts> {
        let [lanes, first, count] = members;
        let member = |lane: usize| first + lane.min(count.saturating_sub(1));
        let lanes: Vec<_> = (0..lanes).map(|lane| Contacts::new(&parameters(spec, h, member(lane)))).collect::<Option<_>>()?;
        let is_joined = lanes.iter().any(Contacts::are_joined);
        Some(RowContacts {
            near: Near::new(level, dimensions(&spec.signature), &lanes),
            tile: if is_joined { None } else { Tile::new(spec, level, h, members) },
            points: Vec::new(),
            lanes,
            before: <[Aligned; 2]>::default(),
            after: <[Vec<f64>; 2]>::default(),
            kept: Vec::new(),
            velocities: <[Vec<f64>; 2]>::default(),
            touched: Vec::new(),
        })
    }

    /// Copies the state before a step.
    pub(crate) fn keep(&mut self, (v, y): (&[f64], &[f64])) {
        for (to, from) in self.before.iter_mut().zip([v, y]) {
            if to.len() != from.len() {
                *to = Aligned::new(from.len());
            }
            to.copy_from_slice(from);
        }
    }

    /// Changes members whose points are joined by rods and met a surface.
    fn resolve_joined(&self, v: &mut [f64], y: &mut [f64]) {
        let count = self.lanes.len();
        for (lane, contacts) in self.lanes.iter().enumerate() {
            let of = |row: &[f64]| row.iter().skip(lane).step_by(count).copied().collect::<Vec<f64>>();
            let [v0, y0, mut v1, mut y1] = [&*self.before[0], &*self.before[1], &*v, &*y].map(of);
            if contacts.is_any_near(&y0, &y1) {
                contacts.resolve_joined([&v0, &y0], [&mut v1, &mut y1]);
                for (row, new) in [(&mut *v, v1), (&mut *y, y1)] {
                    row.iter_mut().skip(lane).step_by(count).zip(new).for_each(|(number, new)| *number = new);
                }
            }
        }
    }

    /// Changes the points that met a surface, of those that may have. `v` and `v0` are velocities.
    fn resolve(&mut self, v0: &[f64], v: &mut [f64], y: &mut [f64]) {
        self.touched.clear();
        self.touched.resize(y.len(), false);
        if let Some(tile) = &mut self.tile {
            let ends = Ends { before: [v0, &self.before[1]], after: [v, y] };
            tile.resolve(&self.points, ends, &mut self.touched);
        }
    }

    /// Applies contact to the slots after a step from time t.
    pub(super) fn after(
        &mut self,
        blocks: &mut Blocks,
        start: Option<&mut Executor>,
        finish: Option<&mut Executor>,
        t: f64,
        h: f64,
    ) {
        if self.lanes.iter().any(Contacts::are_joined) {
            let (v, y) = blocks.slots_mut();
            return self.resolve_joined(v, y);
        }
        self.points.clear();
        self.near.find(&self.before[1], blocks.slots().1, &mut self.points);
        self.points.retain(|point| self.lanes[0].acts_on(*point as usize));
        if self.points.is_empty() {
            return;
        }
        let (end, schedules) = (t + h, Arc::clone(&blocks.schedules));
        let (Some(finish), Some(to_v)) = (finish, &schedules.finish) else {
            let (v, y) = blocks.slots_mut();
            let v0 = std::mem::take(&mut self.before[0]);
            self.resolve(&v0, v, y);
            self.before[0] = v0;
            if let (Some(start), Some(schedule)) = (start, &schedules.start) {
                self.kept.clear();
                blocks.kept().iter().for_each(|block| self.kept.extend_from_slice(block));
                start.run(schedule, blocks.rates.as_mut(), blocks.sizes, end, h, &mut blocks.arena);
                let mut before = self.kept.iter();
                for block in blocks.kept_mut() {
                    let numbers = block.iter_mut().zip(&self.touched).zip(&mut before);
                    numbers.for_each(|((number, touched), before)| *number = if *touched { *number } else { *before });
                }
            }
            return;
        };
        let (Some(start), Some(to_carry)) = (start, &schedules.start) else { return };
        let (v, y) = blocks.slots();
        copy(&mut self.after, [v, y]);
        for (i, (state, t)) in [(self.before.each_ref().map(|row| &**row), t), (self.after.each_ref().map(|row| &**row), end)]
            .into_iter()
            .enumerate()
        {
            let (v, y) = blocks.slots_mut();
            v.copy_from_slice(state[0]);
            y.copy_from_slice(state[1]);
            finish.run(to_v, blocks.rates.as_mut(), blocks.sizes, t, h, &mut blocks.arena);
            self.velocities[i].clear();
            self.velocities[i].extend_from_slice(blocks.slots().0);
        }
        let v0 = std::mem::take(&mut self.velocities[0]);
        let (v, y) = blocks.slots_mut();
        self.resolve(&v0, v, y);
        self.velocities[0] = v0;
        start.run(to_carry, blocks.rates.as_mut(), blocks.sizes, end, h, &mut blocks.arena);
        let slots = blocks.slots_mut().0.iter_mut().zip(&self.after[0]).zip(&self.touched);
        slots.for_each(|((slot, before), touched)| *slot = if *touched { *slot } else { *before });
    }
}

fn copy(to: &mut [Vec<f64>; 2], from: [&[f64]; 2]) {
    for (to, from) in to.iter_mut().zip(from) {
        to.clear();
        to.extend_from_slice(from);
    }
}

/// Rates of one member by a hand-written kernel, and the springs of its surfaces.
struct SprungRates {
    rates: Box<dyn Rates>,
    level: Level,
    h: f64,
    springs: Option<Springs<f64>>,
}

/// Adds the pushes of surfaces.
struct Push<'a> {
    springs: &'a Springs<f64>,
    y: &'a [f64],
    dv: &'a mut [f64],
}

impl Task for Push<'_> {
    #[inline(always)]
    fn run(self) {
        self.springs.push(self.y, self.dv);
    }
}

/// The rates with the springs of surfaces, if there are any.
pub(crate) fn wrap(rates: Box<dyn Rates>, asked: &RatesRequest) -> Box<dyn Rates> {
    let has_spring = ways(asked.signature).any(|way| way == "spring");
    if has_spring { Box::new(SprungRates { rates, level: asked.machine.level, h: asked.h, springs: None }) } else { rates }
}

impl Rates for SprungRates {
    fn inner(&self) -> Option<&dyn Rates> {
        Some(self.rates.as_ref())
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Rates> {
        Some(self.rates.as_mut())
    }

    fn traits(&self) -> RateTraits {
        self.rates.traits()
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        self.springs = Springs::new(&parameters(spec, self.h, first));
        self.rates.prepare(spec, first, count);
    }

    fn dv(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        self.rates.dv(t, v, y, out);
        if let Some(springs) = &self.springs {
            let dv = &mut out[..y.len()];
            with_isa!(self.level, |isa| isa.run(Push { springs, y, dv }));
        }
    }
}

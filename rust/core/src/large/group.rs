//! A group of members of a large system.

use std::sync::{Arc, atomic::Ordering::Relaxed};

use super::{
    blocks::{Blocks, Schedules},
    contact::RowContacts,
    executor::Executor,
    rates::Rates,
    schedule::BlockSchedule,
};
use crate::{
    group::Group,
    isa::Level,
    model::{spec::Spec, system::Shape, window},
    stage::{Clock, Force, Stop},
};

/// Members of a large system, stepped by a schedule that calls their rates.
pub struct LargeGroup {
    blocks: Blocks,
    clock: Clock,
    level: Level,
    step: Executor,
    start: Option<Executor>,
    finish: Option<Executor>,
    /// The surfaces that points meet after a step.
    contacts: Option<RowContacts>,
    recorded: usize,
    /// Whether the parameters taken for the first member hold for all.
    prepared: bool,
    stop: Stop,
}

impl LargeGroup {
    /// A group of as many members as the rates have lanes; `recorded` is how many numbers of each it records.
    pub fn new(
        schedules: Arc<Schedules>,
        rates: Box<dyn Rates>,
        shape: Shape,
        recorded: usize,
        level: Level,
        clock: &Clock,
    ) -> LargeGroup {
        let blocks = Blocks::new(schedules, rates, shape);
        let executor = |schedule: &BlockSchedule| blocks.executor(schedule, level, clock);
        LargeGroup {
            clock: *clock,
            level,
            step: executor(&blocks.schedules.step),
            start: blocks.schedules.start.as_ref().map(executor),
            finish: blocks.schedules.finish.as_ref().map(executor),
            contacts: None,
            recorded,
            prepared: false,
            stop: Stop::default(),
            blocks,
        }
    }
}

impl Group for LargeGroup {
    fn lanes(&self) -> usize {
        self.blocks.rates.lanes()
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        // Parameters that all members share are copied once: copying a large matrix takes longer than a step.
        if !std::mem::replace(&mut self.prepared, spec.is_common()) {
            self.blocks.rates.prepare(spec, first, count);
            self.contacts = RowContacts::new(spec, self.level, self.clock.h, [self.blocks.rates.lanes(), first, count]);
        }
        self.blocks.rates.tally_mut().fill(0.0);
    }

    fn renew(&mut self, spec: &Spec, first: usize, count: usize) {
        self.prepared = false;
        self.prepare(spec, first, count);
    }

    fn set_force(&mut self, force: &Force, first: usize, count: usize) {
        self.blocks.rates.set_force(force, first, count);
    }

    fn set_stop_flag(&mut self, stop: &Stop) {
        for executor in [Some(&mut self.step), self.start.as_mut(), self.finish.as_mut()].into_iter().flatten() {
            executor.stop = Stop::clone(stop);
        }
        self.blocks.rates.set_stop_flag(stop);
        self.stop = Stop::clone(stop);
    }

    fn slots(&self) -> (&[f64], &[f64]) {
        self.blocks.slots()
    }

    fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        self.blocks.slots_mut()
    }

    fn start(&mut self, k: i64) {
        let (t, h) = (self.clock.at(k), self.clock.h);
        let Blocks { schedules, rates, arena, sizes, .. } = &mut self.blocks;
        if let (Some(executor), Some(schedule)) = (&mut self.start, &schedules.start) {
            rates.set_window(Some(window::of_slot(t, h)));
            executor.run(schedule, rates.as_mut(), *sizes, t, h, arena);
        }
    }

    fn advance(&mut self, k: i64, n: i64) {
        for k in k..k + n {
            if self.stop.load(Relaxed) {
                return;
            }
            let (t, h) = (self.clock.at(k), self.clock.h);
            if let Some(contacts) = &mut self.contacts {
                contacts.keep(self.blocks.slots());
            }
            let Blocks { schedules, rates, arena, sizes, stride } = &mut self.blocks;
            rates.set_window(Some(window::of_step(t, h, self.finish.is_some())));
            self.step.run(&schedules.step, rates.as_mut(), *sizes, t, h, arena);
            let (v, y) = arena.split_at_mut(*stride);
            rates.project(&mut v[..sizes[0]], &mut y[..sizes[1]]);
            if let Some(contacts) = &mut self.contacts {
                contacts.after(&mut self.blocks, self.start.as_mut(), self.finish.as_mut(), t, h);
            }
        }
    }

    fn finish(&mut self, k: i64) {
        let (t, h) = (self.clock.at(k), self.clock.h);
        let Blocks { schedules, rates, arena, sizes, stride } = &mut self.blocks;
        if let (Some(executor), Some(schedule)) = (&mut self.finish, &schedules.finish) {
            if self.recorded > 0 {
                rates.cache_forces(&arena[*stride..][..sizes[1]]);
            }
            rates.set_window(Some(window::of_slot(t, h)));
            executor.run(schedule, rates.as_mut(), *sizes, t, h, arena);
        }
    }

    fn recorded(&self) -> usize {
        self.recorded
    }

    fn record(&mut self, rows: &mut [f64]) {
        let Blocks { rates, arena, sizes, stride, .. } = &mut self.blocks;
        let (v, y) = (&arena[..sizes[0]], &arena[*stride..][..sizes[1]]);
        rates.cache_forces(y);
        rates.record(v, y, rows);
    }

    fn kept(&self) -> Vec<&[f64]> {
        self.blocks.kept()
    }

    fn kept_mut(&mut self) -> Vec<&mut [f64]> {
        self.blocks.kept_mut()
    }

    fn tally(&self) -> &[f64] {
        self.blocks.rates.tally()
    }

    fn tally_mut(&mut self) -> &mut [f64] {
        self.blocks.rates.tally_mut()
    }
}

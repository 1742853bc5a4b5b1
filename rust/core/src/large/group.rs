//! A group of members of a large system.

use std::sync::{Arc, atomic::Ordering::Relaxed};

use super::{
    Facts, Rates,
    contact::RowContacts,
    course::{Course, Goal},
    executor::{Executor, stride},
};
use crate::{
    error::Error,
    isa::Level,
    program::{Block, Program},
    run::{
        aligned::Aligned,
        group::Group,
        stage::{Clock, Force},
        workers::Stop,
    },
    spec::Spec,
    system::Shape,
    trace::{How, method},
    window,
};

/// The courses of a method, for one kind of rates.
pub struct Courses {
    /// A step, or an attempt at one.
    pub step: Course,
    /// Turns velocities into what the method carries.
    pub start: Option<Course>,
    /// Turns what the method carries into velocities.
    pub finish: Option<Course>,
}

impl Courses {
    /// Of a method that steps so, for rates of which these facts are known.
    pub fn new(how: &How, facts: Facts, shape: Shape) -> Result<Courses, Error> {
        let (name, choice) = match how {
            How::Method { name, choice } => (name.as_str(), Some(*choice)),
            How::Attempts { name, .. } => (name.as_str(), None),
            How::Step(_) | How::Matrix { .. } => ("", None), // it has no method, which the next line says
        };
        let method = method(name)?;
        let course = |program: Program| {
            // A program of one result changes the block v alone.
            let results: Vec<Block> = match program.results[..] {
                [v] => vec![v, Block::Y],
                _ => program.results.clone(),
            };
            Course::new(&program, &results, if choice.is_some() { Goal::State } else { Goal::Attempt }, facts, shape)
        };
        let step = if choice.is_some() { Some(method.program()) } else { method.attempt() };
        Ok(Courses {
            step: course(step.ok_or(Error::NoEstimate)?),
            start: choice.and_then(|choice| method.start(choice)).map(course),
            finish: choice.and_then(|choice| method.finish(choice)).map(course),
        })
    }

    fn all(&self) -> impl Iterator<Item = &Course> {
        [Some(&self.step), self.start.as_ref(), self.finish.as_ref()].into_iter().flatten()
    }

    /// How many rows an arena for all of them has.
    fn rows(&self) -> usize {
        self.all().map(|course| course.rows).max().unwrap_or(2)
    }
}

/// Rates, and the arena in which a method uses them.
pub(super) struct Blocks {
    pub courses: Arc<Courses>,
    pub rates: Box<dyn Rates>,
    pub arena: Aligned,
    /// Numbers of both blocks, of all lanes.
    pub sizes: [usize; 2],
    pub stride: usize,
}

impl Blocks {
    pub fn new(courses: Arc<Courses>, rates: Box<dyn Rates>, shape: Shape) -> Blocks {
        let sizes = [shape.v * rates.lanes(), shape.y * rates.lanes()];
        let stride = stride(sizes[0].max(sizes[1]));
        Blocks { arena: Aligned::new(courses.rows() * stride), courses, rates, sizes, stride }
    }

    pub fn executor(&self, course: &Course, level: Level, clock: &Clock) -> Executor {
        Executor::new(course, level, self.stride, clock)
    }

    pub fn slots(&self) -> (&[f64], &[f64]) {
        let (v, y) = self.arena.split_at(self.stride);
        (&v[..self.sizes[0]], &y[..self.sizes[1]])
    }

    pub fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        let (v, y) = self.arena.split_at_mut(self.stride);
        (&mut v[..self.sizes[0]], &mut y[..self.sizes[1]])
    }
}

/// Members of a large system, stepped by a course that calls their rates.
pub struct LargeGroup {
    blocks: Blocks,
    clock: Clock,
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
    /// As many members as the rates have lanes, with so many recorded numbers each.
    pub fn new(
        courses: Arc<Courses>,
        rates: Box<dyn Rates>,
        shape: Shape,
        recorded: usize,
        level: Level,
        clock: &Clock,
    ) -> LargeGroup {
        let blocks = Blocks::new(courses, rates, shape);
        let executor = |course: &Course| blocks.executor(course, level, clock);
        LargeGroup {
            clock: *clock,
            step: executor(&blocks.courses.step),
            start: blocks.courses.start.as_ref().map(executor),
            finish: blocks.courses.finish.as_ref().map(executor),
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
            self.contacts = RowContacts::new(spec, self.clock.h, self.blocks.rates.lanes(), first, count);
        }
        self.blocks.rates.tally_mut().fill(0.0);
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
        let Blocks { courses, rates, arena, sizes, .. } = &mut self.blocks;
        if let (Some(executor), Some(course)) = (&mut self.start, &courses.start) {
            rates.set_window(Some(window::of_slot(t, h)));
            executor.run(course, rates.as_mut(), *sizes, t, h, arena);
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
            let Blocks { courses, rates, arena, sizes, stride } = &mut self.blocks;
            rates.set_window(Some(window::of_step(t, h, self.start.is_some())));
            self.step.run(&courses.step, rates.as_mut(), *sizes, t, h, arena);
            let (v, y) = arena.split_at_mut(*stride);
            rates.project(&mut v[..sizes[0]], &mut y[..sizes[1]]);
            if let Some(contacts) = &mut self.contacts {
                let carry = self.start.as_mut().zip(self.finish.as_mut()).map(|(start, finish)| [start, finish]);
                contacts.after(&mut self.blocks, carry, t, h);
            }
        }
    }

    fn finish(&mut self, k: i64) {
        let (t, h) = (self.clock.at(k), self.clock.h);
        let Blocks { courses, rates, arena, sizes, stride } = &mut self.blocks;
        if let (Some(executor), Some(course)) = (&mut self.finish, &courses.finish) {
            if self.recorded > 0 {
                rates.cache_forces(&arena[*stride..][..sizes[1]]);
            }
            rates.set_window(Some(window::of_slot(t, h)));
            executor.run(course, rates.as_mut(), *sizes, t, h, arena);
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

    fn tally(&self) -> &[f64] {
        self.blocks.rates.tally()
    }

    fn tally_mut(&mut self) -> &mut [f64] {
        self.blocks.rates.tally_mut()
    }
}

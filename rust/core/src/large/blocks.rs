//! Rates, and the rows of blocks in which a method uses them.

use std::sync::{Arc, LazyLock};

use super::{
    executor::{Executor, stride},
    rates::{RateTraits, Rates},
    schedule::{BlockSchedule, Goal},
};
use crate::{
    aligned::Aligned,
    error::Error,
    isa::Level,
    model::{
        methods::method,
        program::{Block, Program},
        system::Shape,
    },
    stage::Clock,
    step::{cache::Cache, key::StepKind},
};

/// The schedules of a method, for one kind of rates.
pub struct Schedules {
    /// A step, or an attempt at one.
    pub step: BlockSchedule,
    /// Turns velocities into what the method carries.
    pub start: Option<BlockSchedule>,
    /// Turns what the method carries into velocities.
    pub finish: Option<BlockSchedule>,
    /// The coefficients of the continuous extension of an attempt.
    pub extension: Option<BlockSchedule>,
    /// For each block that the method keeps, whether it has the numbers of v.
    pub kept: Vec<bool>,
}

/// The name of the method, its way to start in steps of fixed length, and what it relies on.
type SchedulesKey = (String, Option<usize>, RateTraits, Shape);

impl Schedules {
    /// The cached schedules of a method for rates with these traits, built on first use.
    pub fn of(how: &StepKind, traits: RateTraits, shape: Shape) -> Result<Arc<Schedules>, Error> {
        static CACHE: LazyLock<Cache<SchedulesKey, Schedules>> = LazyLock::new(Cache::default);
        let (name, choice) = match how {
            StepKind::Method { name, choice } => (name.as_str(), Some(*choice)),
            StepKind::Attempts { name, .. } => (name.as_str(), None),
            StepKind::Step(_) | StepKind::Matrix { .. } => ("", None), // it has no method, which the next line says
        };
        CACHE.find(&(name.to_owned(), choice, traits, shape), || {
            let schedules = Schedules::new(name, choice, traits, shape)?;
            let size = schedules.all().map(BlockSchedule::size).sum::<usize>();
            Ok((schedules, size))
        })
    }

    fn new(name: &str, choice: Option<usize>, traits: RateTraits, shape: Shape) -> Result<Schedules, Error> {
        let method = method(name)?;
        let goal = if choice.is_some() { Goal::State } else { Goal::Attempt };
        let schedule = |program: &Program| BlockSchedule::new(program, &program.results, goal, traits, shape);
        // Those that change the block v alone, and make what is kept.
        let of_slot = |program: &Program| {
            let mut results = program.results.clone();
            results.insert(1, Block::Y);
            BlockSchedule::new(program, &results, goal, traits, shape)
        };
        let step = if choice.is_some() { Some(method.program()) } else { method.attempt() };
        Ok(Schedules {
            step: schedule(step.ok_or(Error::NoEstimate)?),
            start: choice.and_then(|choice| method.start(choice)).map(of_slot),
            finish: choice.and_then(|choice| method.finish(choice)).map(of_slot),
            extension: method.extension().filter(|_| choice.is_none()).map(schedule),
            kept: method.kept.clone(),
        })
    }

    fn all(&self) -> impl Iterator<Item = &BlockSchedule> {
        [Some(&self.step), self.start.as_ref(), self.finish.as_ref()].into_iter().flatten()
    }

    /// How many rows an arena for all of them has, but for the extension, which has one of its own.
    fn rows(&self) -> usize {
        self.all().map(|schedule| schedule.rows).max().unwrap_or(2)
    }
}

/// Rates, and the arena in which a method uses them.
pub(super) struct Blocks {
    pub schedules: Arc<Schedules>,
    pub rates: Box<dyn Rates>,
    pub arena: Aligned,
    /// Numbers of both blocks, of all lanes.
    pub sizes: [usize; 2],
    pub stride: usize,
}

impl Blocks {
    pub(crate) fn new(schedules: Arc<Schedules>, rates: Box<dyn Rates>, shape: Shape) -> Blocks {
        let sizes = [shape.v * rates.lanes(), shape.y * rates.lanes()];
        let stride = stride(sizes[0].max(sizes[1]));
        Blocks { arena: Aligned::new(schedules.rows() * stride), schedules, rates, sizes, stride }
    }

    pub(crate) fn executor(&self, schedule: &BlockSchedule, level: Level, clock: &Clock) -> Executor {
        Executor::new(schedule, level, self.stride, clock)
    }

    /// How many numbers each block has that the method keeps; they are the rows behind both slots.
    fn kept_sizes(&self) -> impl Iterator<Item = usize> {
        self.schedules.kept.iter().map(|of_v| self.sizes[usize::from(!of_v)])
    }

    pub(crate) fn kept(&self) -> Vec<&[f64]> {
        self.arena.chunks(self.stride).skip(2).zip(self.kept_sizes()).map(|(row, numbers)| &row[..numbers]).collect()
    }

    pub(crate) fn kept_mut(&mut self) -> Vec<&mut [f64]> {
        let sizes: Vec<usize> = self.kept_sizes().collect();
        self.arena.chunks_mut(self.stride).skip(2).zip(sizes).map(|(row, numbers)| &mut row[..numbers]).collect()
    }

    pub(crate) fn slots(&self) -> (&[f64], &[f64]) {
        let (v, y) = self.arena.split_at(self.stride);
        (&v[..self.sizes[0]], &y[..self.sizes[1]])
    }

    pub(crate) fn slots_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        let (v, y) = self.arena.split_at_mut(self.stride);
        (&mut v[..self.sizes[0]], &mut y[..self.sizes[1]])
    }
}

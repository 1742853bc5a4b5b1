//! The driver: many members, some threads, what to keep, and who diverged. It knows nothing of the systems that it steps.

pub mod aligned;
pub mod batch;
pub mod chosen;
pub mod crew;
pub mod group;
pub mod paced;
pub mod stage;
pub mod world;

use std::sync::Arc;

use self::{
    group::{Group, Lanes},
    paced::{Paced, PacedLanes},
    stage::Clock,
};
use crate::{
    error::Error,
    isa::Level,
    kernel::runner::Width,
    spec::Spec,
    trace::{Scene, Traced},
};

/// What to step, and how.
#[derive(Clone, Debug)]
pub struct Model<'a> {
    /// The system with its numbers.
    pub spec: Spec<'a>,
    /// What its tapes are made for.
    pub scene: Scene,
}

/// What hot loops may use.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// Which kernels.
    pub level: Level,
    /// How many threads the forces of one large system may use; zero for as many as there are.
    pub threads: usize,
}

impl Model<'_> {
    /// Its tapes.
    pub fn traced(&self) -> Result<Arc<Traced>, Error> {
        self.scene.traced()
    }

    /// How many members a group of that width steps together, and about what a step costs beside one of few.
    pub fn lanes(&self, traced: &Traced, machine: Machine, width: Width) -> (usize, usize) {
        let runner = &traced.step.kit(machine.level, width).runner;
        (runner.lanes(), runner.cost())
    }

    /// A group that steps it.
    pub fn group(&self, traced: &Arc<Traced>, machine: Machine, width: Width, clock: &Clock) -> Box<dyn Group> {
        Box::new(Lanes::new(Arc::clone(traced), &self.spec, machine.level, width, clock))
    }

    /// A group whose members go at a pace of their own each.
    pub fn paced(&self, traced: &Arc<Traced>, machine: Machine, width: Width, budget: f64) -> Box<dyn Paced> {
        Box::new(PacedLanes::new(Arc::clone(traced), &self.spec, machine.level, width, budget))
    }

    /// Which width serves so many members best.
    pub fn width(&self, traced: &Traced, machine: Machine, members: usize) -> Width {
        if members == 1 {
            return Width::One;
        }
        let (lanes, cost) = self.lanes(traced, machine, Width::Wide);
        let (few, each) = self.lanes(traced, machine, Width::Few);
        if members < lanes && members.div_ceil(few) * each < cost { Width::Few } else { Width::Wide }
    }
}

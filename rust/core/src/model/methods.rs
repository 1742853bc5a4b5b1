//! Methods as they are stepped, by name: those of the records in `steppers/`, and those that users define.

use std::sync::{Arc, LazyLock, OnceLock};

use super::{
    method::{Needs, Record},
    program::Program,
    steppers::RECORDS,
    system::Shape,
};
use crate::error::Error;

/// A method as it is stepped: its programs, and what of its record the steps depend on.
#[derive(Debug)]
pub struct Method {
    /// The name that users read.
    pub name: &'static str,
    /// Its requirements on a system.
    pub needs: Needs,
    /// Whether it carries something in place of v between steps.
    pub carries: bool,
    /// The order of h in which it estimates the error of a step, if it does.
    pub error_order: Option<u32>,
    /// The blocks that it keeps between steps beside the state; of each whether it has the numbers of v, or those of y.
    pub kept: Vec<bool>,
    /// A step: results are the new v and y, and the blocks that are kept.
    step: Program,
    /// An attempt: results are the new v and y and the estimates of their errors, two or four blocks.
    attempt: Option<Program>,
    /// The coefficients of its continuous extension: results are those of v and of y, power by power.
    extension: Option<Program>,
    /// For each way to start the program that turns a velocity into what the v slot holds between steps, with the blocks that are
    /// kept behind it.
    starts: Vec<Program>,
    /// The inverses, which turn what the v slot holds into a velocity; none where it holds v.
    finishes: Vec<Program>,
}

impl From<&Record> for Method {
    fn from(record: &Record) -> Method {
        let ways = 0..record.carry.as_ref().map_or(0, |carry| carry.starts.len().max(1));
        Method {
            name: record.name,
            needs: record.needs,
            carries: record.carry.is_some(),
            error_order: record.estimate.as_ref().map(|estimate| estimate.order),
            step: record.program(),
            attempt: record.attempt(),
            extension: record.extension(),
            kept: Vec::new(),
            starts: ways.clone().filter_map(|choice| record.start(choice)).collect(),
            finishes: ways.filter_map(|choice| record.finish(choice)).collect(),
        }
    }
}

impl Method {
    /// A method that a user defines by its programs: a step, an attempt with the order of its estimate, and the start of the
    /// blocks that it keeps.
    pub fn own(
        name: &str,
        needs: Needs,
        step: Program,
        attempt: Option<(Program, u32)>,
        start: Option<(Program, Vec<bool>)>,
    ) -> Method {
        let (attempt, error_order) = attempt.unzip();
        let (start, kept) = start.unzip();
        // Errors name methods by names that live as long as the process; a user defines a handful.
        let (name, kept) = (name.to_owned().leak(), kept.unwrap_or_default());
        let (starts, finishes) = (start.into_iter().collect(), Vec::new());
        Method { name, needs, carries: false, kept, error_order, step, attempt, extension: None, starts, finishes }
    }

    /// The program of a step.
    pub fn program(&self) -> &Program {
        &self.step
    }

    /// The program of an attempt, if it estimates its error.
    pub fn attempt(&self) -> Option<&Program> {
        self.attempt.as_ref()
    }

    /// The program of the coefficients of the continuous extension, if it has one.
    pub fn extension(&self) -> Option<&Program> {
        self.extension.as_ref()
    }

    /// The program that turns a velocity into what the method carries, with the blocks that it keeps behind it.
    pub fn start(&self, choice: usize) -> Option<&Program> {
        self.starts.get(choice)
    }

    /// The program that turns what the method carries into a velocity.
    pub fn finish(&self, choice: usize) -> Option<&Program> {
        self.finishes.get(choice)
    }

    /// How many numbers of a member the blocks have that it keeps.
    pub fn kept_numbers(&self, shape: Shape) -> usize {
        self.kept.iter().map(|of_v| if *of_v { shape.v } else { shape.y }).sum::<usize>()
    }
}

static BUILT_IN: LazyLock<Vec<Arc<Method>>> =
    LazyLock::new(|| RECORDS.iter().map(|record| Arc::new(Method::from(*record))).collect());

/// A user's method, by a key that stands for its programs, and those that were defined later.
///
/// It is a list without locks: a process may be forked while other threads look for a method.
struct Own {
    key: String,
    method: Arc<Method>,
    later: OnceLock<Box<Own>>,
}

static OWN: OnceLock<Box<Own>> = OnceLock::new();

/// The method of that name or key.
pub fn method(name: &str) -> Result<Arc<Method>, Error> {
    if let Some(method) = BUILT_IN.iter().find(|method| method.name == name) {
        return Ok(Arc::clone(method));
    }
    let mut next = OWN.get();
    while let Some(own) = next {
        if own.key == name {
            return Ok(Arc::clone(&own.method));
        }
        next = own.later.get();
    }
    let known = RECORDS.iter().map(|record| record.name).collect::<Vec<_>>().join(", ");
    Err(Error::UnknownMethod { name: name.to_owned(), known })
}

/// Registers a method under a key; one that is already there stays.
pub fn define(key: &str, method: Method) {
    let mut own = Box::new(Own { key: key.to_owned(), method: Arc::new(method), later: OnceLock::new() });
    let mut place = &OWN;
    while let Err(mine) = place.set(own) {
        match place.get() {
            Some(before) if before.key == key => return,
            Some(before) => place = &before.later,
            None => return, // it is set, as the error says
        }
        own = mine;
    }
}

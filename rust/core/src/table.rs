//! From names to kernels.

use crate::{
    error::Error,
    group::{Clock, Group, Spec, Width},
    matrix,
    stepper::{Record, Stepper},
};

include!(concat!(env!("OUT_DIR"), "/table.rs"));

/// What to step, and how.
#[derive(Clone, Debug)]
pub enum Model<'a> {
    /// A system, by a method of this name.
    Direct {
        /// The system.
        spec: Spec<'a>,
        /// The method's name.
        method: &'a str,
    },
    /// A linear map.
    Matrix {
        /// P, Q and the inputs.
        spec: Spec<'a>,
        /// Times of the inputs, as fractions of a step.
        nodes: &'a [f64],
        /// How many of the numbers stand in the v slot.
        v_rows: usize,
    },
}

impl Model<'_> {
    /// The system.
    pub fn spec(&self) -> &Spec<'_> {
        match self {
            Model::Direct { spec, .. } | Model::Matrix { spec, .. } => spec,
        }
    }

    /// A group that steps it.
    pub fn group(&self, clock: &Clock, width: Width) -> Result<Box<dyn Group>, Error> {
        match self {
            Model::Direct { spec, method } => lookup(spec, method, clock, width),
            Model::Matrix { spec, nodes, v_rows } => Ok(matrix::group(spec, nodes, clock, *v_rows, width)),
        }
    }
}

/// The record of a method.
pub fn record(name: &str) -> Option<&'static Record> {
    RECORDS.iter().copied().find(|r| r.name == name)
}

fn unknown(system: &str, method: &str) -> Error {
    if SYSTEMS.contains(&system) {
        let known = RECORDS.iter().map(|r| r.name).collect::<Vec<_>>().join(", ");
        Error::UnknownMethod { name: method.to_owned(), known }
    } else {
        Error::UnknownSystem { name: system.to_owned(), known: SYSTEMS.join(", ") }
    }
}

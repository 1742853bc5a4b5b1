//! Kernels that are written by hand: which systems have one, and from which size on it is used.

use super::{
    bodies, chain, contact, control, force, linear,
    rates::{Rates, RatesRequest},
    springs,
};

/// Rates of one member by a kernel that is written by hand.
#[derive(Clone, Copy)]
pub struct HandWrittenRates {
    /// Operations of the rates, or of a step, from which on it is faster than machine code for one number at a time.
    pub from: (usize, usize),
    /// Operations of the rates from which on it is as fast as tapes for several members side by side.
    pub from_batch: usize,
    /// Makes them, without control.
    pub make: fn(&RatesRequest) -> Box<dyn Rates>,
}

/// The kernel of the system of that name, if there is one.
pub fn kernel_of(system: &str) -> Option<HandWrittenRates> {
    Some(match system {
        "chain" => HandWrittenRates { from: (6 * 64, 800), from_batch: 0, make: chain::make },
        "linear" => HandWrittenRates { from: (2 * 19 * 19, usize::MAX), from_batch: 2 * 150 * 150, make: linear::make },
        "nbody" => HandWrittenRates { from: (11 * 10 * 10, usize::MAX), from_batch: 11 * 106 * 106, make: bodies::make },
        "springs" => HandWrittenRates { from: (4000, 4000), from_batch: 60_000, make: springs::make },
        _ => return None,
    })
}

/// Rates of one member by the kernel of the system, with the springs of surfaces, under the control and the force that are given.
pub fn single(long: HandWrittenRates, asked: &RatesRequest) -> Box<dyn Rates> {
    force::wrap(control::wrap(contact::wrap((long.make)(asked), asked), asked), asked)
}

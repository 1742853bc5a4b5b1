//! How long operations take, as measured on Zen 4; Intel's CPUs have other numbers of the same order.

use crate::tape::Op;

/// An execution unit of the CPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    Sum,
    Product,
    Divider,
    /// The unit that moves numbers between lanes.
    Moves,
    Bits,
}

/// All units.
pub(super) const UNITS: [Unit; 5] = [Unit::Sum, Unit::Product, Unit::Divider, Unit::Moves, Unit::Bits];

impl Unit {
    /// How many of it there are.
    pub(super) fn count(self) -> u8 {
        if self == Unit::Divider { 1 } else { 2 }
    }
}

/// The times of an operation in cycles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timing {
    pub unit: Unit,
    /// Cycles until its result is there.
    pub latency: u8,
    /// Cycles for which its unit is busy.
    pub busy: u8,
    /// Cycles for which its unit is busy with a vector of 512 bits.
    pub busy_long: u8,
}

impl Timing {
    /// The times of an operation that its unit can begin in every cycle.
    pub(super) const fn quick(unit: Unit, latency: u8) -> Timing {
        Timing { unit, latency, busy: 1, busy_long: 1 }
    }

    /// Whether its unit cannot begin one in every cycle: roots and quotients.
    pub(super) fn is_slow(self) -> bool {
        self.busy_long > 1
    }

    /// Cycles until another one on a vector of 512 bits can begin.
    pub(super) fn interval(self) -> f64 {
        f64::from(self.busy_long) / f64::from(self.unit.count())
    }
}

/// The times of an operation; those that are not listed take one cycle.
pub(super) fn timing(op: Op) -> Timing {
    match op {
        Op::Add(..) | Op::Sub(..) => Timing::quick(Unit::Sum, 3),
        Op::Mul(..) => Timing::quick(Unit::Product, 3),
        Op::MulAdd(..) | Op::MulSub(..) | Op::SubMul(..) => Timing::quick(Unit::Product, 4),
        Op::Less(..) | Op::LessEqual(..) | Op::Equal(..) => Timing::quick(Unit::Sum, 4),
        Op::Floor(_) => Timing::quick(Unit::Sum, 3),
        Op::Div(..) => Timing { unit: Unit::Divider, latency: 13, busy: 5, busy_long: 8 },
        Op::Sqrt(_) => Timing { unit: Unit::Divider, latency: 20, busy: 8, busy_long: 13 },
        _ => Timing::quick(Unit::Bits, 1),
    }
}

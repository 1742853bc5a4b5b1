use crate::{
    method::{Needs, Record},
    program::{Block, Length, Rates, Time},
};

/// The order of a step of fixed length.
const ORDER: u32 = 8;

pub const RECORD: Record = Record {
    name: "taylor",
    title: "Taylor series",
    other_names: &["Taylor method", "jet transport of the solution"],
    false_friends: &["Taylor expansion of a result in its parameters", "exponential integrators"],
    order: ORDER,
    family: "Taylor",
    limit: 0.0,
    needs: Needs::Rates,
    carry: None,
    estimate: None,
    section: "not in the document",
    reference: "À. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods, \
                Experimental Mathematics 14 (2005) 99",
    about: "The sum of the solution's Taylor series around the start of the step; its coefficients follow from the operations of the \
            rates. Steps of fixed length have order 8.",
    step,
};

fn step(s: Rates, _t: Time, _h: Length, v: Block, y: Block) -> (Block, Block) {
    let series = s.series(ORDER, v, y);
    // The smallest terms first.
    let sum = series.into_iter().rev().reduce(|(sum_v, sum_y), (next_v, next_y)| (next_v + sum_v, next_y + sum_y));
    sum.map_or((v, y), |(dv, dy)| (v + dv, y + dy))
}

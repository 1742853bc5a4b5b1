//! `World::step` allocates nothing.
//!
//! Allocations of all threads are counted, so this test is a program of its own (`harness = false`): the thread of the test
//! harness allocates, too, just after it has started a test.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

mod common;

use common::{Of, model, oscillators, spec};
use stepwell_core::{
    error::Error,
    isa::Level,
    model::{
        method::Record,
        spec::{Row, Table},
        steppers::RECORDS,
    },
    run::{Model, world::World},
    stage::{Clock, Machine},
};

#[global_allocator]
static ALLOCATOR: dhat::Alloc = dhat::Alloc;

const MEMBERS: usize = 100;
const ONE: Row = Row(&[1.0]);

/// Steps a world some hundred times, past the ends of tables of steps, and counts what it allocates: the least of some such
/// rounds, for code is written once after as many steps as make up for it, and how many these are depends on the CPU.
fn allocations(model: &Model, level: Level) -> Result<u64, Error> {
    let clock = Clock { t0: 0.0, h: 0.1 };
    let mut world = World::new(model, clock, Machine { level, threads: 1 }, MEMBERS, 0)?;
    let sizes = world.sizes();
    let (mut v, mut y) = (vec![0.0; sizes.0], vec![1.0; sizes.1]);
    world.step(1, &mut v, &mut y); // what a carry needs is made at the first step
    let mut round = || {
        let before = dhat::HeapStats::get().total_blocks;
        for _ in 0..200 {
            world.step(3, &mut v, &mut y);
            v[0] += 0.01; // a kick: a method with a carry starts anew
        }
        dhat::HeapStats::get().total_blocks - before
    };
    Ok((0..8).map(|_| round()).find(|count| *count == 0).unwrap_or_else(round))
}

fn main() {
    let _profiler = dhat::Profiler::builder().testing().build();
    let omega: Vec<f64> = (0..MEMBERS).map(|i| 0.5 + i as f64 / 100.0).collect();
    let samples: Vec<Vec<f64>> = (0..30).map(|i| vec![f64::from(i); MEMBERS]).collect();
    let held = || Table { samples: samples.iter().map(|row| Row(row)).collect(), start: 0.0, interval: 0.3 };
    let sine = |name: [&'static str; 3]| name.map(|part| (part, vec![ONE]));
    let free = |method: &Record| oscillators(&omega, method.name);
    let driven = |method: &Record| {
        // By a sine that all have in common and by samples of their own.
        let rows = [&[("omega", vec![Row(&omega)])][..], &sine(["a.amplitude", "a.omega", "a.phase"])].concat();
        let of = Of { words: &[("form", "physical")], rows: &rows, tables: vec![("x", held())], ..Of::default() };
        model(spec("oscillator", of), method.name)
    };
    let chain = |method: &Record| {
        let rows = [("stiffness", vec![ONE; 5]), ("mass", vec![ONE; 4])];
        model(spec("chain", Of { rows: &rows, ..Of::default() }), method.name)
    };
    let linear = |method: &Record| {
        let drive = sine(["inputs[0].amplitude", "inputs[0].omega", "inputs[0].phase"]);
        let rows = [&[("rows", vec![ONE; 6 * 7])][..], &drive].concat();
        let (words, wholes) = ([("kind", "acceleration")], [("n_v", 3), ("inputs", 1)]);
        model(spec("linear", Of { words: &words, wholes: &wholes, rows: &rows, ..Of::default() }), method.name)
    };
    for level in [Level::Baseline, Level::choose().unwrap()] {
        for method in RECORDS {
            for (name, model) in
                [("free", free(method)), ("driven", driven(method)), ("chain", chain(method)), ("linear", linear(method))]
            {
                assert_eq!(allocations(&model, level), Ok(0), "{} on {name}, {level:?}", method.name);
            }
        }
    }
    println!("a step allocates nothing: ok");
}

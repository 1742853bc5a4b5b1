//! `World::step` allocates nothing.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

use stepwell_core::{
    group::{Clock, Row, Spec},
    isa::Level,
    table::{Model, RECORDS},
    world::World,
};

#[global_allocator]
static ALLOCATOR: dhat::Alloc = dhat::Alloc;

#[test]
fn a_step_allocates_nothing() {
    let _profiler = dhat::Profiler::builder().testing().build();
    let omega: Vec<f64> = (0..100).map(|i| 0.5 + f64::from(i) / 100.0).collect();
    let one = [1.0];
    let chain: Vec<Row> = (0..9).map(|_| Row(&one)).collect();
    for record in RECORDS {
        let free = Spec { system: "oscillator", options: vec!["canonical"], rows: vec![Row(&omega)], ..Spec::default() };
        let chain = Spec { system: "chain", sizes: vec![4], rows: chain.clone(), ..Spec::default() };
        let mut linear = Spec { system: "linear", options: vec!["acceleration", "sine"], sizes: vec![3, 3], ..Spec::default() };
        linear.rows = (0..6 * 7 + 3).map(|_| Row(&one)).collect();
        for (spec, size) in [(free, 1), (chain, 4), (linear, 3)] {
            let model = Model::Direct { spec, method: record.name };
            let clock = Clock { t0: 0.0, h: 0.1, start: 0, level: Level::choose().unwrap(), threads: 1 };
            let mut world = World::new(&model, clock, 100, record.carry.is_some(), 0).unwrap();
            let (mut v, mut y) = (vec![0.0; 100 * size], vec![1.0; 100 * size]);
            world.step(1, &mut v, &mut y); // what a carry needs is made at the first step
            let before = dhat::HeapStats::get().total_blocks;
            for _ in 0..50 {
                world.step(3, &mut v, &mut y);
                v[0] += 0.01; // a kick: a method with a carry starts anew
            }
            assert_eq!(dhat::HeapStats::get().total_blocks, before, "{}", record.name);
        }
    }
}

//! Kernels that are written at run time: every bit as the interpreter has it, nothing touched that is not theirs, pages given
//! back.
#![cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that fails may panic")]

#[cfg(target_arch = "x86_64")]
mod code;
mod inputs;
mod packed;
mod process;
mod random;
#[path = "../common/ring.rs"]
mod ring;
mod schedule;

use inputs::{Inputs, same, shape};
use random::Random;
use stepwell_core::{
    isa::Level,
    kernel::{
        Kernel,
        interpret::Interpreter,
        writer::{Shape, Written, choose, in_local_order, write},
    },
    tape::{
        Op,
        real::{Precision, Real},
        split::Body,
    },
};

fn widths() -> Vec<(Level, usize)> {
    let all = [
        (Level::Neon, 1),
        (Level::Neon, 2),
        (Level::Avx2, 1),
        (Level::Avx2, 4),
        (Level::Avx512, 1),
        (Level::Avx512, 4),
        (Level::Avx512, 8),
    ];
    all.into_iter().filter(|(level, _)| level.here()).collect()
}

/// The levels and widths of this machine for numbers of this precision.
fn widths_of(precision: Precision) -> Vec<(Level, usize)> {
    match precision {
        Precision::Double => widths(),
        Precision::Single => {
            let twice = |(level, width)| (level, if width > 1 { 2 * width } else { 1 });
            widths().into_iter().map(twice).collect()
        }
    }
}

/// Compares a random body in a random shape with the interpreter; returns on how many inputs.
fn one_case<T: Real>(seed: u64, read_code: bool) -> usize {
    let random = &mut Random(seed.wrapping_mul(0xD134_2543_DE82_EF95));
    let operations = random::length(seed, random);
    let states = if random.once_in(6) { 1 + random.below(30) } else { 1 + random.below(5) };
    let body = random::body(random, operations, states);
    let body = if T::PRECISION == Precision::Single { random::in_single(body) } else { body };
    let (level, width) = random.one_of(&widths_of(T::PRECISION));
    let shape = if random.once_in(8) {
        let members = random.one_of(&[1, 2, 4, 5, 8, 9, 60, 1000]);
        choose(&body, level, members).unwrap()
    } else {
        Shape { bytes: size_of::<T>(), ..shape(random, operations, level, width) }
    };
    let ordered = if seed.is_multiple_of(3) { in_local_order(&body, 0) } else { body.clone() };
    let kernel = write(&ordered, shape).unwrap_or_else(|| panic!("seed {seed}: {shape:?} is not written"));
    // On other CPUs the assembly is read: see `tests/aarch64`.
    #[cfg(not(target_arch = "x86_64"))]
    let _ = read_code;
    #[cfg(target_arch = "x86_64")]
    if read_code {
        let is_fused = body.ops.iter().any(|op| matches!(op, Op::MulAdd(..) | Op::MulSub(..) | Op::SubMul(..)));
        code::read(&kernel, is_fused);
    }
    let lanes = shape.lanes();
    let oracle = Interpreter::new(&body, lanes, Level::Baseline);
    let mut scratch = Vec::new();
    for steps in [0, 1, 2, 7] {
        let inputs = Inputs::<T>::new(random, &body, lanes, steps);
        let (want, got) = (inputs.run(&oracle, &mut Vec::new()), inputs.run(&kernel, &mut scratch));
        for (at, (want, got)) in want.iter().zip(&got).enumerate() {
            let (s, lane) = (at / lanes, at % lanes);
            assert!(same(*want, *got), "seed {seed}, {shape:?}, {steps} steps: state {s}, lane {lane} is {got:?}, not {want:?}");
        }
    }
    4 * lanes
}

/// `STEPWELL_FUZZ` says with how many inputs, all in all.
#[test]
fn random_bodies_have_the_bits_of_the_interpreter() {
    let wanted = std::env::var("STEPWELL_FUZZ").ok().and_then(|n| n.parse().ok());
    let (mut seen, mut seed) = (0, 0);
    while seen < wanted.unwrap_or(400_000) {
        seen += one_case::<f64>(seed, seed % 4 == 0);
        seed += 1;
    }
    println!("{seed} bodies, {seen} pairs of a body and an input");
}

/// As the test above, with numbers of 32 bits; half as many, since twice as many are in a vector.
#[test]
fn random_bodies_of_single_precision_have_the_bits_of_the_interpreter() {
    let wanted = std::env::var("STEPWELL_FUZZ").ok().and_then(|n| n.parse().ok());
    let (mut seen, mut seed) = (0, 0);
    while seen < wanted.unwrap_or(400_000) {
        seen += one_case::<f32>(seed, seed % 4 == 0);
        seed += 1;
    }
    println!("{seed} bodies, {seen} pairs of a body and an input");
}

/// Code for numbers of one size is never called with those of the other.
#[test]
#[should_panic(expected = "precision")]
fn a_tile_of_another_precision_is_refused() {
    let kernel = written(&oscillator());
    let body = Body { precision: Precision::Single, ..oscillator() };
    Inputs::<f32>::new(&mut Random(1), &body, Kernel::<f32>::lanes(&kernel), 1).run(&kernel, &mut Vec::new());
}

fn oscillator() -> Body {
    // v' = v − φy, y' = y + φv'
    let ops = vec![Op::State(0), Op::State(1), Op::Row(0), Op::Mul(1, 2), Op::Sub(0, 3), Op::Mul(2, 4), Op::Add(1, 5)];
    Body { ops, next: vec![4, 6], rows: 1, ..Body::default() }
}

fn written(body: &Body) -> Written {
    let (level, width) = *widths().last().expect("machine code");
    write(body, Shape { level, bytes: 8, width, block_vectors: 2, interleaved: 2, blocks: 3, resident: true }).expect("a kernel")
}

#[test]
fn states_that_change_places_do() {
    let body = Body { ops: vec![Op::State(0), Op::State(1), Op::Copy(1), Op::Copy(0)], next: vec![2, 3], ..Body::default() };
    for (level, width) in widths() {
        for resident in [false, true] {
            let shape = Shape { level, bytes: 8, width, block_vectors: 2, interleaved: 2, blocks: 2, resident };
            let inputs = Inputs::<f64>::new(&mut Random(7), &body, shape.lanes(), 3);
            let got = inputs.run(&write(&body, shape).expect("a kernel"), &mut Vec::new());
            let lanes = shape.lanes();
            assert!(got[..lanes].iter().zip(&inputs.state[lanes..]).all(|(a, b)| same(*a, *b)));
            assert!(got[lanes..].iter().zip(&inputs.state[..lanes]).all(|(a, b)| same(*a, *b)));
        }
    }
}

#[test]
fn what_is_no_body_is_not_written() {
    let (level, width) = *widths().last().expect("machine code");
    let shape = Shape { level, bytes: 8, width, block_vectors: 1, interleaved: 1, blocks: 1, resident: true };
    let good = oscillator();
    assert!(write(&good, shape).is_some());
    let bad = [
        Body { rows: 0, ..good.clone() },
        Body { next: vec![4, 4], ..good.clone() },
        Body { next: vec![4, 0], ..good.clone() },
        Body { next: vec![4, 7], ..good.clone() },
        Body { next: vec![4, 6, 2], ..good.clone() },
        Body { ops: vec![Op::State(0), Op::State(1), Op::Neg(3), Op::Neg(2), Op::Time, Op::Step, Op::Neg(0)], ..good.clone() },
        Body { ops: vec![Op::ShiftUp(0, 64)], next: vec![0], ..Body::default() },
        Body { ops: vec![Op::State(0), Op::ShiftUp(0, 64)], next: vec![1], ..Body::default() },
    ];
    assert!(bad.iter().all(|body| write(body, shape).is_none()));
    for wrong in [
        Shape { block_vectors: 0, ..shape },
        Shape { interleaved: 0, ..shape },
        Shape { blocks: 0, ..shape },
        Shape { width: 3, ..shape },
        Shape { level: Level::Baseline, ..shape },
        Shape { blocks: usize::MAX / 2, ..shape },
        Shape { blocks: 1 << 26, ..shape },
    ] {
        assert!(write(&good, wrong).is_none(), "{wrong:?}");
    }
}

/// Machine code has none of these; the interpreter has a loop for shifts that leave something of a number, and another for the
/// rest.
fn shifts_are_as_defined<T: Real>() {
    let bits = 8 * size_of::<T>() as u32;
    for places in [0, 1, bits - 1, bits, bits + 1, 200] {
        for op in [Op::ShiftUp(0, places), Op::ShiftDown(0, places)] {
            for lanes in [1, 8, 11] {
                let body = Body { ops: vec![Op::State(0), op], next: vec![1], precision: T::PRECISION, ..Body::default() };
                let inputs = Inputs::<T>::new(&mut Random(3), &body, lanes, 1);
                let want = inputs.state.iter().map(|x| T::apply(op, *x, *x, *x).pattern());
                let got = inputs.run(&Interpreter::new(&body, lanes, Level::Baseline), &mut Vec::new());
                assert!(got.iter().map(|x| x.pattern()).eq(want), "{op:?}, {lanes} lanes");
            }
        }
    }
}

#[test]
fn shifts_by_a_number_of_bits_or_more_leave_none() {
    shifts_are_as_defined::<f64>();
    shifts_are_as_defined::<f32>();
}

#[test]
#[should_panic(expected = "rows")]
fn a_tile_that_is_too_small_is_refused() {
    let kernel = written(&oscillator());
    let mut inputs = Inputs::<f64>::new(&mut Random(1), &oscillator(), Kernel::<f64>::lanes(&kernel), 1);
    inputs.rows.pop();
    inputs.run(&kernel, &mut Vec::new());
}

#[test]
fn four_threads_run_one_kernel() {
    let kernel = written(&oscillator());
    let inputs = Inputs::<f64>::new(&mut Random(3), &oscillator(), Kernel::<f64>::lanes(&kernel), 1000);
    let want = inputs.run(&kernel, &mut Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..50 {
                    let got = inputs.run(&kernel, &mut Vec::new());
                    assert!(want.iter().zip(&got).all(|(a, b)| same(*a, *b)));
                }
            });
        }
    });
}

#[test]
fn long_rows_are_gone_through_once() {
    // One step over 100 000 numbers, as elementwise functions are.
    let (level, width) = *widths().last().expect("machine code");
    let body = oscillator();
    let shape = Shape { level, bytes: 8, width, block_vectors: 1, interleaved: 1, blocks: 100_000 / width, resident: false };
    let inputs = Inputs::<f64>::new(&mut Random(9), &body, shape.lanes(), 2);
    let got = inputs.run(&write(&body, shape).expect("a kernel"), &mut Vec::new());
    let want = inputs.run(&Interpreter::new(&body, shape.lanes(), level), &mut Vec::new());
    assert!(want.iter().zip(&got).all(|(a, b)| same(*a, *b)));
}

/// Upwards, and small numbers are taken for zero, as operands and as results.
#[cfg(target_arch = "x86_64")]
const OTHER_ROUNDING: u64 = 0x4000 | 0x40 | 0x8000;
#[cfg(target_arch = "aarch64")]
const OTHER_ROUNDING: u64 = 1 << 22 | 1 << 24;

/// A caller that rounds otherwise gets the same bits, and goes on rounding as it did.
#[test]
fn rounding_is_to_nearest_whatever_the_caller_does() {
    let kernel = written(&oscillator());
    let inputs = Inputs::<f64>::new(&mut Random(5), &oscillator(), Kernel::<f64>::lanes(&kernel), 50);
    let want = inputs.run(&kernel, &mut Vec::new());
    let (got, after) = process::with_other_rounding(|| inputs.run(&kernel, &mut Vec::new()));
    assert!(want.iter().zip(&got).all(|(a, b)| same(*a, *b)));
    assert_eq!(after & OTHER_ROUNDING, OTHER_ROUNDING);
}

/// The body of several steps that returns the states between has the bits of these steps, interpreted and as machine code: for
/// states as they are between steps, and for velocities that are computed from a carry.
#[test]
fn unrolled_steps_return_the_states_between() {
    let wanted = std::env::var("STEPWELL_FUZZ").ok().and_then(|n| n.parse::<u64>().ok()).map_or(800, |n| n / 500);
    let (mut seen, mut seen_carried) = (0, 0);
    for seed in 0..wanted.max(800) {
        let random = &mut Random(seed.wrapping_mul(0xA076_1D64_78BD_642F) ^ 7);
        let (operations, made) = (3 + random.below(40), 1 + random.below(5));
        let body = random::body(random, operations, made);
        // The last results are velocities, which are returned in place of the first numbers of the state.
        let carried = random.below(2) * (made / 2);
        let state = made - carried;
        let v = if carried > 0 { carried } else { random.below(state + 1) };
        let y = random.below(state - v + 1);
        let is_whole = |op: &Op| !matches!(op, Op::State(s) if *s as usize >= state);
        if !body.ops.iter().all(is_whole) {
            continue; // it would read a result of the step as a number of the state
        }
        let (lanes, steps) = (random.one_of(&[1, 4, 8]), 1 + random.below(9));
        let unrolled = body.unrolled(steps, state, [v, y]);
        let inputs = Inputs::<f64>::new(random, &body, lanes, steps);
        // One after the other.
        let oracle = Interpreter::new(&body, lanes, Level::Baseline);
        let (mut want_v, mut want_y) = (Vec::new(), Vec::new());
        let mut now = inputs.clone();
        for step in 0..steps {
            now.steps = 1;
            now.per_step = inputs.per_step[step * body.per_step..].to_vec();
            let after = now.run(&oracle, &mut Vec::new());
            let (next, velocities) = after.split_at(state * lanes);
            want_v.extend_from_slice(if carried > 0 { velocities } else { &now.state[..v * lanes] });
            want_y.extend_from_slice(&now.state[v * lanes..(v + y) * lanes]);
            now.state[..state * lanes].copy_from_slice(next);
        }
        // At once.
        let mut all = Inputs { steps: 1, ..inputs };
        all.state.truncate(state * lanes);
        all.state.resize(unrolled.next.len() * lanes, 0.0);
        let (level, widest) = if Level::Neon.here() { (Level::Neon, 2) } else { (Level::Avx2, 4) };
        let width = if lanes == 1 { 1 } else { widest };
        let block_vectors = random.one_of(&[1, lanes / width]);
        let blocks = lanes / width / block_vectors;
        let shape = Shape { level, bytes: 8, width, block_vectors, interleaved: block_vectors, blocks, resident: false };
        let written = level.here().then(|| write(&unrolled, shape).expect("a kernel"));
        let interpreter = Interpreter::new(&unrolled, lanes, Level::Baseline);
        for kernel in
            [Some(&interpreter as &dyn Kernel), written.as_ref().map(|kernel| kernel as &dyn Kernel)].into_iter().flatten()
        {
            let got = all.run(kernel, &mut Vec::new());
            let (last, shown) = got.split_at(state * lanes);
            assert_eq!(shown.len(), want_v.len() + want_y.len(), "seed {seed}");
            let want = want_v.iter().chain(&want_y);
            assert!(shown.iter().zip(want).all(|(got, want)| same(*got, *want)), "seed {seed}, {steps} steps, {lanes} lanes");
            let want = &now.state[..state * lanes];
            assert!(last.iter().zip(want).all(|(got, want)| same(*got, *want)), "seed {seed}: the last state");
            seen += shown.len();
            seen_carried += carried;
        }
    }
    println!("{wanted} bodies, {seen} states");
    assert!(seen > 10_000 && seen_carried > 100, "{seen}, {seen_carried}");
}

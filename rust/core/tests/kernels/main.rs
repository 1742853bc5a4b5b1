//! Kernels that are written at run time: every bit as the interpreter has it, nothing touched that is not theirs, pages given back.
#![cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_os = "linux")))]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that fails may panic")]

#[cfg(target_arch = "x86_64")]
mod code;
mod inputs;
mod process;
mod random;

use inputs::{Inputs, same, shape};
use random::Random;
use stepwell_core::{
    isa::Level,
    kernel::{
        Kernel,
        interpret::Interpreter,
        pack::{self, Make, Move, Packed, Trial},
        writer::{Shape, Written, choose, write, write_packed},
    },
    tape::{Op, split::Body},
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

/// Compares a random body in a random shape with the interpreter; returns on how many inputs.
fn one_case(seed: u64, read_code: bool) -> usize {
    let random = &mut Random(seed.wrapping_mul(0xD134_2543_DE82_EF95));
    let operations = match random.below(8) {
        0 => 3 + random.below(6),
        7 => 200 + random.below(300),
        _ => 8 + random.below(80),
    };
    let states = if random.once_in(6) { 1 + random.below(30) } else { 1 + random.below(5) };
    let body = random::body(random, operations, states);
    let (level, width) = random.one_of(&widths());
    let shape = if random.once_in(8) {
        let members = random.one_of(&[1, 2, 4, 5, 8, 9, 60, 1000]);
        choose(&body, level, members).unwrap()
    } else {
        shape(random, level, width)
    };
    let kernel = write(&body, shape).unwrap_or_else(|| panic!("seed {seed}: {shape:?} is not written"));
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
        let inputs = Inputs::new(random, &body, lanes, steps);
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
        seen += one_case(seed, seed % 4 == 0);
        seed += 1;
    }
    println!("{seed} bodies, {seen} pairs of a body and an input");
}

/// Compares a random body, some operations of which are lanes of one vector, with the interpreter; returns on how many inputs, and how many
/// instructions that move numbers between lanes there are.
fn one_packed(seed: u64) -> [usize; 2] {
    let random = &mut Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let operations = random.one_of(&[12, 30, 60, 250]);
    let states = 1 + random.below(10);
    // As often as not one body several times, as the bodies, pairs or coordinates of a member are.
    let body = if random.once_in(2) {
        random::body(random, operations, states)
    } else {
        let copies = 2 + random.below(4);
        random::alike(random, operations / copies + 3, states.div_ceil(copies), copies)
    };
    let (level, _) = random.one_of(&widths());
    let trial = Trial { together: 1 + random.below(4), roots: 1 + random.below(4), again: random.once_in(2) };
    let Some(packed) = pack::pack(&body, trial) else { return [0, 0] };
    assert!(packed.is_sound(&body), "seed {seed}, {trial:?}");
    let kernel = write_packed(&body, level, &packed).unwrap_or_else(|| panic!("seed {seed}: {trial:?} is not written"));
    #[cfg(target_arch = "x86_64")]
    let moves = {
        let is_fused = body.ops.iter().any(|op| matches!(op, Op::MulAdd(..) | Op::MulSub(..) | Op::SubMul(..)));
        code::read(&kernel, is_fused)
    };
    #[cfg(not(target_arch = "x86_64"))]
    let moves = 0;
    let oracle = Interpreter::new(&body, 1, Level::Baseline);
    let mut scratch = Vec::new();
    for steps in [0, 1, 2, 7] {
        let inputs = Inputs::new(random, &body, 1, steps);
        let (want, got) = (inputs.run(&oracle, &mut Vec::new()), inputs.run(&kernel, &mut scratch));
        for (s, (want, got)) in want.iter().zip(&got).enumerate() {
            assert!(same(*want, *got), "seed {seed}, {trial:?}, {level:?}, {steps} steps: state {s} is {got:?}, not {want:?}");
        }
    }
    [4, moves]
}

#[test]
fn packed_bodies_have_the_bits_of_the_interpreter() {
    if !widths().iter().any(|(level, _)| *level >= Level::Avx2) {
        return;
    }
    let wanted = std::env::var("STEPWELL_FUZZ").ok().and_then(|n| n.parse::<usize>().ok()).map_or(20_000, |n| n / 20);
    let (mut seen, mut moves, mut seed) = (0, 0, 0);
    while seen < wanted {
        let [inputs, moved] = one_packed(seed);
        (seen, moves, seed) = (seen + inputs, moves + moved, seed + 1);
        assert!(seed < 10 * wanted as u64, "hardly any of the bodies is packed");
    }
    println!("{seed} bodies, {seen} pairs of a body and an input, {moves} moves between lanes");
    assert!(moves > wanted / 8, "{moves}");
}

/// Masses on a ring, each pulled by the next and by the one before: roots, quotients, and numbers that are needed in other lanes.
fn ring(n: u32) -> Body {
    let mut ops: Vec<Op> = (0..2 * n).map(Op::State).collect();
    ops.push(Op::Row(0));
    let mut each = |op: &dyn Fn(u32) -> Op| {
        ops.extend((0..n).map(op));
        ops.len() as u32 - n
    };
    let (v, y, soft) = (0, n, 2 * n);
    let d = each(&|i| Op::Sub(y + (i + 1) % n, y + i));
    let squares = each(&|i| Op::Mul(d + i, d + i));
    let sums = each(&|i| Op::Add(squares + i, soft));
    let roots = each(&|i| Op::Sqrt(sums + i));
    let pulls = each(&|i| Op::Div(d + i, roots + i));
    let both = each(&|i| Op::Sub(pulls + i, pulls + (i + n - 1) % n));
    let v = each(&|i| Op::Add(v + i, both + i));
    let y = each(&|i| Op::Add(y + i, v + i));
    Body { ops, next: (v..v + n).chain(y..y + n).collect(), rows: 1, ..Body::default() }
}

/// Packings of a body with a mistake each: a number from another lane, halves or operands exchanged, a number of the state replaced by another.
fn mistaken(packed: &Packed) -> Vec<Packed> {
    let mut all = Vec::new();
    let mut mistake = |at: usize, make: Make, of: [u32; 3]| {
        let mut wrong = packed.clone();
        (wrong.vectors[at].make, wrong.vectors[at].of) = (make, of);
        all.push(wrong);
    };
    for (at, vector) in packed.vectors.iter().enumerate() {
        let [a, b, c] = vector.of;
        match &vector.make {
            // The second lane of what is picked from one vector alone may not be needed, nor the last of four.
            Make::Move(Move::Pick(lanes)) if a == b => mistake(at, Make::Move(Move::Pick(lanes ^ 1)), vector.of),
            Make::Move(Move::Pick(lanes)) => (1..4).for_each(|bits| mistake(at, Make::Move(Move::Pick(lanes ^ bits)), vector.of)),
            Make::Move(Move::Permute(lanes)) => {
                (0..3).for_each(|lane| mistake(at, Make::Move(Move::Permute(lanes ^ 1 << (2 * lane))), vector.of));
            }
            Make::Move(Move::Join) | Make::Op(Op::Sub(..) | Op::Div(..)) if a != b => mistake(at, vector.make.clone(), [b, a, c]),
            _ => {}
        }
    }
    for (i, j) in (0..packed.state.len()).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let mut wrong = packed.clone();
        (wrong.state[i].next, wrong.state[j].next) = (packed.state[j].next, packed.state[i].next);
        all.push(wrong);
    }
    all
}

#[test]
fn a_mistake_in_a_packing_is_noticed() {
    let mut seen = [0, 0];
    for (n, level) in [3, 4, 5].into_iter().flat_map(|n| [Level::Avx2, Level::Avx512].map(|level| (n, level))) {
        for (together, roots, again) in [(1, 4, false), (1, 4, true), (1, 2, false), (2, 4, true), (3, 4, false)] {
            if !level.here() {
                continue;
            }
            let body = ring(n);
            let packed = pack::pack(&body, Trial { together, roots, again }).expect("a packing");
            let numbers = |n: usize, from: f64| (0..n).map(|i| (from + 1.7 * i as f64).sin()).collect::<Vec<f64>>();
            let (state, rows) = (numbers(2 * n as usize, 0.3), vec![0.1]);
            let inputs = Inputs { state, rows, uniforms: vec![], per_step: vec![], held: vec![], steps: 3 };
            let want = inputs.run(&Interpreter::new(&body, 1, Level::Baseline), &mut Vec::new());
            let is_right = |packed: &Packed| {
                let kernel = write_packed(&body, level, packed).expect("a kernel");
                let got = inputs.run(&kernel, &mut Vec::new());
                got.iter().zip(&want).all(|(got, want)| same(*got, *want))
            };
            assert!(is_right(&packed));
            for wrong in mistaken(&packed) {
                assert!(!is_right(&wrong), "{n}, {together}, {roots}, {again}: {wrong:?}");
                seen[usize::from(level == Level::Avx512)] += 1;
            }
        }
    }
    assert!(seen.iter().all(|seen| *seen == 0 || *seen > 100), "{seen:?}");
}

#[test]
fn what_are_no_vectors_of_a_body_is_not_written() {
    let Some((level, _)) = widths().into_iter().rfind(|(level, _)| *level >= Level::Avx2) else { return };
    let body = ring(3);
    let good = pack::pack(&body, Trial { together: 1, roots: 4, again: true }).expect("a packing");
    assert!(write_packed(&body, level, &good).is_some());
    let wrong = |change: &dyn Fn(&mut Packed)| {
        let mut packed = good.clone();
        change(&mut packed);
        write_packed(&body, level, &packed).is_none()
    };
    let fixed = good.vectors.iter().position(|vector| matches!(vector.make, Make::Fixed(_))).expect("a parameter");
    let made = good.vectors.len() - 1;
    assert!(wrong(&|packed| packed.state[0].numbers = vec![6]));
    assert!(wrong(&|packed| packed.state[0].numbers = vec![0; 5]));
    assert!(wrong(&|packed| packed.state[0].next = packed.state[1].next));
    assert!(wrong(&|packed| packed.state[0].next = packed.state[0].old));
    assert!(wrong(&|packed| packed.state[0].old = made as u32));
    assert!(wrong(&|packed| packed.vectors[fixed].make = Make::Fixed(vec![Op::Row(1)])));
    assert!(wrong(&|packed| packed.vectors[fixed].make = Make::Fixed(vec![Op::Uniform(0)])));
    assert!(wrong(&|packed| packed.vectors[fixed].make = Make::Fixed(vec![])));
    assert!(wrong(&|packed| packed.vectors[fixed].make = Make::Now(Op::Held(0))));
    assert!(wrong(&|packed| packed.vectors[made].of[0] = made as u32));
    assert!(wrong(&|packed| packed.vectors[made].operands = 1));
    assert!(wrong(&|packed| packed.vectors[made].width = 8));
}

fn oscillator() -> Body {
    // v' = v − φy, y' = y + φv'
    let ops = vec![Op::State(0), Op::State(1), Op::Row(0), Op::Mul(1, 2), Op::Sub(0, 3), Op::Mul(2, 4), Op::Add(1, 5)];
    Body { ops, next: vec![4, 6], rows: 1, uniforms: 0, per_step: 0 }
}

fn written(body: &Body) -> Written {
    let (level, width) = *widths().last().expect("machine code");
    write(body, Shape { level, width, block_vectors: 2, interleaved: 2, blocks: 3, resident: true }).expect("a kernel")
}

#[test]
fn states_that_change_places_do() {
    let body = Body { ops: vec![Op::State(0), Op::State(1), Op::Copy(1), Op::Copy(0)], next: vec![2, 3], ..Body::default() };
    for (level, width) in widths() {
        for resident in [false, true] {
            let shape = Shape { level, width, block_vectors: 2, interleaved: 2, blocks: 2, resident };
            let inputs = Inputs::new(&mut Random(7), &body, shape.lanes(), 3);
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
    let shape = Shape { level, width, block_vectors: 1, interleaved: 1, blocks: 1, resident: true };
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

#[test]
#[should_panic(expected = "rows")]
fn a_tile_that_is_too_small_is_refused() {
    let kernel = written(&oscillator());
    let mut inputs = Inputs::new(&mut Random(1), &oscillator(), kernel.lanes(), 1);
    inputs.rows.pop();
    inputs.run(&kernel, &mut Vec::new());
}

#[test]
fn four_threads_run_one_kernel() {
    let kernel = written(&oscillator());
    let inputs = Inputs::new(&mut Random(3), &oscillator(), kernel.lanes(), 1000);
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
    let shape = Shape { level, width, block_vectors: 1, interleaved: 1, blocks: 100_000 / width, resident: false };
    let inputs = Inputs::new(&mut Random(9), &body, shape.lanes(), 2);
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
    let inputs = Inputs::new(&mut Random(5), &oscillator(), kernel.lanes(), 50);
    let want = inputs.run(&kernel, &mut Vec::new());
    let (got, after) = process::with_other_rounding(|| inputs.run(&kernel, &mut Vec::new()));
    assert!(want.iter().zip(&got).all(|(a, b)| same(*a, *b)));
    assert_eq!(after & OTHER_ROUNDING, OTHER_ROUNDING);
}

/// The body of several steps that returns the states between has the bits of these steps, interpreted and as machine code: for states as
/// they are between steps, and for velocities that are computed from a carry.
#[test]
fn a_trail_has_the_states_of_its_steps() {
    let (mut seen, mut seen_carried) = (0, 0);
    for seed in 0..800u64 {
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
        let trail = body.trail(steps, state, [v, y]);
        let inputs = Inputs::new(random, &body, lanes, steps);
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
        all.state.resize(trail.next.len() * lanes, 0.0);
        let (level, widest) = if Level::Neon.here() { (Level::Neon, 2) } else { (Level::Avx2, 4) };
        let width = if lanes == 1 { 1 } else { widest };
        let block_vectors = random.one_of(&[1, lanes / width]);
        let blocks = lanes / width / block_vectors;
        let shape = Shape { level, width, block_vectors, interleaved: block_vectors, blocks, resident: false };
        let written = level.here().then(|| write(&trail, shape).expect("a kernel"));
        let interpreter = Interpreter::new(&trail, lanes, Level::Baseline);
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
    assert!(seen > 10_000 && seen_carried > 100, "{seen}, {seen_carried}");
}

//! Kernels of one member whose equal operations are lanes of one vector: the bits of the interpreter, and mistakes noticed.

#[cfg(target_arch = "x86_64")]
use crate::code;
use crate::{
    inputs::{Inputs, same},
    random::{self, Random},
    ring::ring,
    widths,
};
use stepwell_core::{
    isa::Level,
    kernel::{
        interpret::Interpreter,
        pack::{self, Make, Move, Packed, Trial},
        writer::{choose, packed_in_local_order, write_if_it_gains, write_packed},
    },
    tape::{Id, Op, real::Precision, split::Body},
};

/// A body of several equal parts, each with numbers of the state of its own; some operations read those of another part instead.
fn alike(random: &mut Random, operations: usize, states: usize, copies: usize) -> Body {
    let part = random::body(random, operations, states);
    let (n, count) = (part.ops.len() as Id, part.next.len() as u32);
    let mut whole = Body { per_step: part.per_step, uniforms: part.uniforms, rows: part.rows * copies, ..Body::default() };
    for copy in 0..copies as u32 {
        for op in &part.ops {
            let other = if random.once_in(8) { random.below(copy as usize + 1) as u32 } else { copy };
            whole.ops.push(match *op {
                Op::State(s) => Op::State(s + copy * count),
                Op::Row(i) => Op::Row(i + copy * part.rows as u32),
                op => op.with(|of| if matches!(part.ops[of as usize], Op::State(_)) { of + other * n } else { of + copy * n }),
            });
        }
        whole.next.extend(part.next.iter().map(|id| id + copy * n));
    }
    whole
}

/// Compares a random body, with some operations packed into vectors, with the interpreter; returns on how many inputs,
/// and how many instructions that move numbers between lanes there are.
fn one_packed(seed: u64) -> [usize; 2] {
    let random = &mut Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let operations = random.one_of(&[12, 30, 60, 250]);
    let states = 1 + random.below(10);
    // As often as not one body several times, as the bodies, pairs or coordinates of a member are.
    let body = if random.once_in(2) {
        random::body(random, operations, states)
    } else {
        let copies = 2 + random.below(4);
        alike(random, operations / copies + 3, states.div_ceil(copies), copies)
    };
    let (level, _) = random.one_of(&widths());
    let trial = Trial { together: 1 + random.below(4), roots: 1 + random.below(4), again: random.once_in(2) };
    let Some(packed) = pack::pack(&body, trial) else { return [0, 0] };
    let packed = if seed.is_multiple_of(3) { packed_in_local_order(&packed, 0) } else { packed };
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
    let mut scratch = Vec::<f64>::new();
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

/// Packings of a body with a mistake each: a number from another lane, halves or operands exchanged, a number of the state
/// replaced by another.
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

/// Packed code is for numbers of 64 bits.
#[test]
fn a_body_of_single_precision_is_not_packed() {
    let Some((level, _)) = widths().into_iter().rfind(|(level, _)| *level >= Level::Avx2) else { return };
    for (n, precision) in [3, 4].into_iter().flat_map(|n| [Precision::Double, Precision::Single].map(|precision| (n, precision)))
    {
        let body = Body { precision, ..ring(n) };
        let is_double = precision == Precision::Double;
        let shape = choose(&body, level, 1).expect("a shape");
        assert_eq!(shape.packs(), is_double);
        let packed = pack::pack(&body, Trial { together: 1, roots: 4, again: true }).expect("a packing");
        assert_eq!(write_packed(&body, level, &packed).is_some(), is_double);
        assert!(is_double || write_if_it_gains(&body, shape).is_none());
    }
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

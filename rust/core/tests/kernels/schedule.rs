//! The order in which operations are written.

use stepwell_core::{
    isa::Level,
    kernel::writer::{Order, Shape, Waits, in_turn},
};
#[cfg(target_arch = "x86_64")]
use {
    crate::code::sums_before,
    stepwell_core::{
        kernel::writer::assemble,
        tape::{Op, real::Precision, split::Body},
    },
};

use crate::random::Random;

/// Sums, whose results are there after three cycles.
fn sums(operands: Vec<Vec<usize>>) -> Waits {
    let time = vec![[3.0, 0.5]; operands.len()];
    Waits::new(operands, time)
}

fn of_one(operations: usize) -> Order {
    (0..operations).map(|i| (i, 0)).collect()
}

fn indices(order: &Order) -> Vec<usize> {
    order.iter().map(|(i, _)| *i).collect()
}

fn interleaved(block_vectors: usize, interleaved: usize) -> Shape {
    Shape { level: Level::Avx512, bytes: 8, width: 8, block_vectors, interleaved, blocks: 1, resident: false }
}

#[test]
fn a_vector_is_behind_the_one_before() {
    let together = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)];
    assert_eq!(in_turn(3, interleaved(2, 2), 0), together);
    let behind = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (2, 1)];
    assert_eq!(in_turn(3, interleaved(2, 2), 1), behind);
    // Three vectors, of which two are interleaved; the third comes behind both.
    assert_eq!(in_turn(2, interleaved(3, 2), 1), [(0, 0), (1, 0), (0, 1), (1, 1), (0, 2), (1, 2)]);
    // Further behind than a step is long: one vector after the other.
    assert_eq!(in_turn(2, interleaved(2, 2), 5), [(0, 0), (1, 0), (0, 1), (1, 1)]);
}

/// A step of `numbers` numbers: each grows by the sum of all squares, which wait for each other.
#[cfg(target_arch = "x86_64")]
fn squares(numbers: u32) -> Body {
    let mut ops: Vec<Op> = (0..numbers).map(Op::State).collect();
    ops.extend((0..numbers).map(|s| Op::Mul(s, s)));
    ops.push(Op::Add(numbers, numbers + 1));
    for square in numbers + 2..2 * numbers {
        ops.push(Op::Add(ops.len() as u32 - 1, square));
    }
    let sum = ops.len() as u32 - 1;
    ops.extend((0..numbers).map(|s| Op::Add(s, sum)));
    let next = (0..numbers).map(|s| sum + 1 + s).collect();
    Body { ops, next, rows: 0, uniforms: 0, per_step: 0, precision: Precision::Double }
}

#[cfg(target_arch = "x86_64")]
#[test]
fn vectors_that_leave_no_registers_are_spread_over_the_step() {
    let before = |numbers, shape| sums_before(&assemble(&squares(numbers), shape).unwrap(), 1);
    // By a quarter of 3 · 14 − 1 operations; by as many as gain anything of 3 · 40 − 1. One more is written at the same moment.
    assert_eq!([before(14, interleaved(4, 4)), before(40, interleaved(4, 4))], [41 / 4 + 1, 24 + 1]);
    // Two vectors, those that leave registers, and 16 registers gain nothing.
    let avx2 = Shape { level: Level::Avx2, width: 4, ..interleaved(4, 4) };
    let close = [before(14, interleaved(2, 2)), before(12, interleaved(4, 4)), before(14, avx2)];
    assert!(close.iter().all(|sums| *sums <= 4), "{close:?}");
}

#[test]
fn chains_alternate() {
    // 0 → 1 → 2 and 3 → 4 → 5: each waits for the one before, so both chains go on in turn.
    let two = sums(vec![vec![], vec![0], vec![1], vec![], vec![3], vec![4]]);
    let (written, shortened) = (of_one(6), two.shortened(&of_one(6), 9));
    assert_eq!(indices(&shortened), [0, 3, 1, 4, 2, 5]);
    assert_eq!([two.waiting(&written), two.waiting(&shortened)], [1, 2]);
}

#[test]
fn what_would_wait_for_a_register_does_not_begin() {
    // As above; but where one result may wait at a time, each chain goes to its end.
    let two = sums(vec![vec![], vec![0], vec![1], vec![], vec![3], vec![4]]);
    assert_eq!(indices(&two.shortened(&of_one(6), 1)), [0, 1, 2, 3, 4, 5]);
}

#[test]
fn the_longest_way_goes_first() {
    // 0 is used at the end; 1 → 2 → 3 is long.
    let waits = sums(vec![vec![], vec![], vec![1], vec![0, 2]]);
    assert_eq!(indices(&waits.longest_first(of_one(4))), [1, 0, 2, 3]);
}

#[test]
fn one_unit_makes_quotients_one_after_the_other() {
    // Two quotients that are ready, and a chain of sums that is there in the order behind them: it begins while the unit is busy.
    let mut time = vec![[13.0, 8.0], [13.0, 8.0]];
    time.extend([[3.0, 0.5]; 3]);
    let waits = Waits::new(vec![vec![], vec![], vec![], vec![2], vec![3]], time);
    assert_eq!(indices(&waits.shortened(&of_one(5), 9)), [0, 2, 3, 4, 1]);
}

#[test]
fn each_operation_comes_once_and_after_its_operands() {
    let mut random = Random(7);
    for round in 0..200 {
        let (operations, vectors) = (1 + round % 90, 1 + round % 3);
        let mut operands: Vec<Vec<usize>> = vec![Vec::new(); operations];
        for (i, of) in operands.iter_mut().enumerate().skip(1) {
            *of = (0..random.below(3)).map(|_| random.below(i)).collect();
            of.sort_unstable();
            of.dedup();
        }
        let waits = sums(operands.clone());
        let order = in_turn(operations, interleaved(vectors, vectors), round % 5);
        let order = if vectors == 1 { waits.longest_first(order) } else { order };
        for most in [2, 8, 64] {
            let made = waits.shortened(&order, most);
            let mut at = vec![usize::MAX; operations * vectors];
            made.iter().enumerate().for_each(|(n, (i, vector))| at[vector * operations + i] = n);
            assert_eq!(made.len(), operations * vectors);
            assert!(at.iter().all(|n| *n != usize::MAX));
            for (i, vector) in &made {
                assert!(operands[*i].iter().all(|of| at[vector * operations + of] < at[vector * operations + i]));
            }
        }
        if vectors == 1 {
            let (freely, held) = (waits.shortened(&order, 64), waits.shortened(&order, 2));
            assert!(waits.waiting(&held) <= waits.waiting(&freely).max(2));
        }
    }
}

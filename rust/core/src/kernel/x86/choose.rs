//! Which shape is the fastest.
//!
//! A vector unit is busy when there are enough independent operations. One vector has few of them: a step is mostly one long
//! dependency chain. So several vectors are interleaved, the more the longer the chain is in comparison with the work.

use super::Shape;
use crate::{
    isa::Level,
    tape::{Op, split::Body},
};

/// A kernel's code is at most about so many operations, to stay in the instruction cache.
const MOST_CODE: usize = 2000;
/// The machine looks ahead over several steps of fewer operations than that.
const SHORT: usize = 48;
/// How many bytes a tile's rows may take of the data cache.
const MOST_ROWS: usize = 12 << 10;

/// The shape for a run of so many members; none if the level has no machine code.
pub fn choose(body: &Body, level: Level, members: usize) -> Option<Shape> {
    (level > Level::Baseline).then(|| quickest(body, level, members))
}

/// The shape for rows of so many numbers, each a number of a long block; none if they are no whole vectors.
pub fn choose_long(_body: &Body, level: Level, lanes: usize) -> Option<Shape> {
    let width = match level {
        _ if lanes == 1 => 1,
        Level::Avx512 => 8,
        _ => 4,
    };
    let fits = level > Level::Baseline && lanes.is_multiple_of(width);
    let vectors = lanes / width;
    let block_vectors = [4, 2, 1].into_iter().find(|n| vectors.is_multiple_of(*n))?;
    fits.then_some(Shape { level, width, block_vectors, interleaved: 1, blocks: vectors / block_vectors, resident: false })
}

/// The shape for several steps at once of this body over rows of so many lanes; none as above. As many vectors are interleaved as hide the
/// latency: such code is too long for the machine to see what comes after a vector's last step.
pub fn choose_trail(body: &Body, level: Level, lanes: usize) -> Option<Shape> {
    let long = choose_long(body, level, lanes)?;
    let vectors = lanes / long.width;
    let together = (1..=wanted(body, level).min(vectors)).rev().find(|n| vectors.is_multiple_of(*n))?;
    Some(Shape { block_vectors: together, interleaved: together, blocks: vectors / together, ..long })
}

fn quickest(body: &Body, level: Level, members: usize) -> Shape {
    let width = match (level, members) {
        (_, 0..=1) => 1,
        (Level::Avx512, 5..) => 8,
        _ => 4,
    };
    let vectors = members.div_ceil(width).max(1);
    let changed = (0..body.next.len()).filter(|s| !body.keeps(*s)).count().max(1);
    // A step of few operations is over before its state would be through the cache: it stays in registers. There are too few of
    // them with AVX2, but some help; and the machine sees the end of so short a step, so that vectors can go one after the other.
    let (most, interleaved) = if level == Level::Avx512 { (24, 4) } else { (40, 1) };
    // One vector alone would keep the machine waiting.
    if vectors == 1 || body.work() <= 5 * changed && 2 * changed <= most {
        let block_vectors = even(vectors, (most / changed).clamp(1, 20));
        // Several blocks, for what is done once for a tile: before a few steps it takes longer than they do.
        let blocks = blocks(body, width, block_vectors).min(vectors / block_vectors).max(1);
        return Shape { level, width, block_vectors, interleaved, blocks, resident: true };
    }
    let most = (MOST_CODE / body.work()).max(1);
    let wanted = wanted(body, level).min(most);
    if wanted == 1 {
        // Two in a turn, one after the other: the second begins while the first ends. What of the state has a register stays there.
        let block_vectors = even(vectors, most.min(2));
        let blocks = blocks(body, width, block_vectors).min(vectors.div_ceil(block_vectors));
        return Shape { level, width, block_vectors, interleaved: 1, blocks, resident: block_vectors > 1 };
    }
    let block_vectors = even(vectors, wanted);
    let blocks = blocks(body, width, block_vectors).min(vectors.div_ceil(block_vectors));
    // Of short steps the machine sees several at once by itself.
    let interleaved = if body.work() < SHORT { block_vectors.min(3) } else { block_vectors };
    Shape { level, width, block_vectors, interleaved, blocks, resident: false }
}

/// How many blocks a tile has whose rows stay in the cache.
fn blocks(body: &Body, width: usize, block_vectors: usize) -> usize {
    let row = 8 * width * block_vectors * (body.next.len() + body.rows);
    (MOST_ROWS / row).clamp(1, 4)
}

/// At most so many of all vectors at once, so that the last turn has not fewer than it must.
fn even(vectors: usize, most: usize) -> usize {
    vectors.div_ceil(vectors.div_ceil(most))
}

/// How many interleaved vectors hide the latency of operations.
fn wanted(body: &Body, level: Level) -> usize {
    let (mut work, mut longest) = (0.0, 0.0f64);
    let mut after = vec![0.0; body.ops.len()];
    for (id, op) in body.ops.iter().enumerate() {
        let (wait, cost) = price(*op);
        let (operands, n) = op.operands();
        after[id] = wait + operands[..n].iter().map(|operand| after[*operand as usize]).fold(0.0, f64::max);
        work += cost;
        longest = longest.max(after[id]);
    }
    // Found by trying all on the scenes of the benchmarks. With 16 registers more than five are in each other's way.
    match level {
        Level::Avx512 => (3.8 * longest / work - 1.3).round().clamp(1.0, 6.0) as usize,
        _ => (2.2 * longest / work).ceil().clamp(1.0, 5.0) as usize,
    }
}

/// After how many cycles an operation is done, and for how many it occupies the machine, for a vector of 512 bits.
fn price(op: Op) -> (f64, f64) {
    match op {
        _ if op.is_leaf() => (0.0, 0.0),
        Op::Add(..) | Op::Sub(..) | Op::Mul(..) => (3.0, 0.5),
        Op::MulAdd(..) | Op::MulSub(..) | Op::SubMul(..) => (4.0, 0.5),
        Op::Less(..) | Op::LessEqual(..) | Op::Equal(..) | Op::Floor(_) => (4.0, 0.5),
        Op::Div(..) => (13.0, 8.0),
        Op::Sqrt(_) => (20.0, 13.0),
        _ => (1.0, 0.5),
    }
}

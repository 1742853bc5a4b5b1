//! Chooses the fastest shape.
//!
//! A vector unit is busy when there are enough independent operations. One vector has few of them: a step is mostly one long
//! dependency chain. So several vectors are interleaved: the longer the chain in comparison with the work, the more.

use super::{shape::Shape, timing::timing};
use crate::{isa::Level, tape::split::Body};

/// The most operations of a kernel, about, so that its code stays in the instruction cache.
const MAX_CODE_OPERATIONS: usize = 2000;
/// In steps of fewer operations than this, out-of-order execution overlaps several steps.
const SHORT_STEP_OPERATIONS: usize = 48;
/// This many vectors keep both the unit of roots and quotients and the others busy, if steps are so short that their code fits.
const VECTORS_AROUND_SLOW: usize = 8;
/// Longer chains, of evaluations that wait for each other, need more vectors, side by side.
const MAX_SIDE_BY_SIDE_AROUND_SLOW: usize = 3;
/// The most bytes of a tile's rows, so that they stay in the data cache.
const MAX_ROW_BYTES: usize = 12 << 10;

/// The shape for a run of `members` members; none if the level has no machine code.
pub fn choose(body: &Body, level: Level, members: usize) -> Option<Shape> {
    (level > Level::Baseline).then(|| fastest(body, level, members))
}

/// The shape for rows of `lanes` numbers, each a number of a long block; none if they are not whole vectors.
pub fn choose_long(body: &Body, level: Level, lanes: usize) -> Option<Shape> {
    let bytes = body.precision.bytes();
    let width = match level {
        _ if lanes == 1 => 1,
        Level::Avx512 => 64 / bytes,
        Level::Neon => 16 / bytes,
        _ => 32 / bytes,
    };
    let fits = level > Level::Baseline && lanes.is_multiple_of(width);
    let vectors = lanes / width;
    let most = (MAX_CODE_OPERATIONS / body.work().max(1)).max(1);
    let block_vectors = [4, 2, 1].into_iter().find(|n| *n <= most && vectors.is_multiple_of(*n))?;
    let blocks = vectors / block_vectors;
    fits.then_some(Shape { level, bytes, width, block_vectors, interleaved: 1, blocks, resident: lanes == 1 })
}

/// The shape for several steps of this body in one call, over rows of a given number of lanes; None as above. As many vectors are
/// interleaved as hide the latency: such code is too long for the CPU to begin another vector before one has made its last step.
pub fn choose_unrolled(body: &Body, level: Level, lanes: usize) -> Option<Shape> {
    let long = choose_long(body, level, lanes)?;
    let vectors = lanes / long.width;
    let together = (1..=interleaving(body, level).min(vectors)).rev().find(|n| vectors.is_multiple_of(*n))?;
    Some(Shape { block_vectors: together, interleaved: together, blocks: vectors / together, ..long })
}

fn fastest(body: &Body, level: Level, members: usize) -> Shape {
    let bytes = body.precision.bytes();
    let width = match (level, members) {
        (_, 0..=1) => 1,
        (Level::Avx512, _) if members * bytes > 32 => 64 / bytes,
        (Level::Neon, _) => 16 / bytes,
        _ => 32 / bytes,
    };
    let vectors = members.div_ceil(width).max(1);
    let changed = (0..body.next.len()).filter(|s| !body.keeps(*s)).count().max(1);
    // A step of few operations takes less time than loading and storing its state: the state stays in registers. AVX2 has too few
    // registers for all of it, but some help; and out-of-order execution overlaps such short steps, so that vectors need not be
    // interleaved.
    let (most, interleaved) = if level == Level::Avx2 { (40, 1) } else { (24, 4) };
    // A single vector would wait for its state to pass through memory.
    if vectors == 1 || body.work() <= 5 * changed && 2 * changed <= most {
        let block_vectors = evenly(vectors, (most / changed).clamp(1, 20));
        // Several blocks share what is done once for a tile, which may take longer than a few steps do.
        let blocks = blocks(body, width, block_vectors).min(vectors / block_vectors).max(1);
        return Shape { level, bytes, width, block_vectors, interleaved, blocks, resident: true };
    }
    let most = (MAX_CODE_OPERATIONS / body.work()).max(1);
    let interleaving = interleaving(body, level).min(most);
    if interleaving <= MAX_SIDE_BY_SIDE_AROUND_SLOW
        && most >= VECTORS_AROUND_SLOW
        && body.ops.iter().any(|op| timing(*op).is_slow())
    {
        // One after the other: see `schedule`, where each fills the waits of the one before it.
        let fit = MAX_ROW_BYTES / row_bytes(body, width).max(1);
        let block_vectors = evenly(vectors, VECTORS_AROUND_SLOW.min(fit).max(1));
        let blocks = blocks(body, width, block_vectors).min(vectors.div_ceil(block_vectors));
        return Shape { level, bytes, width, block_vectors, interleaved: 1, blocks, resident: false };
    }
    if interleaving == 1 {
        // Two vectors in a turn, one after the other: the second begins while the first ends. State that has a register stays
        // there.
        let block_vectors = evenly(vectors, most.min(2));
        let blocks = blocks(body, width, block_vectors).min(vectors.div_ceil(block_vectors));
        return Shape { level, bytes, width, block_vectors, interleaved: 1, blocks, resident: block_vectors > 1 };
    }
    let block_vectors = evenly(vectors, interleaving);
    let blocks = blocks(body, width, block_vectors).min(vectors.div_ceil(block_vectors));
    // Out-of-order execution overlaps short steps by itself.
    let interleaved = if body.work() < SHORT_STEP_OPERATIONS { block_vectors.min(3) } else { block_vectors };
    Shape { level, bytes, width, block_vectors, interleaved, blocks, resident: false }
}

/// How many blocks a tile may have so that its rows stay in the cache.
fn blocks(body: &Body, width: usize, block_vectors: usize) -> usize {
    (MAX_ROW_BYTES / (block_vectors * row_bytes(body, width))).clamp(1, 4)
}

/// The bytes of a tile's rows for each of its vectors.
fn row_bytes(body: &Body, width: usize) -> usize {
    body.precision.bytes() * width * (body.next.len() + body.rows)
}

/// The number of vectors per turn, at most `most`, that divides all vectors most evenly among the turns.
fn evenly(vectors: usize, most: usize) -> usize {
    vectors.div_ceil(vectors.div_ceil(most))
}

/// How many interleaved vectors hide the latency of operations.
fn interleaving(body: &Body, level: Level) -> usize {
    let (mut work, mut longest) = (0.0, 0.0f64);
    let mut after = vec![0.0; body.ops.len()];
    for (id, op) in body.ops.iter().enumerate() {
        if op.is_leaf() {
            continue;
        }
        let timing = timing(*op);
        let (operands, n) = op.operands();
        after[id] = f64::from(timing.latency) + operands[..n].iter().map(|operand| after[*operand as usize]).fold(0.0, f64::max);
        work += timing.interval();
        longest = longest.max(after[id]);
    }
    // Fitted to the fastest numbers on the scenes of the benchmarks. With 16 registers more than five vectors cause spills. NEON
    // has as many registers as AVX-512 and is taken to be like it: it was not measured.
    match level {
        Level::Avx2 => (2.2 * longest / work).ceil().clamp(1.0, 5.0) as usize,
        _ => (3.8 * longest / work - 1.3).round().clamp(1.0, 6.0) as usize,
    }
}

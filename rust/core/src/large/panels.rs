//! Products of a matrix with columns of numbers, summed in the order of the columns.
//!
//! A sum in a fixed order is a chain of additions that wait for each other. So several rows are summed at once: their chains run
//! side by side, and a number of the state is read once for all of them. The entries are stored in panels of a few rows, in the
//! order in which they are used; rows of zeros fill the last panel. They change no sum.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use crate::{aligned::Aligned, tape::eval::fused};

/// A matrix, by panels.
pub(crate) struct Panels {
    entries: Aligned,
    filled: usize,
}

/// Rows of a panel: as many panels of the first height as possible, then of the next. An addition takes four cycles: four vectors
/// of eight rows hide that.
const HEIGHTS: [usize; 3] = [32, 16, 8];

/// How many numbers a product has, with the padding of the last panel.
pub(crate) fn filled(rows: usize) -> usize {
    rows.next_multiple_of(HEIGHTS[2])
}

/// The sums of all rows that fill panels of `R`; what is left of entries and rows.
#[inline(always)]
fn panels<'a, const R: usize, const FUSED: bool>(
    entries: &'a [f64],
    out: &'a mut [f64],
    parts: [&[f64]; 3],
    stop: &AtomicBool,
) -> (&'a [f64], &'a mut [f64]) {
    let size = R * parts.iter().map(|part| part.len()).sum::<usize>();
    let (out, rest) = out.as_chunks_mut::<R>();
    let mut left = entries;
    for now in out {
        if stop.load(Relaxed) {
            break;
        }
        let (panel, later) = left.split_at(size);
        *now = sums::<R, FUSED>(panel.as_chunks().0, parts);
        left = later;
    }
    (left, rest)
}

/// The sums of `R` rows. The first product starts a sum: −0 is the number that changes nothing when added, not even a −0.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "a loop over lanes is written as the instructions that it becomes")]
fn sums<const R: usize, const FUSED: bool>(mut entries: &[[f64; R]], parts: [&[f64]; 3]) -> [f64; R] {
    let mut sum = [-0.0; R];
    for part in parts {
        let (now, later) = entries.split_at(part.len());
        for (m, s) in now.iter().zip(part) {
            for r in 0..R {
                sum[r] = if FUSED { fused(m[r], *s, sum[r]) } else { sum[r] + m[r] * s };
            }
        }
        entries = later;
    }
    sum
}

impl Panels {
    /// The matrix with these entries by row and column.
    pub(crate) fn new(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let filled = filled(rows);
        let mut entries = Aligned::new(filled * columns);
        let mut places = entries.iter_mut();
        let mut first = 0;
        for height in HEIGHTS {
            while filled - first >= height {
                let panel = (0..columns).flat_map(|j| (first..first + height).map(move |i| (i, j)));
                for ((i, j), place) in panel.zip(&mut places) {
                    *place = if i < rows { entry(i, j) } else { 0.0 };
                }
                first += height;
            }
        }
        Panels { entries, filled }
    }

    /// `out` = the matrix times the numbers of all parts, one part after the other; it has room for [`filled`] numbers. When
    /// `stop` is set, it returns early with an unfinished result.
    #[inline(always)]
    pub(crate) fn times(&self, parts: [&[f64]; 3], out: &mut [f64], stop: &AtomicBool) {
        self.all::<false>(parts, out, stop);
    }

    /// The product by fused multiply-adds.
    #[inline(always)]
    pub(crate) fn times_fused(&self, parts: [&[f64]; 3], out: &mut [f64], stop: &AtomicBool) {
        self.all::<true>(parts, out, stop);
    }

    #[inline(always)]
    fn all<const FUSED: bool>(&self, parts: [&[f64]; 3], out: &mut [f64], stop: &AtomicBool) {
        let rest = panels::<{ HEIGHTS[0] }, FUSED>(&self.entries, &mut out[..self.filled], parts, stop);
        let rest = panels::<{ HEIGHTS[1] }, FUSED>(rest.0, rest.1, parts, stop);
        panels::<{ HEIGHTS[2] }, FUSED>(rest.0, rest.1, parts, stop);
    }
}

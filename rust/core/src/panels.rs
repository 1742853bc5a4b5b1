//! Products of a matrix with columns of numbers, for several members side by side, summed in the order of the columns.
//!
//! A sum in a fixed order is a chain of additions that wait for each other. So a few rows are summed at once: their chains
//! run side by side, and a number of the state is read once for all of them. The entries are stored in panels of so many
//! rows, in the order in which they are used; rows that fill no panel come last, one by one. No sum changes by that.

use crate::rows::{Rows, lanes, lanes_mut, zeros};

/// A matrix of `L` lanes, by panels.
pub struct Panels<const L: usize> {
    entries: Rows<L>,
    rows: usize,
    columns: usize,
}

/// Rows of the panels, as many of the first kind as there are, then of the next. For many lanes: their sums fill half of the
/// registers of AVX2. For one lane the rows take the place of the lanes.
const MANY: [usize; 3] = [4, 2, 1];
const ONE: [usize; 3] = [8, 4, 1];

/// The sums of `R` rows. The first product starts a sum: −0 is the number that changes nothing when added, not even a −0.
#[inline(always)]
fn panel<const R: usize, const L: usize>(mut entries: &[[[f64; L]; R]], parts: [&[[f64; L]]; 3]) -> [[f64; L]; R] {
    let mut sum = [[-0.0; L]; R];
    for part in parts {
        let (now, later) = entries.split_at(part.len());
        for (m, s) in now.iter().zip(part) {
            for r in 0..R {
                for l in 0..L {
                    sum[r][l] += m[r][l] * s[l];
                }
            }
        }
        entries = later;
    }
    sum
}

/// The sums of all rows that fill panels of `R`; what is left of entries and rows.
#[inline(always)]
fn panels<'a, const R: usize, const L: usize>(
    (entries, out): (&'a [[f64; L]], &'a mut [[f64; L]]),
    columns: usize,
    parts: [&[[f64; L]]; 3],
) -> (&'a [[f64; L]], &'a mut [[f64; L]]) {
    let (out, rest) = out.as_chunks_mut::<R>();
    let (entries, left) = entries.split_at(out.len() * R * columns);
    for (out, entries) in out.iter_mut().zip(entries.chunks_exact((R * columns).max(1))) {
        *out = panel(entries.as_chunks().0, parts);
    }
    (left, rest)
}

impl<const L: usize> Panels<L> {
    const HEIGHTS: [usize; 3] = if L == 1 { ONE } else { MANY };

    /// The matrix with these entries by row and column.
    pub fn new(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> [f64; L]) -> Self {
        let mut entries = zeros(rows * columns);
        let mut places = lanes_mut(&mut entries).iter_mut();
        let mut first = 0;
        for height in Self::HEIGHTS {
            while rows - first >= height {
                let panel = (0..columns).flat_map(|j| (first..first + height).map(move |i| (i, j)));
                for ((i, j), place) in panel.zip(&mut places) {
                    *place = entry(i, j);
                }
                first += height;
            }
        }
        Panels { entries, rows, columns }
    }

    /// `out` = the matrix times the numbers of all parts, one part after the other.
    #[inline(always)]
    pub fn times(&self, parts: [&[[f64; L]]; 3], out: &mut [[f64; L]]) {
        let (all, columns) = ((lanes(&self.entries), &mut out[..self.rows]), self.columns);
        if L == 1 {
            let rest = panels::<{ ONE[0] }, L>(all, columns, parts);
            let rest = panels::<{ ONE[1] }, L>(rest, columns, parts);
            panels::<{ ONE[2] }, L>(rest, columns, parts);
        } else {
            let rest = panels::<{ MANY[0] }, L>(all, columns, parts);
            let rest = panels::<{ MANY[1] }, L>(rest, columns, parts);
            panels::<{ MANY[2] }, L>(rest, columns, parts);
        }
    }
}

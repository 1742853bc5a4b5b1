//! Products of a matrix with columns of numbers, summed in the order of the columns.
//!
//! A sum in a fixed order is a chain of additions that wait for each other. So a few rows are summed at once: their chains
//! run side by side, and a number of the state is read once for all of them. The entries are stored in panels of so many
//! rows, in the order in which they are used; rows that fill no panel come last, one by one. No sum changes by that.

use crate::{
    isa::{Level, Task, with_isa},
    run::aligned::Aligned,
};

/// A matrix, by panels.
pub struct Panels {
    entries: Aligned,
    rows: usize,
    columns: usize,
}

/// Rows of the panels, as many of the first kind as there are, then of the next.
const HEIGHTS: [usize; 3] = [8, 4, 1];

struct Times<'a> {
    entries: &'a [f64],
    columns: usize,
    parts: [&'a [f64]; 3],
    out: &'a mut [f64],
}

impl Task for Times<'_> {
    #[inline(always)]
    fn run(self) {
        let Times { entries, columns, parts, out } = self;
        let rest = panels::<{ HEIGHTS[0] }>(entries, out, columns, parts);
        let rest = panels::<{ HEIGHTS[1] }>(rest.0, rest.1, columns, parts);
        panels::<{ HEIGHTS[2] }>(rest.0, rest.1, columns, parts);
    }
}

/// The sums of all rows that fill panels of `R`; what is left of entries and rows.
#[inline(always)]
fn panels<'a, const R: usize>(
    entries: &'a [f64],
    out: &'a mut [f64],
    columns: usize,
    parts: [&[f64]; 3],
) -> (&'a [f64], &'a mut [f64]) {
    let (out, rest) = out.as_chunks_mut::<R>();
    let (entries, left) = entries.split_at(out.len() * R * columns);
    for (out, entries) in out.iter_mut().zip(entries.chunks_exact((R * columns).max(1))) {
        *out = panel(entries.as_chunks().0, parts);
    }
    (left, rest)
}

/// The sums of `R` rows. The first product starts a sum: −0 is the number that changes nothing when added, not even a −0.
#[inline(always)]
fn panel<const R: usize>(mut entries: &[[f64; R]], parts: [&[f64]; 3]) -> [f64; R] {
    let mut sum = [-0.0; R];
    for part in parts {
        let (now, later) = entries.split_at(part.len());
        for (m, s) in now.iter().zip(part) {
            for r in 0..R {
                sum[r] += m[r] * s;
            }
        }
        entries = later;
    }
    sum
}

impl Panels {
    /// The matrix with these entries by row and column.
    pub fn new(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let mut entries = Aligned::new(rows * columns);
        let mut places = entries.iter_mut();
        let mut first = 0;
        for height in HEIGHTS {
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
    pub fn times(&self, level: Level, parts: [&[f64]; 3], out: &mut [f64]) {
        let task = Times { entries: &self.entries, columns: self.columns, parts, out: &mut out[..self.rows] };
        with_isa!(level, |isa| isa.run(task));
    }
}

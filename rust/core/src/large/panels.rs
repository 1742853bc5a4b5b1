//! Products of a matrix with columns of numbers, summed in the order of the columns.
//!
//! A sum in a fixed order is a chain of additions that wait for each other. So some rows are summed at once: their chains run side by
//! side, and a number of the state is read once for all of them. The entries are stored in panels of so many rows, in the order in
//! which they are used; rows of zeros fill the last. No sum changes by that.

use crate::{
    isa::{Level, Task, with_isa},
    run::aligned::Aligned,
};

/// A matrix, by panels.
pub struct Panels {
    entries: Aligned,
    /// What comes of the last product, with the rows that fill the last panel.
    made: Aligned,
    rows: usize,
}

/// Rows of the panels, as many of the first kind as there are, then of the next. An addition takes four cycles: four vectors of eight rows
/// hide that.
const HEIGHTS: [usize; 3] = [32, 16, 8];

/// Several products with the same column, one after the other.
struct Times<'a, const N: usize> {
    column: &'a [f64],
    products: [(&'a [f64], &'a mut [f64]); N],
}

impl<const N: usize> Task for Times<'_, N> {
    #[inline(always)]
    fn run(self) {
        for (entries, out) in self.products {
            let rest = panels::<{ HEIGHTS[0] }>(entries, out, self.column);
            let rest = panels::<{ HEIGHTS[1] }>(rest.0, rest.1, self.column);
            panels::<{ HEIGHTS[2] }>(rest.0, rest.1, self.column);
        }
    }
}

/// The sums of all rows that fill panels of `R`; what is left of entries and rows.
#[inline(always)]
fn panels<'a, const R: usize>(mut entries: &'a [f64], mut out: &'a mut [f64], column: &[f64]) -> (&'a [f64], &'a mut [f64]) {
    while out.len() >= R {
        let (now, later) = out.split_at_mut(R);
        let (panel, rest) = entries.split_at(R * column.len());
        now.copy_from_slice(&sums::<R>(panel.as_chunks().0, column));
        (entries, out) = (rest, later);
    }
    (entries, out)
}

/// The sums of `R` rows. The first product starts a sum: −0 is the number that changes nothing when added, not even a −0.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "a loop over lanes is written as the instructions that it becomes")]
fn sums<const R: usize>(entries: &[[f64; R]], column: &[f64]) -> [f64; R] {
    let mut sum = [-0.0; R];
    for (m, s) in entries.iter().zip(column) {
        for r in 0..R {
            sum[r] += m[r] * s;
        }
    }
    sum
}

impl Panels {
    /// The matrix with these entries by row and column.
    pub fn new(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let filled = rows.next_multiple_of(HEIGHTS[2]);
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
        Panels { entries, made: Aligned::new(filled), rows }
    }

    fn product(&mut self) -> (&[f64], &mut [f64]) {
        (&self.entries, &mut self.made)
    }

    /// The matrix times a column.
    pub fn times(&mut self, level: Level, column: &[f64]) -> &[f64] {
        let task = Times { column, products: [self.product()] };
        with_isa!(level, |isa| isa.run(task));
        &self.made[..self.rows]
    }

    /// Both matrices times a column.
    pub fn both_times<'a>(both: [&'a mut Panels; 2], level: Level, column: &[f64]) -> [&'a [f64]; 2] {
        let [one, other] = both;
        let task = Times { column, products: [one.product(), other.product()] };
        with_isa!(level, |isa| isa.run(task));
        [&one.made[..one.rows], &other.made[..other.rows]]
    }
}

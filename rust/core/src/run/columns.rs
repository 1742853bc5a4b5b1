//! An array of rows that threads share: each has columns of its own, of every row.

use ndarray::{ArrayViewMut2, Axis};

/// Some columns of an array of rows. Its size does not depend on the number of rows, so that a run may save every step.
pub(crate) struct Columns<'a, T>(ArrayViewMut2<'a, T>);

impl<T: Copy> Columns<'_, T> {
    /// How many rows there are.
    pub(crate) fn rows(&self) -> usize {
        self.0.nrows()
    }

    /// The `rows` rows from the `first`-th on, one after the other, if this part has all columns.
    pub(crate) fn whole(&mut self, first: usize, rows: usize) -> Option<&mut [T]> {
        let width = self.0.ncols();
        self.0.as_slice_mut()?.get_mut(first * width..(first + rows) * width)
    }

    /// Puts the first `count` columns of an array of that width into one column, one behind the other from row `first` on.
    pub(crate) fn put(&mut self, column: usize, first: usize, count: usize, numbers: &[T], width: usize) {
        let behind = numbers.len() / width;
        if behind == 0 {
            return; // of no rows there are no columns
        }
        let mut rows = self.0.index_axis_mut(Axis(1), column);
        for (i, numbers) in numbers.chunks_exact(width).enumerate() {
            let mut row = first + i;
            for number in &numbers[..count] {
                rows[row] = *number;
                row += behind;
            }
        }
    }

    /// Its part of a row.
    ///
    /// # Panics
    ///
    /// If there is no such row.
    #[inline]
    pub(crate) fn row(&mut self, i: usize) -> &mut [T] {
        self.0.index_axis_mut(Axis(0), i).into_slice().unwrap_or_default() // columns of a row lie side by side
    }
}

/// Cuts every row of `width` numbers at the same places, one part for each share, as far as there are columns.
pub(crate) fn cut<'a, T>(data: &'a mut [T], width: usize, shares: &[usize]) -> Vec<Columns<'a, T>> {
    let rows = data.len().checked_div(width).unwrap_or(0);
    let columns = if rows == 0 { 0 } else { width };
    let mut rest = ArrayViewMut2::from_shape((rows, columns), &mut data[..rows * columns]).ok();
    let part = |share: &usize| {
        let whole = rest.take()?;
        let at = (*share).min(whole.ncols());
        let (part, others) = whole.split_at(Axis(1), at);
        rest = Some(others);
        Some(Columns(part))
    };
    shares.iter().filter_map(part).collect()
}

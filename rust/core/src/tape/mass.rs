//! The mass matrix of equations M·ẏ = f. Some of its rows may be zero: those equations are algebraic, 0 = f.
//!
//! `reference/mass.py` has the same operations in the same order.

use nalgebra::DVector;

use super::number::Number;

/// The entries of a constant matrix, by rows, without zeros.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Mass(Vec<Vec<(u32, u64)>>);

impl Mass {
    /// A matrix from its rows, with the columns and entries of each.
    pub fn new(rows: &[Vec<(u32, f64)>]) -> Mass {
        Mass(rows.iter().map(|row| row.iter().map(|(column, entry)| (*column, entry.to_bits())).collect()).collect())
    }

    /// Whether it has `numbers` rows, and no column beyond them.
    pub(crate) fn fits(&self, numbers: usize) -> bool {
        self.0.len() == numbers && self.0.iter().flatten().all(|(column, _)| (*column as usize) < numbers)
    }

    /// The columns and entries of a row; none if its equation is algebraic.
    pub(crate) fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.0[row].iter().map(|(column, entry)| (*column as usize, f64::from_bits(*entry)))
    }

    /// M·y
    pub(crate) fn times<N: Number>(&self, y: &DVector<N>) -> DVector<N> {
        let term = |(column, entry): (usize, f64)| if entry == 1.0 { y[column] } else { N::of(entry) * y[column] };
        let sum = |row: usize| self.row(row).map(term).reduce(|sum, term| sum + term).unwrap_or_else(|| N::of(0.0));
        DVector::from_iterator(y.len(), (0..y.len()).map(sum))
    }

    /// The rates, with zeros for algebraic equations, which give no rate.
    pub(crate) fn rates<N: Number>(&self, rates: DVector<N>) -> DVector<N> {
        let rate = |(row, rate): (usize, &N)| if self.0[row].is_empty() { N::of(0.0) } else { *rate };
        DVector::from_iterator(rates.len(), rates.iter().enumerate().map(rate))
    }
}

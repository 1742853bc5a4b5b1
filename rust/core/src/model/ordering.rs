//! The order in which unknowns are eliminated, by the places of a matrix that may hold a number.
//!
//! `reference/ordering.py` has the same order.

/// A set of columns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Columns(Vec<u64>);

impl Columns {
    /// Whether a column is in it.
    pub(crate) fn has(&self, column: usize) -> bool {
        self.0.get(column / 64).is_some_and(|word| word >> (column % 64) & 1 == 1)
    }

    /// Adds a column.
    pub(crate) fn add(&mut self, column: usize) {
        if self.0.len() <= column / 64 {
            self.0.resize(column / 64 + 1, 0);
        }
        self.0[column / 64] |= 1 << (column % 64);
    }

    /// Adds all columns of another set.
    pub(crate) fn join(&mut self, other: &Columns) {
        if self.0.len() < other.0.len() {
            self.0.resize(other.0.len(), 0);
        }
        self.0.iter_mut().zip(&other.0).for_each(|(word, other)| *word |= other);
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum::<usize>()
    }

    /// The columns, ascending.
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        let of = |(place, word): (usize, &u64)| {
            let (first, word) = (64 * place, *word);
            (0..64).filter(move |bit| word != 0 && word >> bit & 1 == 1).map(move |bit| first + bit)
        };
        self.0.iter().enumerate().flat_map(of)
    }

    /// Removes a column.
    pub(crate) fn remove(&mut self, column: usize) {
        if let Some(word) = self.0.get_mut(column / 64) {
            *word &= !(1 << (column % 64));
        }
    }
}

impl FromIterator<usize> for Columns {
    fn from_iter<I: IntoIterator<Item = usize>>(columns: I) -> Columns {
        let mut set = Columns::default();
        columns.into_iter().for_each(|column| set.add(column));
        set
    }
}

/// An order, and what it costs.
pub(crate) struct Ordering {
    /// The unknowns, in the order of their elimination.
    pub order: Vec<usize>,
    /// Operations of the factors.
    pub factors: usize,
    /// Operations of a solution by them.
    pub solution: usize,
}

impl Ordering {
    /// Orders a matrix by the columns of its rows: of the unknowns that are left, the next is the one, or the first of several,
    /// whose rows have the fewest entries when each is as long as all of them together, as it is after exchanges that depend on
    /// numbers.
    pub(crate) fn new(mut rows: Vec<Columns>) -> Ordering {
        let mut left: Vec<usize> = (0..rows.len()).collect();
        let mut all = Ordering { order: Vec::with_capacity(left.len()), factors: 0, solution: 0 };
        let entries = |rows: &[Columns], left: &[usize], unknown: usize| {
            let (among, columns) = candidates(rows, left, unknown);
            among.len() * columns.len()
        };
        let mut of_unknown: Vec<usize> = left.iter().map(|unknown| entries(&rows, &left, *unknown)).collect();
        while let Some(place) = (0..left.len()).min_by_key(|place| of_unknown[left[*place]]) {
            let unknown = left[place];
            let (mut among, mut columns) = candidates(&rows, &left, unknown);
            left.remove(place);
            all.order.push(unknown);
            all.note(among.len(), columns.len());
            let mut changed = columns.clone();
            changed.join(&rows[unknown]);
            // Without an entry on the diagonal the first row that has one is taken in any case.
            if let Some(first) = among.first().copied().filter(|_| !rows[unknown].has(unknown)) {
                rows.swap(unknown, first);
                among.remove(0);
            }
            columns.remove(unknown);
            among.into_iter().filter(|row| *row != unknown).for_each(|row| rows[row].clone_from(&columns));
            for other in changed.iter().filter(|other| *other != unknown) {
                of_unknown[other] = entries(&rows, &left, other);
            }
        }
        all
    }

    /// One comparison, two choices for each entry, a product and a difference for each but the first, and the factor of each row.
    fn note(&mut self, rows: usize, columns: usize) {
        let others = rows.saturating_sub(1);
        self.factors += others * (4 * columns) + 1;
        self.solution += 4 * others + 2 * columns;
    }
}

/// The rows that may be taken for an unknown, and all columns that they have.
fn candidates(rows: &[Columns], left: &[usize], unknown: usize) -> (Vec<usize>, Columns) {
    let among: Vec<usize> = left.iter().copied().filter(|row| rows[*row].has(unknown)).collect();
    let mut columns = Columns::default();
    among.iter().for_each(|row| columns.join(&rows[*row]));
    (among, columns)
}

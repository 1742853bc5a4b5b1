//! Points joined by rods at some places: what an impulse at one of them does to all, and corrections of lengths.

use super::surface::dot;
use crate::{
    model::{
        elimination::Factors,
        systems::rods::{Links, Vectors},
    },
    tape::number::Number,
};

/// Velocities of the points by a unit impulse; None for points that do not feel it.
pub(crate) type Column<N> = Vec<Option<Vec<N>>>;

/// Adds a change of a block to it, times a factor.
pub(crate) fn add<N: Number>(block: &mut [N], column: &Column<N>, factor: Option<N>) {
    let dim = block.len() / column.len();
    for (x, change) in block.chunks_mut(dim).zip(column) {
        for (x, change) in x.iter_mut().zip(change.iter().flatten()) {
            *x += factor.map_or(*change, |factor| factor * *change);
        }
    }
}

/// Points and rods at some places.
pub(crate) struct Joined<'a, N: Number> {
    links: &'a Links<N>,
    /// The vector of each rod.
    d: Vectors<N>,
}

impl<'a, N: Number> Joined<'a, N> {
    pub(crate) fn new(links: &'a Links<N>, y: &[N]) -> Self {
        Joined { links, d: links.spans(y) }
    }

    pub(crate) fn factors(&self) -> Factors<N> {
        self.links.factors(&self.d)
    }

    /// The squares of the lengths.
    pub(crate) fn squares(&self) -> Vec<N> {
        self.d.iter().map(|d| dot(d, d)).collect()
    }

    /// Half the rates of these squares.
    pub(crate) fn closing(&self, v: &[N]) -> Vec<N> {
        self.d.iter().zip(self.links.closing(v)).map(|(d, u)| dot(d, &u)).collect()
    }

    /// Velocities of the points by a unit impulse at point i.
    pub(crate) fn column(&self, factors: &Factors<N>, i: usize, along: &[N]) -> Column<N> {
        let mut right = vec![None; self.d.len()];
        for ((right, [a, b]), d) in right.iter_mut().zip(&self.links.ends).zip(&self.d) {
            if *a == i || *b == i {
                *right = Some(if *b == i { self.links.inverse[i] } else { self.links.minus[i] } * dot(d, along));
            }
        }
        let mut column = self.links.pushed_by_some(&self.d, &factors.solve_some(right));
        let own = along.iter().map(|along| self.links.inverse[i] * *along);
        column[i] = Some(match &column[i] {
            None => own.collect(),
            Some(felt) => own.zip(felt).map(|(own, felt)| own + *felt).collect(),
        });
        column
    }

    /// Changes a block along the rods by what takes these errors away.
    pub(crate) fn correct(&self, factors: &Factors<N>, block: &mut [N], off: Vec<N>) {
        let pulls: Vec<_> = factors.solve(off).into_iter().map(Some).collect();
        add(block, &self.links.pushed_by_some(&self.d, &pulls), None);
    }
}

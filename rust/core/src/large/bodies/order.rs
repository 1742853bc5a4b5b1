//! Which bodies have mass: those come first, the rest after them, each kind in its own order.

use crate::model::{spec::Signature, systems::nbody};

/// The order of the bodies, and room for what is taken in it.
#[derive(Default)]
pub(super) struct Order {
    massive: Vec<usize>,
    massless: Vec<u32>,
    places: Vec<f64>,
    pushes: Vec<f64>,
    /// Two blocks of bodies in that order.
    blocks: [Vec<f64>; 2],
}

impl Order {
    pub(super) fn of(signature: &Signature) -> Self {
        Order { massive: nbody::massive(signature), massless: signature.list("massless").to_vec(), ..Order::default() }
    }

    /// How many have mass.
    pub(super) fn massive(&self) -> usize {
        self.massive.len()
    }

    /// The numbers of those without.
    pub(super) fn massless(&self) -> &[u32] {
        &self.massless
    }

    /// The number of one with mass.
    pub(super) fn number(&self, k: usize) -> usize {
        self.massive[k]
    }

    /// Takes the places of the bodies with mass.
    pub(super) fn take_places(&mut self, dim: usize, y: &[f64]) {
        self.places.clear();
        self.massive.iter().for_each(|i| self.places.extend_from_slice(&y[dim * i..][..dim]));
        self.pushes.resize(self.places.len(), 0.0);
    }

    /// These.
    pub(super) fn places(&self) -> &[f64] {
        &self.places
    }

    /// These, and room for what pushes them.
    pub(super) fn places_and_pushes(&mut self) -> (&[f64], &mut [f64]) {
        (&self.places, &mut self.pushes)
    }

    /// Puts that where it belongs.
    pub(super) fn spread_pushes(&self, dim: usize, out: &mut [f64]) {
        for (push, i) in self.pushes.chunks_exact(dim).zip(&self.massive) {
            out[dim * i..][..dim].copy_from_slice(push);
        }
    }

    /// Blocks in this order.
    pub(super) fn all_of<'a, const B: usize>(&'a mut self, dim: usize, blocks: [&'a [f64]; B]) -> [&'a [f64]; B] {
        self.arranged(dim, blocks, usize::MAX)
    }

    /// Of blocks what belongs to bodies with mass.
    pub(super) fn massive_of<'a, const B: usize>(&'a mut self, dim: usize, blocks: [&'a [f64]; B]) -> [&'a [f64]; B] {
        self.arranged(dim, blocks, self.massive.len())
    }

    fn arranged<'a, const B: usize>(&'a mut self, dim: usize, mut blocks: [&'a [f64]; B], count: usize) -> [&'a [f64]; B] {
        if self.massless.is_empty() {
            return blocks;
        }
        for (to, from) in self.blocks.iter_mut().zip(&blocks) {
            to.clear();
            let order = self.massive.iter().copied().chain(self.massless.iter().map(|i| *i as usize));
            order.take(count).for_each(|i| to.extend_from_slice(&from[dim * i..][..dim]));
        }
        for (block, ordered) in blocks.iter_mut().zip(&self.blocks) {
            *block = ordered;
        }
        blocks
    }
}

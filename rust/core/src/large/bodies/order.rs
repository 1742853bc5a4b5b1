//! The order of the bodies: massive ones come first, then those without mass, each kind in its own order.

use crate::model::{spec::Signature, systems::nbody};

/// The order of the bodies, and buffers for values in this order.
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

    /// The number of massive bodies.
    pub(super) fn massive(&self) -> usize {
        self.massive.len()
    }

    /// The numbers of the bodies without mass.
    pub(super) fn massless(&self) -> &[u32] {
        &self.massless
    }

    /// The number of the k-th massive body.
    pub(super) fn number(&self, k: usize) -> usize {
        self.massive[k]
    }

    /// Takes the places of the massive bodies.
    pub(super) fn take_places(&mut self, dim: usize, y: &[f64]) {
        self.places.clear();
        self.massive.iter().for_each(|i| self.places.extend_from_slice(&y[dim * i..][..dim]));
        self.pushes.resize(self.places.len(), 0.0);
    }

    /// The places of the massive bodies, in their order.
    pub(super) fn places(&self) -> &[f64] {
        &self.places
    }

    /// The places, and a buffer for their accelerations.
    pub(super) fn places_and_pushes(&mut self) -> (&[f64], &mut [f64]) {
        (&self.places, &mut self.pushes)
    }

    /// Scatters the accelerations to the rows of their bodies.
    pub(super) fn spread_pushes(&self, dim: usize, out: &mut [f64]) {
        for (push, i) in self.pushes.chunks_exact(dim).zip(&self.massive) {
            out[dim * i..][..dim].copy_from_slice(push);
        }
    }

    /// The rows of these blocks in this order.
    pub(super) fn all_of<'a, const B: usize>(&'a mut self, dim: usize, blocks: [&'a [f64]; B]) -> [&'a [f64]; B] {
        self.arranged(dim, blocks, usize::MAX)
    }

    /// The rows of these blocks that belong to massive bodies.
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

//! A force from outside, added to v̇ in every stage: the caller's own array, which a [`crate::run::world::World`] reads before its steps.

use crate::{
    error::Error,
    number::Number,
    spec::{Given, Parameters},
    system::{Block, Energies, Gradient, Shape, System},
};

/// The name under which it is given, one row for each number of v.
pub const NAME: &str = "added.force";

/// An error unless it has a row for each number of v.
pub fn check(given: &Given, shape: Shape) -> Result<(), Error> {
    match given.count(NAME) {
        0 => Ok(()),
        _ => given.expect(NAME, shape.v),
    }
}

/// A system under the force that is given, or the system itself.
pub fn wrap<N: Number>(p: &Parameters<N>, system: Box<dyn System<N>>) -> Box<dyn System<N>> {
    match p.numbers(NAME) {
        [] => system,
        force => {
            let fixed = fixed(p.given, force.len());
            let push = force.iter().zip(&fixed).map(|(force, fixed)| (!fixed).then(|| p.h * *force)).collect();
            Box::new(Forced { system, push })
        }
    }
}

/// Which numbers of v belong to particles that feel no force.
pub fn fixed(given: &Given, numbers: usize) -> Vec<bool> {
    let mut fixed = vec![false; numbers];
    let dim = numbers / given.whole("n").max(1);
    given.list("fixed").iter().for_each(|particle| fixed[dim * *particle as usize..][..dim].fill(true));
    fixed
}

struct Forced<N: Number> {
    system: Box<dyn System<N>>,
    /// h times the force; none on what is fixed.
    push: Vec<Option<N>>,
}

impl<N: Number> System<N> for Forced<N> {
    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let dv = self.system.dv(t, v, y);
        let pushed = dv.iter().zip(&self.push).map(|(dv, push)| push.map_or(*dv, |push| *dv + push));
        Block::from_iterator(dv.len(), pushed)
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.system.dy(t, v, y)
    }

    fn velocity(&self, d: &Block<N>) -> Block<N> {
        self.system.velocity(d)
    }

    // Energy, and what keeps it, are those of the system alone.

    fn energies(&self, v: &Block<N>, y: &Block<N>) -> Option<Energies<N>> {
        self.system.energies(v, y)
    }

    fn gradient(&self, v: &Block<N>, y: &Block<N>, energies: &Energies<N>) -> Option<Gradient<N>> {
        self.system.gradient(v, y, energies)
    }

    fn record(&self, quantity: &str, v: &Block<N>, y: &Block<N>) -> Option<Vec<N>> {
        self.system.record(quantity, v, y)
    }

    fn project(&self, v: Block<N>, y: Block<N>) -> (Block<N>, Block<N>) {
        self.system.project(v, y)
    }

    fn tally(&self) -> Option<N> {
        self.system.tally()
    }
}

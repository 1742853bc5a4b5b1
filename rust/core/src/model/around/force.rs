//! A force from outside, added to v̇ in every stage: the caller's own array, which a [`crate::run::world::World`] reads before
//! its steps.

use super::part::{Attempts, Part};
use crate::{
    model::{
        spec::Signature,
        system::{Block, System},
    },
    tape::number::Number,
};

/// The name under which it is given, one row for each number of v.
pub const NAME: &str = "added.force";

/// The part: a row for each number of v.
pub(crate) fn part<N: Number>() -> Part<N> {
    Part {
        name: NAME,
        is_given: |signature| signature.count(NAME) > 0,
        check: |_, signature, shape| signature.expect(NAME, shape.v),
        velocity_term: |_, _| None,
        attempts: Attempts::Added,
        is_for_carry: true,
        is_only_fixed: |_| false,
        has_rows: true,
        wrap: |p, system, _| {
            let force = p.numbers(NAME);
            let fixed = fixed(p.signature, force.len());
            let push = force.iter().zip(&fixed).map(|(force, fixed)| (!fixed).then(|| p.h * *force)).collect();
            Box::new(Forced { system, push })
        },
    }
}

/// Which numbers of v belong to particles that feel no force.
pub(crate) fn fixed(signature: &Signature, numbers: usize) -> Vec<bool> {
    let mut fixed = vec![false; numbers];
    let dim = numbers / signature.whole("n").max(1);
    signature.list("fixed").iter().for_each(|particle| fixed[dim * *particle as usize..][..dim].fill(true));
    fixed
}

struct Forced<N: Number> {
    system: Box<dyn System<N>>,
    /// h times the force; none on what is fixed.
    push: Vec<Option<N>>,
}

impl<N: Number> System<N> for Forced<N> {
    // Energy, and what keeps it, are those of the system alone.
    fn inner(&self) -> Option<&dyn System<N>> {
        Some(self.system.as_ref())
    }

    fn dv(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        let dv = self.system.dv(t, v, y);
        let pushed = dv.iter().zip(&self.push).map(|(dv, push)| push.map_or(*dv, |push| *dv + push));
        Block::from_iterator(dv.len(), pushed)
    }

    fn dy(&self, t: N, v: &Block<N>, y: &Block<N>) -> Block<N> {
        self.system.dy(t, v, y)
    }
}

//! A chain of n masses between two walls, joined by n + 1 springs. n is chosen at run time.
//!
//! Spring j pulls between masses j − 1 and j with f_j = k_j·(y_j − y_{j−1}); the walls stand still at 0. A spring of no
//! stiffness at an end leaves that end free. Sizes: n. Parameters: the n + 1 stiffnesses, then the n masses.

use crate::{
    error::Error,
    group::{Clock, Group, Spec, Width},
    rows::{self, Large, Rows, lanes, lanes_mut, zeros},
    stepper::Stepper,
    system::System,
};

/// The chains of `L` members, scaled to the step.
pub struct Chain<const L: usize> {
    stiffness: Rows<L>,
    by_mass: Rows<L>,
    force: Rows<L>,
    h: f64,
}

/// by·(b − a) in every lane. The row is made whole before it is stored, so the compiler need not ask whether the store changes
/// what is read.
#[inline(always)]
fn pull<const L: usize>(by: &[f64; L], a: &[f64; L], b: &[f64; L]) -> [f64; L] {
    let mut row = [0.0; L];
    for l in 0..L {
        row[l] = by[l] * (b[l] - a[l]);
    }
    row
}

impl<const L: usize> System for Chain<L> {
    type V = Rows<L>;
    type Y = Rows<L>;

    #[inline(always)]
    fn dv(&mut self, _t: f64, _v: &Rows<L>, y: &Rows<L>, out: &mut Rows<L>) {
        let (y, k, f) = (lanes(y), lanes(&self.stiffness), lanes_mut(&mut self.force));
        let n = y.len();
        let (Some(first), Some(last)) = (y.first(), y.last()) else { return };
        f[0] = pull(&k[0], &[0.0; L], first);
        for ((f, k), pair) in f[1..n].iter_mut().zip(&k[1..n]).zip(y.windows(2)) {
            *f = pull(k, &pair[0], &pair[1]);
        }
        f[n] = pull(&k[n], last, &[0.0; L]);
        for ((out, pair), by_mass) in lanes_mut(out).iter_mut().zip(f.windows(2)).zip(lanes(&self.by_mass)) {
            *out = pull(by_mass, &pair[0], &pair[1]);
        }
    }

    #[inline(always)]
    fn dy(&mut self, _t: f64, v: &Rows<L>, _y: &Rows<L>, out: &mut Rows<L>) {
        for (out, v) in out.as_mut_slice().iter_mut().zip(v.as_slice()) {
            *out = self.h * *v;
        }
    }

    #[inline(always)]
    fn velocity(&mut self, d: &Rows<L>, out: &mut Rows<L>) {
        for (out, d) in out.as_mut_slice().iter_mut().zip(d.as_slice()) {
            *out = *d / self.h;
        }
    }
}

impl<const L: usize> Large<L> for Chain<L> {
    fn shape(spec: &Spec) -> (usize, usize) {
        (spec.size(0), spec.size(0))
    }

    fn prepare(spec: &Spec, clock: &Clock, member: impl Fn(usize) -> usize) -> Self {
        let h = clock.h;
        let n = spec.size(0);
        let mut chain = Chain { stiffness: zeros(n + 1), by_mass: zeros(n), force: zeros(n + 1), h };
        for l in 0..L {
            let member = member(l);
            for (j, k) in lanes_mut(&mut chain.stiffness).iter_mut().enumerate() {
                k[l] = spec.at(j, member);
            }
            for (i, by_mass) in lanes_mut(&mut chain.by_mass).iter_mut().enumerate() {
                by_mass[l] = h / spec.at(n + 1 + i, member);
            }
        }
        chain
    }
}

/// A group of chains.
pub fn group<St: Stepper>(spec: &Spec, clock: &Clock, width: Width) -> Result<Box<dyn Group>, Error> {
    match (spec.options.as_slice(), spec.sizes.as_slice()) {
        ([], &[n]) if n > 0 => Ok(rows::group::<Chain<{ rows::LANES }>, Chain<1>, St>(spec, clock, width)),
        _ => Err(spec.unknown_options()),
    }
}

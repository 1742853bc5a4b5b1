//! The rates of a long chain ([`crate::systems::chain`]).

use super::{Asked, Facts, Rates};
use crate::{
    isa::{Level, Task, with_isa},
    spec::Spec,
};

struct Chain {
    level: Level,
    h: f64,
    stiffness: Vec<f64>,
    by_mass: Vec<f64>,
    force: Vec<f64>,
}

/// The rates of a chain.
pub fn make(asked: &Asked) -> Box<dyn Rates> {
    let n = asked.shape.y;
    let (stiffness, by_mass, force) = (vec![0.0; n + 1], vec![0.0; n], vec![0.0; n + 1]);
    Box::new(Chain { level: asked.machine.level, h: asked.h, stiffness, by_mass, force })
}

struct Pull<'a> {
    stiffness: &'a [f64],
    by_mass: &'a [f64],
    force: &'a mut [f64],
    y: &'a [f64],
    out: &'a mut [f64],
}

impl Task for Pull<'_> {
    #[inline(always)]
    fn run(self) {
        let Pull { stiffness: k, by_mass, force: f, y, out } = self;
        let n = y.len();
        let (Some(first), Some(last)) = (y.first(), y.last()) else { return };
        f[0] = k[0] * first;
        for ((f, k), pair) in f[1..n].iter_mut().zip(&k[1..n]).zip(y.windows(2)) {
            *f = k * (pair[1] - pair[0]);
        }
        f[n] = k[n] * (0.0 - last);
        for ((out, pair), by_mass) in out.iter_mut().zip(f.windows(2)).zip(by_mass) {
            *out = (pair[1] - pair[0]) * by_mass;
        }
    }
}

impl Rates for Chain {
    fn facts(&self) -> Facts {
        Facts { second_order: true, reads_v: false }
    }

    fn prepare(&mut self, spec: &Spec, first: usize, _count: usize) {
        let row = |name: &str, i: usize| spec.given.place(name).map_or(f64::NAN, |place| spec.rows[place + i].at(first));
        self.stiffness.iter_mut().enumerate().for_each(|(i, k)| *k = row("stiffness", i));
        self.by_mass.iter_mut().enumerate().for_each(|(i, by_mass)| *by_mass = self.h / row("mass", i));
    }

    fn dv(&mut self, _t: f64, _v: &[f64], y: &[f64], out: &mut [f64]) {
        let Chain { level, stiffness, by_mass, force, .. } = self;
        with_isa!(*level, |isa| isa.run(Pull { stiffness, by_mass, force, y, out }));
    }
}

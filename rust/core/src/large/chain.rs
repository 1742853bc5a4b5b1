//! The rates of a long chain ([`crate::model::systems::chain`]).

use super::rates::{RateTraits, Rates, RatesRequest};
use crate::{
    isa::{Level, Task, with_isa},
    model::{spec::Spec, systems::chain::energy},
};

struct Chain {
    level: Level,
    h: f64,
    stiffness: Vec<f64>,
    mass: Vec<f64>,
    by_mass: Vec<f64>,
}

/// The rates of a chain.
pub(crate) fn make(asked: &RatesRequest) -> Box<dyn Rates> {
    let n = asked.shape.y;
    let (stiffness, mass, by_mass) = (vec![0.0; n + 1], vec![0.0; n], vec![0.0; n]);
    Box::new(Chain { level: asked.machine.level, h: asked.h, stiffness, mass, by_mass })
}

struct Pull<'a> {
    stiffness: &'a [f64],
    by_mass: &'a [f64],
    y: &'a [f64],
    out: &'a mut [f64],
}

impl Task for Pull<'_> {
    /// Each mass computes the forces of both its springs: that is faster than storing the force of each spring.
    #[inline(always)]
    fn run(self) {
        let Pull { stiffness: k, by_mass, y, out } = self;
        let n = y.len();
        let (k, by_mass, out) = (&k[..n + 1], &by_mass[..n], &mut out[..n]);
        let at = |i: usize, before: f64, here: f64, after: f64| (k[i + 1] * (after - here) - k[i] * (here - before)) * by_mass[i];
        if let [only] = y {
            out[0] = at(0, 0.0, *only, 0.0);
            return;
        }
        out[0] = at(0, 0.0, y[0], y[1]);
        for i in 1..n - 1 {
            out[i] = at(i, y[i - 1], y[i], y[i + 1]);
        }
        out[n - 1] = at(n - 1, y[n - 2], y[n - 1], 0.0);
    }
}

impl Rates for Chain {
    fn traits(&self) -> RateTraits {
        RateTraits { second_order: true, reads_v: false, stretched: false }
    }

    fn prepare(&mut self, spec: &Spec, first: usize, _count: usize) {
        let row = |name: &str, i: usize| spec.signature.place(name).map_or(f64::NAN, |place| spec.rows[place + i].at(first));
        self.stiffness.iter_mut().enumerate().for_each(|(i, k)| *k = row("stiffness", i));
        self.mass.iter_mut().enumerate().for_each(|(i, mass)| *mass = row("mass", i));
        self.by_mass.iter_mut().zip(&self.mass).for_each(|(by_mass, mass)| *by_mass = self.h / mass);
    }

    fn dv(&mut self, _t: f64, _v: &[f64], y: &[f64], out: &mut [f64]) {
        let Chain { level, stiffness, by_mass, .. } = self;
        with_isa!(*level, |isa| isa.run(Pull { stiffness, by_mass, y, out }));
    }

    /// Records the energy, the only quantity.
    fn record(&mut self, v: &[f64], y: &[f64], rows: &mut [f64]) {
        rows.fill(energy([&self.stiffness, &self.mass], v, y));
    }
}

//! A force from outside, added to the rates of one member: the same as [`crate::model::around::force`], over rows.

use super::rates::{RateTraits, Rates, RatesRequest};
use crate::{
    model::{
        around::force::{NAME, fixed},
        spec::Spec,
    },
    stage::Force,
};

/// Rates under the force that is given, or the rates themselves.
pub(crate) fn wrap(rates: Box<dyn Rates>, asked: &RatesRequest) -> Box<dyn Rates> {
    if asked.signature.count(NAME) == 0 {
        return rates;
    }
    let fixed = fixed(asked.signature, asked.shape.v);
    Box::new(ForcedRates { rates, h: asked.h, push: vec![-0.0; asked.shape.v], fixed })
}

struct ForcedRates {
    rates: Box<dyn Rates>,
    h: f64,
    /// h times the force; −0 on what is fixed, which changes no sum.
    push: Vec<f64>,
    fixed: Vec<bool>,
}

impl ForcedRates {
    /// Takes another force, by rows.
    fn set(&mut self, force: impl Fn(usize) -> f64) {
        for (i, (push, fixed)) in self.push.iter_mut().zip(&self.fixed).enumerate() {
            if !fixed {
                *push = self.h * force(i);
            }
        }
    }

    fn add(&self, dv: &mut [f64]) {
        dv.iter_mut().zip(&self.push).for_each(|(dv, push)| *dv += push);
    }
}

impl Rates for ForcedRates {
    fn inner(&self) -> Option<&dyn Rates> {
        Some(self.rates.as_ref())
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Rates> {
        Some(self.rates.as_mut())
    }

    fn traits(&self) -> RateTraits {
        self.rates.traits()
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        let place = spec.signature.place(NAME).unwrap_or(0);
        self.set(|i| spec.rows[place + i].at(first));
        self.rates.prepare(spec, first, count);
    }

    fn set_force(&mut self, force: &Force, first: usize, _count: usize) {
        self.set(|i| force.row(i)[first]);
    }

    fn dv(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        self.rates.dv(t, v, y, out);
        self.add(out);
    }

    fn both(&mut self, t: f64, v: &[f64], y: &[f64], [dv, dy]: [&mut [f64]; 2]) {
        self.rates.both(t, v, y, [&mut *dv, dy]);
        self.add(dv);
    }
}

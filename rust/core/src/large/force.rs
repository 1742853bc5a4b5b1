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
    let attempts = asked.attempts.then(|| Attempts { force: vec![0.0; asked.shape.v], stretch: !rates.traits().stretched });
    Box::new(ForcedRates { rates, h: asked.h, push: vec![-0.0; asked.shape.v], fixed, attempts })
}

struct ForcedRates {
    rates: Box<dyn Rates>,
    h: f64,
    /// h times the force; −0 on what is fixed, which changes no sum.
    push: Vec<f64>,
    fixed: Vec<bool>,
    attempts: Option<Attempts>,
}

/// The force for attempts at adaptive steps, each of which has another h.
struct Attempts {
    force: Vec<f64>,
    /// Whether the rates of v are still to be multiplied by h.
    stretch: bool,
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
        if self.attempts.as_ref().is_some_and(|attempts| attempts.stretch) {
            dv.iter_mut().for_each(|dv| *dv *= self.h);
        }
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
        let traits = self.rates.traits();
        RateTraits { stretched: traits.stretched || self.attempts.is_some(), ..traits }
    }

    fn set_step(&mut self, step: f64) {
        self.rates.set_step(step);
        self.h = step;
        if let Some(attempts) = &self.attempts {
            for ((push, force), fixed) in self.push.iter_mut().zip(&attempts.force).zip(&self.fixed) {
                if !fixed {
                    *push = step * force;
                }
            }
        }
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        let place = spec.signature.place(NAME).unwrap_or(0);
        match &mut self.attempts {
            Some(attempts) => attempts.force.iter_mut().enumerate().for_each(|(i, to)| *to = spec.rows[place + i].at(first)),
            None => self.set(|i| spec.rows[place + i].at(first)),
        }
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

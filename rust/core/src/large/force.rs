//! A force from outside, added to the rates of one member: the same as [`crate::controls::force`], over rows.

use super::{Asked, Facts, Rates};
use crate::{
    controls::force::{NAME, fixed},
    run::{stage::Force, workers::Stop},
    spec::Spec,
    window::Window,
};

/// Rates under the force that is given, or the rates themselves.
pub fn wrap(rates: Box<dyn Rates>, asked: &Asked) -> Box<dyn Rates> {
    if asked.given.count(NAME) == 0 {
        return rates;
    }
    let fixed = fixed(asked.given, asked.shape.v);
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
    fn facts(&self) -> Facts {
        self.rates.facts()
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        let place = spec.given.place(NAME).unwrap_or(0);
        self.set(|i| spec.rows[place + i].at(first));
        self.rates.prepare(spec, first, count);
    }

    fn set_force(&mut self, force: &Force, first: usize, _count: usize) {
        self.set(|i| force.row(i)[first]);
    }

    fn set_window(&mut self, window: Option<Window<f64>>) {
        self.rates.set_window(window);
    }

    fn set_stop_flag(&mut self, stop: &Stop) {
        self.rates.set_stop_flag(stop);
    }

    fn dv(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        self.rates.dv(t, v, y, out);
        self.add(out);
    }

    fn dy(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        self.rates.dy(t, v, y, out);
    }

    fn both(&mut self, t: f64, v: &[f64], y: &[f64], [dv, dy]: [&mut [f64]; 2]) {
        self.rates.both(t, v, y, [&mut *dv, dy]);
        self.add(dv);
    }

    fn velocity(&mut self, d: &[f64], out: &mut [f64]) {
        self.rates.velocity(d, out);
    }

    fn project(&mut self, v: &mut [f64], y: &mut [f64]) {
        self.rates.project(v, y);
    }

    fn cache_forces(&mut self, y: &[f64]) {
        self.rates.cache_forces(y);
    }

    fn record(&mut self, v: &[f64], y: &[f64], rows: &mut [f64]) {
        self.rates.record(v, y, rows);
    }

    fn energies(&mut self, v: &[f64], y: &[f64], dv: &mut [f64]) -> Option<[f64; 2]> {
        self.rates.energies(v, y, dv)
    }

    fn gradient(&mut self, v: &[f64], dv: &[f64], along: (&mut [f64], &mut [f64])) -> Option<f64> {
        self.rates.gradient(v, dv, along)
    }

    fn tally(&self) -> &[f64] {
        self.rates.tally()
    }

    fn tally_mut(&mut self) -> &mut [f64] {
        self.rates.tally_mut()
    }
}

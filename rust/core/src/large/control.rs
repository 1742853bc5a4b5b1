//! A control or a projection that wraps the rates of one member: the same as [`crate::model::around::controls`], over rows.

use super::rates::{RateTraits, Rates, RatesRequest};
use crate::model::{
    around::controls::{self, energy, projection},
    spec::Spec,
};

/// Rates under the control that is given, or the rates themselves.
pub(crate) fn wrap(rates: Box<dyn Rates>, asked: &RatesRequest) -> Box<dyn Rates> {
    if !controls::is_given(asked.signature) {
        return rates;
    }
    let control = match asked.signature.word("control") {
        "energy" => Control::Push {
            limited: asked.signature.word("control.form") == "limited",
            between: controls::is_after_the_step(asked.signature),
        },
        _ => Control::Projection { nacozy: asked.signature.word("control.way") == "nacozy" },
    };
    let (v, y) = (vec![0.0; asked.shape.v], vec![0.0; asked.shape.y]);
    let step = asked.attempts.then_some(asked.h);
    let (dv, along) = (v.clone(), (v, y));
    Box::new(ControlledRates { rates, control, h: asked.h, step, gain: 0.0, target: 0.0, work: [0.0], dv, along })
}

/// How the energy is kept.
#[derive(Clone, Copy)]
enum Control {
    Push { limited: bool, between: bool },
    Projection { nacozy: bool },
}

struct ControlledRates {
    rates: Box<dyn Rates>,
    control: Control,
    h: f64,
    /// In attempts at adaptive steps, the step of the attempt; rates are scaled to 1.
    step: Option<f64>,
    gain: f64,
    /// h times the energy to keep.
    target: f64,
    /// h times the energy that it added.
    work: [f64; 1],
    dv: Vec<f64>,
    along: (Vec<f64>, Vec<f64>),
}

impl Rates for ControlledRates {
    fn inner(&self) -> Option<&dyn Rates> {
        Some(self.rates.as_ref())
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Rates> {
        Some(self.rates.as_mut())
    }

    fn traits(&self) -> RateTraits {
        let pushes = matches!(self.control, Control::Push { between: false, .. });
        let traits = self.rates.traits();
        RateTraits { reads_v: pushes || traits.reads_v, stretched: pushes && self.step.is_some(), ..traits }
    }

    fn set_step(&mut self, step: f64) {
        self.step = Some(step);
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        let number = |name: &str| spec.signature.place(name).map_or(f64::NAN, |place| spec.rows[place].at(first));
        (self.gain, self.target) = (number("control.gain"), self.h * number("control.target"));
        self.rates.prepare(spec, first, count);
    }

    fn dv(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        let Control::Push { limited, between: false } = self.control else { return self.rates.dv(t, v, y, out) };
        let Some([kinetic, whole]) = self.rates.energies(v, y, out) else { return self.rates.dv(t, v, y, out) };
        let (mut kinetic, mut whole, mut target) = (kinetic, whole, self.target);
        if let Some(step) = self.step {
            (kinetic, whole, target) = (step * kinetic, step * whole, step * target);
            out.iter_mut().for_each(|out| *out *= step);
        }
        let (g, taken) = energy::push(limited, self.gain, whole - target, kinetic);
        self.work[0] -= taken;
        for (out, v) in out.iter_mut().zip(v) {
            *out -= g * v;
        }
    }

    fn project(&mut self, v: &mut [f64], y: &mut [f64]) {
        if let Control::Push { between: false, .. } = self.control {
            return;
        }
        self.rates.cache_forces(y);
        let Some([kinetic, whole]) = self.rates.energies(v, y, &mut self.dv) else { return };
        let off = whole - self.target;
        if let Control::Push { limited, .. } = self.control {
            let (g, taken) = energy::push(limited, self.gain, off, kinetic);
            self.work[0] -= taken;
            v.iter_mut().for_each(|v| *v -= g * *v);
            return;
        }
        if let Control::Projection { nacozy: false } = self.control {
            let (factor, gained) = projection::scaling(off, kinetic);
            self.work[0] += gained;
            v.iter_mut().for_each(|v| *v *= factor);
            return;
        }
        let (along_v, along_y) = (&mut self.along.0[..], &mut self.along.1[..]);
        let Some(square) = self.rates.gradient(v, &self.dv, (along_v, along_y)) else { return };
        let (step, taken) = projection::nacozy(off, self.h, square);
        self.work[0] -= taken;
        for (block, along) in [(v, &self.along.0), (y, &self.along.1)] {
            block.iter_mut().zip(along).for_each(|(number, along)| *number -= step * along);
        }
    }

    fn tally(&self) -> &[f64] {
        &self.work
    }

    fn tally_mut(&mut self) -> &mut [f64] {
        &mut self.work
    }
}

//! The rates of a large linear system ([`crate::model::systems::linear`]).

use std::sync::atomic::AtomicBool;

use super::{
    inputs::Inputs,
    panels::Panels,
    rates::{RateTraits, Rates, RatesRequest},
};
use crate::{
    isa::{Level, Task, with_isa},
    model::{spec::Spec, system::Shape, window::Window},
    stage::Stop,
};

struct Linear {
    shape: Shape,
    level: Level,
    h: f64,
    of_v: Panels,
    of_y: Panels,
    inputs: Inputs,
    /// The inputs.
    x: Vec<f64>,
    /// The time for which the inputs hold: both blocks ask at the same times, and a sine is expensive.
    time: f64,
    window: Option<Window<f64>>,
    /// h·ẏ of v = 1, in a second-order system.
    speed: f64,
    stop: Stop,
}

/// The rates of a linear system.
pub(crate) fn make(asked: &RatesRequest) -> Box<dyn Rates> {
    let nothing = || Panels::new(0, 0, |_, _| 0.0);
    Box::new(Linear {
        shape: asked.shape,
        level: asked.machine.level,
        h: asked.h,
        of_v: nothing(),
        of_y: nothing(),
        inputs: Inputs::default(),
        x: vec![0.0; asked.signature.whole("inputs")],
        time: f64::NAN,
        window: None,
        speed: 0.0,
        stop: Stop::default(),
    })
}

/// Products with the same column, one after the other.
struct Times<'a, const N: usize> {
    products: [(&'a Panels, &'a mut [f64]); N],
    parts: [&'a [f64]; 3],
    stop: &'a AtomicBool,
}

impl<const N: usize> Task for Times<'_, N> {
    #[inline(always)]
    fn run(self) {
        for (panels, out) in self.products {
            panels.times(self.parts, out, self.stop);
        }
    }
}

impl Linear {
    fn update_inputs(&mut self, t: f64) {
        if self.time != t {
            self.inputs.fill(t, self.window, &mut self.x);
            self.time = t;
        }
    }
}

impl Rates for Linear {
    fn traits(&self) -> RateTraits {
        RateTraits { second_order: false, reads_v: true, stretched: false }
    }

    fn prepare(&mut self, spec: &Spec, first: usize, _count: usize) {
        let (h, place) = (self.h, spec.signature.place("rows").unwrap_or(0));
        let columns = self.shape.v + self.shape.y + self.x.len();
        let entry = |i: usize, j: usize| h * spec.rows[place + i * columns + j].at(first);
        self.of_v = Panels::new(self.shape.v, columns, entry);
        self.of_y = Panels::new(self.shape.y, columns, |i, j| entry(self.shape.v + i, j));
        self.speed = if self.shape.y > 0 { entry(self.shape.v, 0) } else { f64::NAN };
        self.inputs = Inputs::new(spec, first);
        self.time = f64::NAN;
    }

    fn set_window(&mut self, window: Option<Window<f64>>) {
        (self.window, self.time) = (window, f64::NAN);
    }

    fn set_stop_flag(&mut self, stop: &Stop) {
        self.stop = Stop::clone(stop);
    }

    fn dv(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        self.update_inputs(t);
        let task = Times { products: [(&self.of_v, out)], parts: [v, y, &self.x], stop: &self.stop };
        with_isa!(self.level, |isa| isa.run(task));
    }

    fn dy(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        self.update_inputs(t);
        let task = Times { products: [(&self.of_y, out)], parts: [v, y, &self.x], stop: &self.stop };
        with_isa!(self.level, |isa| isa.run(task));
    }

    fn both(&mut self, t: f64, v: &[f64], y: &[f64], [dv, dy]: [&mut [f64]; 2]) {
        self.update_inputs(t);
        let task = Times { products: [(&self.of_v, dv), (&self.of_y, dy)], parts: [v, y, &self.x], stop: &self.stop };
        with_isa!(self.level, |isa| isa.run(task));
    }

    fn velocity(&mut self, d: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(d).for_each(|(out, d)| *out = d / self.speed);
    }
}

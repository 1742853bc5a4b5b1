//! Any linear system (§3): ṡ = A·s + B·x(t), with the state s = (v, y) of any size, cut into the two blocks where the user says.
//!
//! An increment is a row of h·A and h·B times the columns v, y and x, summed in this order. Sizes: of v, of y. Options:
//! `acceleration` if ẏ is v times a number and v̇ does not depend on v; then `sine` or `held` for each input. Parameters: A by
//! rows, B by rows (a column for each input), then amplitude, frequency and phase of each sinusoid. Tables: the held inputs.

use crate::{
    error::Error,
    group::{Clock, Group, Spec, Width},
    panels::Panels,
    rows::{self, Large, Rows, lanes, lanes_mut, zeros},
    signal::Input,
    stepper::{Needs, Stepper},
    system::System,
};

/// The linear systems of `L` members, scaled to the step.
pub struct Linear<const L: usize> {
    of_v: Panels<L>,
    of_y: Panels<L>,
    inputs: Vec<Input<L>>,
    x: Rows<L>,
    /// The time for which `x` holds: both blocks ask at the same times, and a sine is dear.
    time: f64,
    /// h·ẏ of v = 1, in a second-order system.
    speed: [f64; L],
}

impl<const L: usize> Linear<L> {
    #[inline(always)]
    fn look(&mut self, t: f64) {
        if self.time != t {
            Input::fill_all(&self.inputs, t, lanes_mut(&mut self.x));
            self.time = t;
        }
    }
}

impl<const L: usize> System for Linear<L> {
    type V = Rows<L>;
    type Y = Rows<L>;

    #[inline(always)]
    fn dv(&mut self, t: f64, v: &Rows<L>, y: &Rows<L>, out: &mut Rows<L>) {
        self.look(t);
        self.of_v.times([lanes(v), lanes(y), lanes(&self.x)], lanes_mut(out));
    }

    #[inline(always)]
    fn dy(&mut self, t: f64, v: &Rows<L>, y: &Rows<L>, out: &mut Rows<L>) {
        self.look(t);
        self.of_y.times([lanes(v), lanes(y), lanes(&self.x)], lanes_mut(out));
    }

    #[inline(always)]
    fn velocity(&mut self, d: &Rows<L>, out: &mut Rows<L>) {
        for (out, d) in lanes_mut(out).iter_mut().zip(lanes(d)) {
            let mut row = [0.0; L];
            for l in 0..L {
                row[l] = d[l] / self.speed[l];
            }
            *out = row;
        }
    }
}

impl<const L: usize> Large<L> for Linear<L> {
    fn shape(spec: &Spec) -> (usize, usize) {
        (spec.size(0), spec.size(1))
    }

    fn prepare(spec: &Spec, clock: &Clock, member: impl Fn(usize) -> usize) -> Self {
        let h = clock.h;
        let (n_v, n_y) = Self::shape(spec);
        let (n, m) = (n_v + n_y, inputs(spec).len());
        let scaled = |place: usize| std::array::from_fn(|l| h * spec.at(place, member(l)));
        let entry = |i: usize, j: usize| scaled(if j < n { i * n + j } else { n * n + i * m + (j - n) });
        Linear {
            of_v: Panels::new(n_v, n + m, entry),
            of_y: Panels::new(n_y, n + m, |i, j| entry(n_v + i, j)),
            inputs: Input::all(spec, n * (n + m), &member),
            x: zeros(m),
            time: f64::NAN,
            speed: entry(n_v, 0),
        }
    }
}

/// The options that name inputs.
fn inputs<'a>(spec: &'a Spec) -> &'a [&'a str] {
    match spec.options.as_slice() {
        ["acceleration", inputs @ ..] | inputs => inputs,
    }
}

/// A group of linear systems.
pub fn group<St: Stepper>(spec: &Spec, clock: &Clock, width: Width) -> Result<Box<dyn Group>, Error> {
    let inputs = inputs(spec);
    let held = inputs.iter().filter(|kind| **kind == "held").count();
    let sines = inputs.iter().filter(|kind| **kind == "sine").count();
    let known = held + sines == inputs.len() && held == spec.tables.len();
    let (&[n_v, n_y], true) = (spec.sizes.as_slice(), known) else { return Err(spec.unknown_options()) };
    let n = n_v + n_y;
    if n == 0 {
        return Err(spec.unknown_options());
    }
    let got = spec.rows.len();
    let expected = n * (n + inputs.len()) + 3 * sines;
    if got != expected {
        return Err(Error::Shape { what: "parameters", expected, got });
    }
    if St::RECORD.needs == Needs::Acceleration && inputs.len() == spec.options.len() {
        let term = "rates of another kind";
        return Err(Error::VelocityDependent { method: St::RECORD.name, system: "linear", term });
    }
    Ok(rows::group::<Linear<{ rows::LANES }>, Linear<1>, St>(spec, clock, width))
}

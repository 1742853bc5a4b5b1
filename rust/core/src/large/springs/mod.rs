//! The rates of a large net of springs ([`crate::model::systems::springs`]): springs, then particles, each as vectors.

mod kernel;
mod order;

use self::{
    kernel::{Forces, Rows},
    order::{MARGIN, Order, SIDE},
};
use super::rates::{RateTraits, Rates, RatesRequest};
use crate::{
    aligned::Aligned,
    isa::{Level, with_isa},
    model::{
        spec::{Parameters, Spec},
        systems::springs::{self, net},
    },
};

struct Springs {
    level: Level,
    h: f64,
    n: usize,
    dim: usize,
    order: Order,
    rows: Rows,
    fixed: Vec<usize>,
    reads_v: bool,
    record: Vec<String>,
    /// The numbers of the member, for what is not a rate.
    net: Option<springs::Springs<f64>>,
}

/// The rates of a net.
pub(crate) fn make(asked: &RatesRequest) -> Box<dyn Rates> {
    let signature = asked.signature;
    let (n, dim) = (signature.whole("n"), signature.whole("dim"));
    let mut is_fixed = vec![false; n];
    signature.list("fixed").iter().for_each(|particle| is_fixed[*particle as usize] = true);
    let order = Order::new(n, signature.list("pairs"), &is_fixed);
    let (particles, springs) = (n.next_multiple_of(SIDE), order.springs.len());
    let (has_damping, has_drag) = (signature.has("damping"), signature.has("drag"));
    let room = |there: bool, numbers: usize| Aligned::new(if there { numbers } else { 0 });
    let rows = Rows {
        particles,
        springs: springs + 2 * MARGIN,
        y: Aligned::new(dim * particles),
        v: room(has_damping, dim * particles),
        stiffness: Aligned::new(springs),
        held: Aligned::new(springs),
        damping: room(has_damping, springs),
        forces: Aligned::new(dim * (springs + 2 * MARGIN)),
        by_mass: Aligned::new(particles),
        slowing: room(has_drag, particles),
        fall: Vec::new(),
    };
    let fixed = (0..n).filter(|i| is_fixed[*i]).collect();
    let record = asked.record.to_vec();
    let reads_v = has_damping || has_drag;
    Box::new(Springs { level: asked.machine.level, h: asked.h, n, dim, order, rows, fixed, reads_v, record, net: None })
}

impl Springs {
    fn forces<const D: usize>(&mut self, v: &[f64], y: &[f64], out: &mut [f64]) {
        let Springs { order, rows, .. } = self;
        if rows.damping.is_empty() {
            with_isa!(self.level, |isa| isa.run(Forces::<D, false> { order, rows, v, y, out }));
        } else {
            with_isa!(self.level, |isa| isa.run(Forces::<D, true> { order, rows, v, y, out }));
        }
        for i in &self.fixed {
            out[D * i..][..D].fill(-0.0);
        }
    }
}

impl Rates for Springs {
    fn traits(&self) -> RateTraits {
        RateTraits { second_order: true, reads_v: self.reads_v, stretched: false }
    }

    fn prepare(&mut self, spec: &Spec, first: usize, _count: usize) {
        let numbers = spec.rows.iter().map(|row| row.at(first)).collect();
        let net = net(&Parameters { signature: &spec.signature, h: self.h, numbers, sample: |_, _| f64::NAN });
        let Springs { order, rows, n, .. } = self;
        for (at, spring) in order.springs.iter().enumerate() {
            let [stiffness, held, damping] = net.spring(*spring as usize);
            (rows.stiffness[at], rows.held[at]) = (stiffness, held);
            if let Some(row) = rows.damping.get_mut(at) {
                *row = damping;
            }
        }
        for i in 0..*n {
            rows.by_mass[i] = net.by_mass(i);
            if let Some(slowing) = net.slowing(i) {
                rows.slowing[i] = slowing;
            }
        }
        rows.fall = net.fall().to_vec();
        self.net = Some(net);
    }

    fn dv(&mut self, _t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        match self.dim {
            1 => self.forces::<1>(v, y, out),
            2 => self.forces::<2>(v, y, out),
            _ => self.forces::<3>(v, y, out),
        }
    }

    fn energies(&mut self, v: &[f64], y: &[f64], dv: &mut [f64]) -> Option<[f64; 2]> {
        self.dv(0.0, v, y, dv);
        self.net.as_ref().map(|net| net.kinetic_and_whole(v, y))
    }

    fn gradient(&mut self, v: &[f64], dv: &[f64], (of_v, of_y): (&mut [f64], &mut [f64])) -> Option<f64> {
        self.net.as_ref().map(|net| net.along(v, dv, [of_v, of_y]))
    }

    fn record(&mut self, v: &[f64], y: &[f64], rows: &mut [f64]) {
        let Some(net) = &self.net else { return };
        let made = self.record.iter().filter_map(|name| net.quantity(name, v, y)).flatten();
        rows.iter_mut().zip(made).for_each(|(row, number)| *row = number);
    }
}

//! Many bodies ([`crate::model::systems::nbody`]), eight of them side by side, the forces on as many threads as there are.

mod order;
mod quantities;
mod share;

use std::sync::atomic::Ordering::Relaxed;

use stepwell_base::{
    bodies::{Law, Rounding, partners},
    forces::{Distances, Kernel, Meeting, Round, Sums},
    massless::Pulled,
};

use self::{
    order::Order,
    quantities::{Quantity, Record, kinetic, total},
    share::{Share, add, share, share_massless},
};
use super::rates::{RateTraits, Rates, RatesRequest};
use crate::{
    model::{spec::Spec, systems::nbody},
    stage::Stop,
};

/// From this many massive bodies on, threads are worthwhile. They are started anew for each force, which takes some hundredths
/// of a millisecond.
const MIN_BODIES_FOR_THREADS: usize = 1024;

/// The bodies of one member, scaled to the step.
struct Bodies {
    /// How many have mass.
    n: usize,
    order: Order,
    kernel: Kernel,
    h: f64,
    slabs: Vec<Vec<Distances>>,
    mass: Vec<f64>,
    /// Per massive body: m, ½·h·m and h·G·m.
    own: Vec<f64>,
    half: Vec<f64>,
    strength: Vec<f64>,
    /// h times the potential of each body with mass, if the forces were found with it.
    potential: Vec<f64>,
    /// The bodies with mass along the lanes.
    round: Round,
    /// Threads that share the bodies without mass.
    threads: usize,
    /// Whether forces take so long that they are kept.
    long: bool,
    /// Sums of forces and potentials, once for each thread.
    sums: Vec<Sums>,
    /// One for each slab, if there are several threads.
    shares: Vec<Share>,
    record: Vec<Quantity>,
    stop: Stop,
    /// Whether `dv` are the forces at `y`. They are kept for a state that is projected or recorded, since the next step begins
    /// with them; for many bodies always, so that a run that is stopped within a step has the forces at the end of the step
    /// before.
    has_forces: bool,
    /// Whether `potential` is that at `y`, too.
    has_potentials: bool,
    y: Vec<f64>,
    dv: Vec<f64>,
}

/// The rates of many bodies.
pub(crate) fn make(asked: &RatesRequest) -> Box<dyn Rates> {
    let (order, dim, machine) = (Order::of(asked.signature), asked.signature.whole("dim"), asked.machine);
    let (n, all) = (order.massive(), asked.signature.count("masses"));
    let law = nbody::law(asked.signature).unwrap_or(Law::Logarithmic);
    let ends = |group: Vec<usize>| Some((*group.first()?, *group.last()?));
    let slabs: Vec<Vec<Distances>> = partners(n).into_iter().map(|slab| slab.into_iter().filter_map(ends).collect()).collect();
    let round = Round::new(n, dim);
    let threads = if n < MIN_BODIES_FOR_THREADS { 1 } else { machine.threads_for(slabs.len(), true) };
    let pulls = 2 * n * order.massless().len();
    let enough = MIN_BODIES_FOR_THREADS * MIN_BODIES_FOR_THREADS;
    let shares = if threads > 1 { slabs.iter().map(|_| Share::new(n, dim)).collect() } else { Vec::new() };
    Box::new(Bodies {
        n,
        kernel: Kernel { law, rounding: nbody::rounding(asked.signature), dim, level: machine.level },
        h: asked.h,
        mass: vec![0.0; all],
        own: vec![0.0; n],
        half: vec![0.0; n],
        strength: vec![0.0; n],
        potential: vec![0.0; n],
        sums: (0..threads).map(|_| Sums::new(&round)).collect(),
        round,
        threads: if pulls < enough { 1 } else { machine.threads_for(order.massless().len(), true) },
        long: n * n + pulls >= enough,
        order,
        shares,
        slabs,
        record: asked.record.iter().filter_map(|name| Quantity::named(name)).collect(),
        stop: Stop::default(),
        has_forces: false,
        has_potentials: false,
        y: Vec::new(),
        dv: Vec::new(),
    })
}

impl Bodies {
    fn meet(&mut self, kernel: Kernel, energy: bool, y: &[f64], out: &mut [f64]) {
        let out = &mut out[..y.len()];
        if self.order.massless().is_empty() {
            return self.among(kernel, energy, y, out);
        }
        let (dim, mut order) = (kernel.dim, std::mem::take(&mut self.order));
        order.take_places(dim, y);
        let (places, pushes) = order.places_and_pushes();
        if self.n > 0 {
            self.among(kernel, energy, places, pushes);
        }
        let (strengths, soft, stop, places) = (&self.strength[..], self.round.soft, &*self.stop, order.places());
        share_massless(self.threads, order.massless(), dim, out, |bodies, out, first| {
            Pulled { bodies, y, places, strengths, soft, stop, out, first }.by(kernel);
        });
        order.spread_pushes(dim, out);
        self.order = order;
    }

    /// The forces of bodies with mass on each other.
    fn among(&mut self, kernel: Kernel, energy: bool, y: &[f64], out: &mut [f64]) {
        match kernel.dim {
            2 => self.round.fill::<2>(y),
            _ => self.round.fill::<3>(y),
        }
        let (n, round, stop, potential) = (self.n, &self.round, &*self.stop, &mut self.potential[..]);
        if let [sums] = &mut self.sums[..] {
            for (i, groups) in self.slabs.iter().enumerate() {
                kernel.meet(energy, Meeting { n, groups, round, sums, more: i > 0, stop, potential, out });
            }
            return;
        }
        share(&self.slabs, &mut self.shares, &mut self.sums, |groups, share, sums| {
            let (potential, out) = (&mut share.potential[..], &mut share.force[..]);
            kernel.meet(energy, Meeting { n, groups, round, sums, more: false, stop, potential, out });
        });
        // Slab after slab, whichever was ready first.
        for (i, share) in self.shares.iter().enumerate() {
            add(out, &share.force, i > 0);
            if energy {
                add(potential, &share.potential, i > 0);
            }
        }
    }

    /// Whether the forces at these coordinates, and the potentials if needed, are known.
    fn has(&self, energy: bool, y: &[f64]) -> bool {
        self.has_forces && (self.has_potentials || !energy) && y.iter().zip(&self.y).all(|(a, b)| a.to_bits() == b.to_bits())
    }

    /// Computes the forces, unless they are known.
    fn find(&mut self, energy: bool, y: &[f64], out: &mut [f64]) {
        if self.has(energy, y) {
            out[..y.len()].copy_from_slice(&self.dv);
            return;
        }
        self.has_potentials &= !energy;
        self.meet(self.kernel, energy, y, out);
        if self.long && !self.stop.load(Relaxed) {
            self.dv.clear();
            self.dv.extend_from_slice(&out[..y.len()]);
            self.keep(energy, y);
        }
    }

    /// `dv` are the forces at these places.
    fn keep(&mut self, energy: bool, y: &[f64]) {
        self.y.clear();
        self.y.extend_from_slice(y);
        (self.has_forces, self.has_potentials) = (true, energy);
    }

    fn gradient_in<const D: usize>(&mut self, v: &[f64], dv: &[f64], along_v: &mut [f64], along_y: &mut [f64]) -> f64 {
        for (r, (v, dv)) in v.iter().zip(dv).enumerate() {
            let mass = self.mass[r / D];
            along_v[r] = mass * v;
            along_y[r] = -(mass * (dv / self.h));
        }
        let [v, y] = self.order.massive_of(D, [along_v, along_y]);
        let ((v, _), (y, _)) = (v.as_chunks::<D>(), y.as_chunks::<D>());
        total(v, y, |_, v, y| quantities::square(v) + quantities::square(y))
    }
}

impl Rates for Bodies {
    fn traits(&self) -> RateTraits {
        RateTraits { second_order: true, reads_v: false, stretched: false }
    }

    fn prepare(&mut self, spec: &Spec, first: usize, _count: usize) {
        let row = |name: &str, i: usize| spec.signature.place(name).map_or(f64::NAN, |place| spec.rows[place + i].at(first));
        let softening = row("softening", 0);
        self.mass.iter_mut().enumerate().for_each(|(i, mass)| *mass = row("masses", i));
        for k in 0..self.n {
            let i = self.order.number(k);
            self.own[k] = self.mass[i];
            self.half[k] = (0.5 * self.h) * self.mass[i];
            self.strength[k] = self.h * row("strength", i);
        }
        self.round.take(self.n, |k| self.strength[k], softening * softening);
        (self.has_forces, self.has_potentials) = (false, false);
    }

    fn set_stop_flag(&mut self, stop: &Stop) {
        self.stop = Stop::clone(stop);
    }

    fn dv(&mut self, _t: f64, _v: &[f64], y: &[f64], out: &mut [f64]) {
        self.find(false, y, out);
    }

    fn cache_forces(&mut self, y: &[f64]) {
        if self.kernel.rounding == Rounding::Twice && !self.has(true, y) {
            let mut dv = std::mem::take(&mut self.dv);
            dv.resize(y.len(), 0.0);
            (self.has_forces, self.has_potentials) = (false, false);
            self.meet(self.kernel, true, y, &mut dv);
            self.dv = dv;
            if !self.stop.load(Relaxed) {
                self.keep(true, y);
            }
        }
    }

    fn energies(&mut self, v: &[f64], y: &[f64], dv: &mut [f64]) -> Option<[f64; 2]> {
        self.find(true, y, dv);
        let [v] = self.order.massive_of(self.kernel.dim, [v]);
        let kinetic = kinetic(self.kernel.dim, &self.half, v);
        Some([kinetic, kinetic + total(&self.own, &self.potential, |_, mass, potential| mass * potential)])
    }

    fn gradient(&mut self, v: &[f64], dv: &[f64], (along_v, along_y): (&mut [f64], &mut [f64])) -> Option<f64> {
        Some(match self.kernel.dim {
            2 => self.gradient_in::<2>(v, dv, along_v, along_y),
            _ => self.gradient_in::<3>(v, dv, along_v, along_y),
        })
    }

    fn record(&mut self, v: &[f64], y: &[f64], rows: &mut [f64]) {
        if self.kernel.rounding == Rounding::Once && self.record.contains(&Quantity::Energy) {
            // What is recorded is not fused, so the pass over the pairs is one of its own.
            self.has_potentials = false;
            self.meet(Kernel { rounding: Rounding::Twice, ..self.kernel }, true, y, &mut vec![0.0; y.len()]);
        }
        let (level, h, what, mass, half, potential) =
            (self.kernel.level, self.h, &self.record[..], &self.own[..], &self.half[..], &self.potential[..]);
        let [v, y] = self.order.all_of(self.kernel.dim, [v, y]);
        let record = Record { level, h, what, mass, half, potential, v, y, rows };
        match self.kernel.dim {
            2 => record.fill::<2>(),
            _ => record.fill::<3>(),
        }
    }
}

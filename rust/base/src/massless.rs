//! The forces on bodies without mass: several of them side by side, a lane each, which are pulled by one body after the other.

#![allow(clippy::needless_range_loop, reason = "loops over lanes are written as the instructions that they become")]

use std::{
    marker::PhantomData,
    sync::atomic::{AtomicBool, Ordering::Relaxed},
};

use crate::{
    bodies::{LANES as SIDE, Law, Rounding},
    forces::{Kernel, LOGARITHMIC, NEWTON, fuse, pulls, softened},
    isa::{Isa, Level, Task, with_isa},
};

/// Bodies between two checks of the stop flag.
const STOPPED_AFTER: usize = 128 * SIDE;

/// A share of the bodies without mass, and the bodies that attract them.
pub struct Pulled<'a> {
    /// The numbers of the massless bodies, in ascending order.
    pub bodies: &'a [u32],
    /// The places of all bodies, one after the other.
    pub y: &'a [f64],
    /// The places of the bodies that pull, likewise.
    pub places: &'a [f64],
    /// h·G·m of those.
    pub strengths: &'a [f64],
    /// ε²
    pub soft: f64,
    /// When set, the kernel returns early.
    pub stop: &'a AtomicBool,
    /// h times the acceleration of the bodies from number `first` on; only those of bodies without mass are set.
    pub out: &'a mut [f64],
    /// The number of the first body of `out`.
    pub first: usize,
}

impl Pulled<'_> {
    /// Computes the forces.
    pub fn by(self, Kernel { law, rounding, dim, level }: Kernel) {
        match (dim, law) {
            (2, Law::Newton) => self.rounded::<2, NEWTON>(rounding, level),
            (2, _) => self.rounded::<2, LOGARITHMIC>(rounding, level),
            (_, Law::Newton) => self.rounded::<3, NEWTON>(rounding, level),
            (_, _) => self.rounded::<3, LOGARITHMIC>(rounding, level),
        }
    }

    fn rounded<const D: usize, const LAW: u8>(self, rounding: Rounding, level: Level) {
        match rounding {
            Rounding::Twice => with_isa!(level, |isa| isa.run(Of::<_, D, LAW, false>::on(isa, self))),
            Rounding::Once => with_isa!(level.of_loops(), |isa| isa.run(Of::<_, D, LAW, true>::on(isa, self))), // as of forces
        }
    }
}

struct Of<'a, I, const D: usize, const LAW: u8, const FUSED: bool>(PhantomData<I>, Pulled<'a>);

impl<'a, I: Isa, const D: usize, const LAW: u8, const FUSED: bool> Of<'a, I, D, LAW, FUSED> {
    fn on(_: I, pulled: Pulled<'a>) -> Self {
        Of(PhantomData, pulled)
    }
}

impl<I: Isa, const D: usize, const LAW: u8, const FUSED: bool> Task for Of<'_, I, D, LAW, FUSED> {
    #[inline(always)]
    fn run(self) {
        let Pulled { bodies, y, places, strengths, soft, stop, out, first } = self.1;
        let ((y, _), (places, _), (out, _)) = (y.as_chunks::<D>(), places.as_chunks::<D>(), out.as_chunks_mut::<D>());
        for some in bodies.chunks(STOPPED_AFTER) {
            if stop.load(Relaxed) {
                return;
            }
            for chunk in some.chunks(SIDE) {
                let mut place = [[0.0; SIDE]; D];
                for l in 0..SIDE {
                    let body = &y[chunk[l.min(chunk.len() - 1)] as usize]; // what fills the last chunk is as the last body
                    for c in 0..D {
                        place[c][l] = body[c];
                    }
                }
                let mut sums = [[-0.0; SIDE]; D];
                for (from, strength) in places.iter().zip(strengths) {
                    let mut d = [[0.0; SIDE]; D];
                    for c in 0..D {
                        for l in 0..SIDE {
                            d[c][l] = from[c] - place[c][l];
                        }
                    }
                    let r2 = softened::<I, D, FUSED>(&d, soft);
                    let mut pull = pulls::<I, LAW, FUSED>(&r2);
                    for l in 0..SIDE {
                        pull[l] *= strength;
                    }
                    for c in 0..D {
                        if FUSED {
                            fuse::<I>(&mut sums[c], &d[c], &pull, None);
                            continue;
                        }
                        for l in 0..SIDE {
                            sums[c][l] += d[c][l] * pull[l];
                        }
                    }
                }
                for (l, body) in chunk.iter().enumerate() {
                    let to = &mut out[*body as usize - first];
                    for c in 0..D {
                        to[c] = sums[c][l];
                    }
                }
            }
        }
    }
}

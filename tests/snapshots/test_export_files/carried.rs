// carried: one step by Verlet.
//
// System:  Oscillator(omega=1.0, x=Sampled(3 values, interval=0.4, start=0.0), form='canonical')
// Method:  Verlet (verlet), order 2, 1 rate evaluation per step
// Stable:  undamped oscillators for omega*dt < 2
// Source:  L. Verlet, Computer experiments on classical fluids, Phys. Rev. 159 (1967) 98
// State:   y_prev[1]; y[1]
// Time:    t0 + k*dt at step k, which the state counts
// Written by stepwell VERSION. The numbers are those of stepwell.integrate, to the last bit.
//
// Needs no other crate.
// let mut m = Carried::new() sets the parameters; change any of them and call m.prepare().
// let mut s = m.start(velocities, coordinates) is the state at step 0, m.step(&mut s) makes one step.
// m.finish(&s) finds the velocities; in the state y_prev stands in their place.
//
// Example:
//
//     mod carried;
//     use carried::Carried;
//
//     fn main() {
//         let v = [0.5];
//         let y = [1.0];
//         let m = Carried::new();
//         let mut s = m.start(v, y);
//         for _ in 0..1000 {
//             m.step(&mut s);
//         }
//         println!("{:?}", s.y[0]);
//     }

/// The sample that holds at a time: the last that is not after it; before all the first.
fn sample(samples: &[f64], start: f64, interval: f64, t: f64) -> f64 {
    let i = ((t - start) / interval * 1.0000000000000568).floor(); // t may miss a sample's time by rounding
    let last = samples.len() - 1;
    if i > 0.0 { samples[(i as usize).min(last)] } else { samples[0] }
}

/// The samples of x.
static X_SAMPLES: [f64; 3] = [1.0, 2.0, 3.0];

/// The samples of x.times.
static X_TIMES_SAMPLES: [f64; 3] = [0.0, 1.0, 2.0];

/// The description of a step.
#[allow(dead_code)]
#[derive(Clone, Debug)]
pub struct Carried {
    /// the step.
    pub dt: f64,
    /// the time of step 0.
    pub t0: f64,
    pub omega: f64,
    /// x: the time of the first sample.
    pub x_start: f64,
    /// x: the time to the next sample.
    pub x_interval: f64,

    // Made of these by `prepare`.
    phi: f64,
    c1: f64,
    c2: f64,
    c3: f64,
    c4: f64,
    c5: f64,
    c6: f64,
    c7: f64,
    c8: f64,
}

/// A state.
#[allow(dead_code)]
#[derive(Clone, Debug)]
pub struct CarriedState {
    pub y_prev: [f64; 1],
    pub y: [f64; 1],
    /// k; the time is t0 + k*dt.
    pub step: u64,
}

#[allow(clippy::all, dead_code)]
impl Carried {
    /// With the parameters with which it was exported.
    pub fn new() -> Self {
        let mut m = Self {
            dt: 0.01,
            t0: 0.0,
            omega: 1.0,
            x_start: 0.0,
            x_interval: 0.4,
            phi: 0.0,
            c1: 0.0,
            c2: 0.0,
            c3: 0.0,
            c4: 0.0,
            c5: 0.0,
            c6: 0.0,
            c7: 0.0,
            c8: 0.0,
        };
        m.prepare();
        m
    }

    /// What does not change from step to step. To be called after a change of a parameter.
    pub fn prepare(&mut self) {
        self.phi = self.dt * self.omega;
        self.c1 = 0.0 * self.phi;
        self.c2 = if self.dt < 0.0 { self.dt } else { 0.0 };
        self.c3 = self.dt - self.c2 - self.c2;
        self.c4 = 0.5 * self.c3;
        self.c5 = 0.5 * self.dt;
        self.c6 = if self.c5 < 0.0 { self.c5 } else { 0.0 };
        self.c7 = self.c5 - self.c6;
        self.c8 = self.c7 - self.c6;
    }

    /// The state at step 0, of velocities and coordinates.
    pub fn start(&self, velocities: [f64; 1], coordinates: [f64; 1]) -> CarriedState {
        let mut s = CarriedState { y_prev: [0.0; 1], y: coordinates, step: 0 };
        let t = self.t0 + s.step as f64 * self.dt;

        // The state.
        let v = velocities[0];
        let y = coordinates[0];

        // What depends on the time alone.
        let s1 = t - self.c6;
        let s2 = sample(&X_SAMPLES, self.x_start, self.x_interval, t - self.c7);
        let s3 = self.x_start + self.x_interval * sample(&X_TIMES_SAMPLES, self.x_start, self.x_interval, s1);
        let s4 = (s1 - s3) / self.c8;
        let s5 = if 0.0 < s4 { s4 } else { 0.0 };
        let s6 = sample(&X_SAMPLES, self.x_start, self.x_interval, s1) - s2;
        let s7 = self.phi * (s2 + (if s5 < 1.0 { s5 } else { 1.0 }) * s6);

        // What depends on the state.
        let next_y_prev = y - self.phi * v + 0.5 * (self.phi * (-self.phi * y - self.c1 * v + s7));

        // The carry, in place of v.
        s.y_prev[0] = next_y_prev;
        s
    }

    /// One step.
    pub fn step(&self, s: &mut CarriedState) {
        let t = self.t0 + s.step as f64 * self.dt;

        // The state.
        let y_prev = s.y_prev[0];
        let y = s.y[0];

        // What depends on the time alone.
        let s1 = t + self.c4;
        let s2 = sample(&X_SAMPLES, self.x_start, self.x_interval, t - self.c4);
        let s3 = self.x_start + self.x_interval * sample(&X_TIMES_SAMPLES, self.x_start, self.x_interval, s1);
        let s4 = (s1 - s3) / self.c3;
        let s5 = if 0.0 < s4 { s4 } else { 0.0 };
        let s6 = sample(&X_SAMPLES, self.x_start, self.x_interval, s1) - s2;
        let s7 = self.phi * (s2 + (if s5 < 1.0 { s5 } else { 1.0 }) * s6);

        // What depends on the state.
        let dv1 = -self.phi * y - self.c1 * y_prev + s7;
        let next_y = 2.0 * y - y_prev + self.phi * dv1;
        let next_y_prev = y;

        // The state after the step.
        s.y_prev[0] = next_y_prev;
        s.y[0] = next_y;
        s.step += 1;
    }

    /// The velocities at a state.
    pub fn finish(&self, s: &CarriedState) -> [f64; 1] {
        let mut velocities = [0.0; 1];
        let t = self.t0 + s.step as f64 * self.dt;

        // The state.
        let y_prev = s.y_prev[0];
        let y = s.y[0];

        // What depends on the time alone.
        let s1 = t - self.c6;
        let s2 = sample(&X_SAMPLES, self.x_start, self.x_interval, t - self.c7);
        let s3 = self.x_start + self.x_interval * sample(&X_TIMES_SAMPLES, self.x_start, self.x_interval, s1);
        let s4 = (s1 - s3) / self.c8;
        let s5 = if 0.0 < s4 { s4 } else { 0.0 };
        let s6 = sample(&X_SAMPLES, self.x_start, self.x_interval, s1) - s2;
        let s7 = self.phi * (s2 + (if s5 < 1.0 { s5 } else { 1.0 }) * s6);

        // What depends on the state.
        let next_v = (y - y_prev) / self.phi + 0.5 * (-self.phi * y - self.c1 * y_prev + s7);

        // The velocities.
        velocities[0] = next_v;
        velocities
    }
}

impl Default for Carried {
    fn default() -> Self {
        Self::new()
    }
}

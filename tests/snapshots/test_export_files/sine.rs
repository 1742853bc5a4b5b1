// sine: one step by Damped Euler.
//
// System:  Pendulum(omega=2.0, damping=0.1)
// Method:  Damped Euler (damped_euler), order 1, 1 rate evaluation per step
// Stable:  undamped oscillators for omega*dt < 2
// Source:  G. Hoffmann, Simple Integration Algorithms, 2002, §6
// State:   v[1]; y[1]
// Time:    t0 + k*dt at step k, which the state counts
// Written by stepwell VERSION. The numbers are those of stepwell.integrate, to the last bit.
//
// Needs no other crate.
// let mut m = Sine::new() sets the parameters; change any of them and call m.prepare().
// let mut s = m.start(velocities, coordinates) is the state at step 0, m.step(&mut s) makes one step.
//
// Example:
//
//     mod sine;
//     use sine::Sine;
//
//     fn main() {
//         let v = [0.0];
//         let y = [1.0];
//         let m = Sine::new();
//         let mut s = m.start(v, y);
//         for _ in 0..1000 {
//             m.step(&mut s);
//         }
//         println!("{:?}", s.y[0]);
//     }

/// `x`, its sign turned if the last bit of `y` is set.
#[inline(always)]
fn turn_sign(x: f64, y: f64) -> f64 {
    f64::from_bits(x.to_bits() ^ (y.to_bits() << 63))
}

/// The sine of `x`.
#[allow(clippy::all)]
fn sine(x: f64) -> f64 {
    let a1 = 0.3183098861837907 * x + 6755399441055744.0;
    let a2 = a1 - 6755399441055744.0;
    let a3 = x - 3.1415926534682512 * a2 - 1.2154201013012384e-10 * a2;
    let a4 = a3 * a3;
    let a5 = a4 * a4;
    let a6 = a5 * (a5 * (2.7205082501769597e-15 * a5 + 1.6058937294753282e-10) + 2.75573192107121e-06);
    let a7 = a4 * (a5 * (-7.64292781535996e-13 * a5 - 2.505210682744121e-08) - 0.00019841269841207676);
    return turn_sign(a3 + a3 * a4 * (a4 * (a6 + 0.008333333333333196 + a7) - 0.16666666666666666), a1);
}

/// The description of a step.
#[allow(dead_code)]
#[derive(Clone, Debug)]
pub struct Sine {
    /// the step.
    pub dt: f64,
    /// the time of step 0.
    pub t0: f64,
    pub omega: f64,
    pub damping: f64,

    // Made of these by `prepare`.
    c1: f64,
    phi: f64,
    c2: f64,
}

/// A state.
#[allow(dead_code)]
#[derive(Clone, Debug)]
pub struct SineState {
    pub v: [f64; 1],
    pub y: [f64; 1],
    /// k; the time is t0 + k*dt.
    pub step: u64,
}

#[allow(clippy::all, dead_code)]
impl Sine {
    /// With the parameters with which it was exported.
    pub fn new() -> Self {
        let mut m = Self {
            dt: 0.01,
            t0: 1.5,
            omega: 2.0,
            damping: 0.1,
            c1: 0.0,
            phi: 0.0,
            c2: 0.0,
        };
        m.prepare();
        m
    }

    /// What does not change from step to step. To be called after a change of a parameter.
    pub fn prepare(&mut self) {
        self.c1 = self.omega * self.omega * self.dt;
        self.phi = self.dt * self.omega;
        self.c2 = 2.0 * self.damping * self.phi;
    }

    /// The state at step 0, of velocities and coordinates.
    pub fn start(&self, velocities: [f64; 1], coordinates: [f64; 1]) -> SineState {
        SineState { v: velocities, y: coordinates, step: 0 }
    }

    /// One step.
    pub fn step(&self, s: &mut SineState) {
        // The state.
        let v = s.v[0];
        let y = s.y[0];

        // What depends on the state.
        let next_y = y + self.dt * v;
        let dv1 = -self.c1 * sine(next_y) - self.c2 * v;
        let next_v = v + dv1;

        // The state after the step.
        s.v[0] = next_v;
        s.y[0] = next_y;
        s.step += 1;
    }
}

impl Default for Sine {
    fn default() -> Self {
        Self::new()
    }
}

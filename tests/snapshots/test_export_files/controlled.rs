// controlled: one step by False Euler.
//
// System:  NBody(masses=[1.0, 2.0], force='logarithmic', G=1.0, EnergyControl(gain=0.3, form='limited'))
// Method:  False Euler (false_euler), order 1, 1 rate evaluation per step
// Stable:  undamped oscillators for omega*dt < 2
// Source:  A. Cromer, Stable solutions using the Euler approximation, Am. J. Phys. 49 (1981) 455
// State:   v[4], number i, j of the block of shape (2, 2) at v[2*i + j]; y[4], number i, j of the block of shape (2, 2) at y[2*i + j]
// Time:    t0 + k*dt at step k, which the state counts
// Written by stepwell VERSION. The numbers are those of stepwell.integrate(..., dtype="float32"), to the last bit.
//
// Needs no other crate.
// let mut m = Controlled::new() sets the parameters; change any of them and call m.prepare().
// let mut s = m.start(velocities, coordinates) is the state at step 0, m.step(&mut s, &force) makes one step.
// m.work(&s) is the energy that the control has given since the start.
//
// Example:
//
//     mod controlled;
//     use controlled::Controlled;
//
//     fn main() {
//         let v = [1.0, 0.0, 0.0, 1.0];
//         let y = [1.0, 0.0, -0.5, 0.0];
//         let force = [0.0, 0.0, 0.0, 0.0];
//         let m = Controlled::new();
//         let mut s = m.start(v, y);
//         for _ in 0..1000 {
//             m.step(&mut s, &force);
//         }
//         println!("{:?}", s.y[0]);
//     }

#[inline(always)]
fn bits_of(x: f32) -> u32 {
    x.to_bits()
}

#[inline(always)]
fn number_of(b: u32) -> f32 {
    f32::from_bits(b)
}

#[inline(always)]
fn and_bits(a: u32, b: u32) -> u32 {
    a & b
}

#[inline(always)]
fn or_bits(a: u32, b: u32) -> u32 {
    a | b
}

#[inline(always)]
fn add_bits(a: u32, b: u32) -> u32 {
    a.wrapping_add(b)
}

#[inline(always)]
fn shift_down(a: u32, n: u32) -> u32 {
    a >> n
}

/// The logarithm of `x`.
#[allow(clippy::all)]
fn logarithm(x: f32) -> f32 {
    let a1 = add_bits(bits_of(x), 0x4afc00u32);
    let a2 = number_of(or_bits(shift_down(a1, 23), 0x4b000000u32)) - 8388735.0;
    let a3 = number_of(add_bits(and_bits(a1, 0x7fffffu32), 0x3f350400u32)) - 1.0;
    let a4 = a3 / (a3 + 2.0);
    let a5 = a4 * a4;
    let a6 = 0.5 * a3 * a3;
    let a7 = a4 * (a5 * (a5 * (a5 * (0.2427894 * a5 + 0.2849879) + 0.40000972) + 0.6666666) + a6);
    return 0.69314575 * a2 - (a6 - (a7 + 1.4286068e-06 * a2) - a3);
}

/// The description of a step.
#[allow(dead_code, non_snake_case)]
#[derive(Clone, Debug)]
pub struct Controlled {
    /// the step.
    pub dt: f32,
    /// the time of step 0.
    pub t0: f64,
    pub masses: [f32; 2],
    pub Gm: [f32; 2],
    pub softening: f32,
    /// control.gain.
    pub control_gain: f32,
    /// control.target.
    pub control_target: f32,

    // Made of these by `prepare`.
    c1: f32,
    c2: f32,
    c3: f32,
    c4: f32,
    c5: f32,
    c6: f32,
    c7: f32,
    c8: f32,
    c9: f32,
}

/// A state.
#[allow(dead_code)]
#[derive(Clone, Debug)]
pub struct ControlledState {
    pub v: [f32; 4],
    pub y: [f32; 4],
    /// What the control has added up.
    pub tally: f32,
    /// k; the time is t0 + k*dt.
    pub step: u64,
}

#[allow(clippy::all, dead_code)]
impl Controlled {
    /// With the parameters with which it was exported.
    pub fn new() -> Self {
        let mut m = Self {
            dt: 0.01,
            t0: 0.0,
            masses: [1.0, 2.0],
            Gm: [1.0, 2.0],
            softening: 0.0,
            control_gain: 0.3,
            control_target: 2.3109303,
            c1: 0.0,
            c2: 0.0,
            c3: 0.0,
            c4: 0.0,
            c5: 0.0,
            c6: 0.0,
            c7: 0.0,
            c8: 0.0,
            c9: 0.0,
        };
        m.prepare();
        m
    }

    /// What does not change from step to step. To be called after a change of a parameter.
    pub fn prepare(&mut self) {
        self.c1 = self.dt * self.Gm[0];
        self.c2 = self.dt * self.Gm[1];
        self.c3 = self.softening * self.softening;
        self.c4 = 0.5 * self.dt;
        self.c5 = self.masses[0] * self.c4;
        self.c6 = self.masses[1] * self.c4;
        self.c7 = self.dt * self.control_target;
        self.c8 = 0.0 * self.masses[1];
        self.c9 = 2.0 * self.control_gain;
    }

    /// The state at step 0, of velocities and coordinates.
    pub fn start(&self, velocities: [f32; 4], coordinates: [f32; 4]) -> ControlledState {
        ControlledState { v: velocities, y: coordinates, tally: 0.0, step: 0 }
    }

    /// One step.
    pub fn step(&self, s: &mut ControlledState, force: &[f32; 4]) {
        // The state.
        let v_0_0 = s.v[0];
        let v_0_1 = s.v[1];
        let v_1_0 = s.v[2];
        let v_1_1 = s.v[3];
        let y_0_0 = s.y[0];
        let y_0_1 = s.y[1];
        let y_1_0 = s.y[2];
        let y_1_1 = s.y[3];
        let tally = s.tally;

        // The force.
        let force_0_0 = force[0];
        let force_0_1 = force[1];
        let force_1_0 = force[2];
        let force_1_1 = force[3];

        // What depends on the state.
        let a1 = y_1_0 - y_0_0;
        let a2 = y_1_1 - y_0_1;
        let a3 = a1 * a1 + a2 * a2 + self.c3;
        let a4 = 1.0 / a3;
        let a5 = self.c2 * a4;
        let a6 = self.c1 * a4;
        let a7 = self.c5 * (v_0_0 * v_0_0 + v_0_1 * v_0_1) + self.c6 * (v_1_0 * v_1_0 + v_1_1 * v_1_1);
        let a8 = a7 + (self.masses[0] * (0.0 + self.c2 * (0.5 * logarithm(a3) + a4 * (a3 - a3))) + self.c8);
        let a9 = 1.0 - self.c9 * (a8 - self.c7) / (1.0 + self.c9 * a7);
        let a10 = if a9 < 0.25 { 0.25 } else { a9 };
        let a11 = 1.0 - f32::sqrt(if 4.0 < a10 { 4.0 } else { a10 });
        let next_tally = tally - a11 * (2.0 - a11) * a7;
        let dv1_0_0 = a1 * a5 + 0.0 - v_0_0 * a11 + self.dt * force_0_0;
        let dv1_0_1 = a2 * a5 + 0.0 - v_0_1 * a11 + self.dt * force_0_1;
        let dv1_1_0 = -a1 * a6 - v_1_0 * a11 + self.dt * force_1_0;
        let dv1_1_1 = -a2 * a6 - v_1_1 * a11 + self.dt * force_1_1;
        let next_v_0_0 = v_0_0 + dv1_0_0;
        let next_v_0_1 = v_0_1 + dv1_0_1;
        let next_v_1_0 = v_1_0 + dv1_1_0;
        let next_v_1_1 = v_1_1 + dv1_1_1;
        let dy1_0_0 = self.dt * next_v_0_0;
        let dy1_0_1 = self.dt * next_v_0_1;
        let dy1_1_0 = self.dt * next_v_1_0;
        let dy1_1_1 = self.dt * next_v_1_1;
        let next_y_0_0 = y_0_0 + dy1_0_0;
        let next_y_0_1 = y_0_1 + dy1_0_1;
        let next_y_1_0 = y_1_0 + dy1_1_0;
        let next_y_1_1 = y_1_1 + dy1_1_1;

        // The state after the step.
        s.v[0] = next_v_0_0;
        s.v[1] = next_v_0_1;
        s.v[2] = next_v_1_0;
        s.v[3] = next_v_1_1;
        s.y[0] = next_y_0_0;
        s.y[1] = next_y_0_1;
        s.y[2] = next_y_1_0;
        s.y[3] = next_y_1_1;
        s.tally = next_tally;
        s.step += 1;
    }

    /// The energy that the control has given since the start.
    pub fn work(&self, s: &ControlledState) -> f64 {
        s.tally as f64 / (1.0 * self.dt as f64)
    }
}

impl Default for Controlled {
    fn default() -> Self {
        Self::new()
    }
}

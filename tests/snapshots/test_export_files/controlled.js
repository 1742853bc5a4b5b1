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
// A module for browsers and Node.
// const m = new Controlled({ dt: ... }) sets the parameters that are given; call m.prepare() after a change of one.
// const s = m.start(velocities, coordinates) is the state at step 0, m.step(s, force) makes one step.
// m.work(s) is the energy that the control has given since the start.
//
// Example:
//
//     import { Controlled } from "./controlled.mjs";
//
//     const v = [1, 0, 0, 1];
//     const y = [1, 0, -0.5, 0];
//     const force = [0, 0, 0, 0];
//     const m = new Controlled();
//     const s = m.start(v, y);
//     for (let k = 0; k < 1000; k++) m.step(s, force);
//     console.log(s.y[0]);

// The nearest number of float32. Of a sum, product, quotient or root of such numbers that was rounded to 53 bits,
// it is the one that a single rounding gives.
const fround = Math.fround;

// Numbers rounded to float32.
function single(x) {
  return Array.isArray(x) ? x.map(single) : fround(x);
}

// The bits of a number of float32, by views of the same memory.
const number = new Float32Array(1);
const whole = new Uint32Array(number.buffer);

function bits_of(x) {
  number[0] = x;
  return whole[0];
}

function number_of(b) {
  whole[0] = b;
  return number[0];
}

function and_bits(a, b) {
  return (a & b) >>> 0;
}

function or_bits(a, b) {
  return (a | b) >>> 0;
}

function add_bits(a, b) {
  return (a + b) >>> 0;
}

function shift_down(a, n) {
  return a >>> n;
}

// The logarithm of x.
function logarithm(x) {
  const a1 = add_bits(bits_of(x), 0x4afc00);
  const a2 = fround(number_of(or_bits(shift_down(a1, 23), 0x4b000000)) - 8388735);
  const a3 = fround(number_of(add_bits(and_bits(a1, 0x7fffff), 0x3f350400)) - 1);
  const a4 = fround(a3 / fround(a3 + 2));
  const a5 = fround(a4 * a4);
  const a6 = fround(a5 * fround(fround(0.2427894026041031 * a5) + 0.2849878966808319));
  const a7 = fround(a3 * fround(0.5 * a3));
  const a8 = fround(a5 * fround(fround(a5 * fround(a6 + 0.40000972151756287)) + 0.6666666269302368));
  const a9 = fround(a7 - fround(fround(a4 * fround(a8 + a7)) + fround(1.428606765330187e-06 * a2)));
  return fround(fround(0.693145751953125 * a2) - fround(a9 - a3));
}

export class Controlled {
  constructor(given = {}) {
    this.dt = 0.009999999776482582; // the step
    this.t0 = 0.0; // the time of step 0
    this.masses = [1, 2];
    this.Gm = [1, 2];
    this.softening = 0;
    this.control_gain = 0.30000001192092896; // control.gain
    this.control_target = 2.3109302520751953; // control.target
    for (const name of Object.keys(given)) {
      if (!Object.prototype.hasOwnProperty.call(this, name)) throw new RangeError(`there is no parameter ${name}`);
    }
    Object.assign(this, given);
    this.prepare();
  }

  // What does not change from step to step. To be called after a change of a parameter.
  prepare() {
    this.dt = single(this.dt);
    this.masses = single(this.masses);
    this.Gm = single(this.Gm);
    this.softening = single(this.softening);
    this.control_gain = single(this.control_gain);
    this.control_target = single(this.control_target);
    this.c1 = fround(this.dt * this.Gm[0]);
    this.c2 = fround(this.dt * this.Gm[1]);
    this.c3 = fround(this.softening * this.softening);
    this.c4 = fround(0.5 * this.dt);
    this.c5 = fround(this.masses[0] * this.c4);
    this.c6 = fround(this.masses[1] * this.c4);
    this.c7 = fround(this.dt * this.control_target);
    this.c8 = fround(0 * this.masses[1]);
    this.c9 = fround(2 * this.control_gain);
  }

  // The state at step 0, of velocities and coordinates.
  start(velocities, coordinates) {
    if (velocities.length !== 4) throw new RangeError(`velocities: expected 4 numbers, got ${velocities.length}`);
    if (coordinates.length !== 4) throw new RangeError(`coordinates: expected 4 numbers, got ${coordinates.length}`);
    const s = { step: 0 };
    s.tally = 0; // what the control has added up
    s.v = Float32Array.from(velocities);
    s.y = Float32Array.from(coordinates);
    return s;
  }

  // One step.
  step(s, force) {
    // The state.
    const v_0_0 = s.v[0];
    const v_0_1 = s.v[1];
    const v_1_0 = s.v[2];
    const v_1_1 = s.v[3];
    const y_0_0 = s.y[0];
    const y_0_1 = s.y[1];
    const y_1_0 = s.y[2];
    const y_1_1 = s.y[3];
    const tally = s.tally;

    // The force.
    const force_0_0 = fround(force[0]);
    const force_0_1 = fround(force[1]);
    const force_1_0 = fround(force[2]);
    const force_1_1 = fround(force[3]);

    // What depends on the state.
    const a1 = fround(y_1_0 - y_0_0);
    const a2 = fround(y_1_1 - y_0_1);
    const a3 = fround(fround(fround(a1 * a1) + fround(a2 * a2)) + this.c3);
    const a4 = fround(1 / a3);
    const a5 = fround(this.c2 * a4);
    const a6 = fround(this.c1 * a4);
    const a7 = fround(this.c2 * fround(fround(0.5 * logarithm(a3)) + fround(a4 * fround(a3 - a3))));
    const a8 = fround(this.c5 * fround(fround(v_0_0 * v_0_0) + fround(v_0_1 * v_0_1)));
    const a9 = fround(a8 + fround(this.c6 * fround(fround(v_1_0 * v_1_0) + fround(v_1_1 * v_1_1))));
    const a10 = fround(fround(a9 + fround(fround(this.masses[0] * fround(a7 + 0)) + this.c8)) - this.c7);
    const a11 = fround(1 - fround(fround(this.c9 * a10) / fround(fround(this.c9 * a9) + 1)));
    const a12 = a11 < 0.25 ? 0.25 : a11;
    const a13 = fround(1 - fround(Math.sqrt(4 < a12 ? 4 : a12)));
    const next_tally = fround(tally - fround(a9 * fround(a13 * fround(2 - a13))));
    const a14 = fround(fround(fround(a1 * a5) + 0) - fround(v_0_0 * a13));
    const dv1_0_0 = fround(fround(this.dt * force_0_0) + a14);
    const a15 = fround(fround(fround(a2 * a5) + 0) - fround(v_0_1 * a13));
    const dv1_0_1 = fround(fround(this.dt * force_0_1) + a15);
    const dv1_1_0 = fround(fround(this.dt * force_1_0) + fround(-fround(a1 * a6) - fround(v_1_0 * a13)));
    const dv1_1_1 = fround(fround(this.dt * force_1_1) + fround(-fround(a2 * a6) - fround(v_1_1 * a13)));
    const next_v_0_0 = fround(v_0_0 + dv1_0_0);
    const next_v_0_1 = fround(v_0_1 + dv1_0_1);
    const next_v_1_0 = fround(v_1_0 + dv1_1_0);
    const next_v_1_1 = fround(v_1_1 + dv1_1_1);
    const dy1_0_0 = fround(this.dt * next_v_0_0);
    const dy1_0_1 = fround(this.dt * next_v_0_1);
    const dy1_1_0 = fround(this.dt * next_v_1_0);
    const dy1_1_1 = fround(this.dt * next_v_1_1);
    const next_y_0_0 = fround(y_0_0 + dy1_0_0);
    const next_y_0_1 = fround(y_0_1 + dy1_0_1);
    const next_y_1_0 = fround(y_1_0 + dy1_1_0);
    const next_y_1_1 = fround(y_1_1 + dy1_1_1);

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

  // The energy that the control has given since the start.
  work(s) {
    return s.tally / (1 * this.dt);
  }
}

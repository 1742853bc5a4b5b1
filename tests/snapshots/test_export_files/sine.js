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
// A module for browsers and Node.
// const m = new Sine({ dt: ... }) sets the parameters that are given; call m.prepare() after a change of one.
// const s = m.start(velocities, coordinates) is the state at step 0, m.step(s) makes one step.
//
// Example:
//
//     import { Sine } from "./sine.mjs";
//
//     const v = [0];
//     const y = [1];
//     const m = new Sine();
//     const s = m.start(v, y);
//     for (let k = 0; k < 1000; k++) m.step(s);
//     console.log(s.y[0]);

// The bits of a number, by views of the same memory.
const number = new Float64Array(1);
const halves = new Uint32Array(number.buffer);
const whole = new BigUint64Array(number.buffer);
halves[0] = 1;
const low = whole[0] === 1n ? 0 : 1; // which half has the last bit

// x, its sign turned if the last bit of y is set.
function turn_sign(x, y) {
  number[0] = y;
  return halves[low] & 1 ? -x : x;
}

// The sine of x.
function sine(x) {
  const a1 = 0.3183098861837907 * x + 6755399441055744;
  const a2 = a1 - 6755399441055744;
  const a3 = x - 3.1415926534682512 * a2 - 1.2154201013012384e-10 * a2;
  const a4 = a3 * a3;
  const a5 = a4 * a4;
  const a6 = a5 * (a5 * (2.7205082501769597e-15 * a5 + 1.6058937294753282e-10) + 2.75573192107121e-06);
  const a7 = a4 * (a5 * (-7.64292781535996e-13 * a5 - 2.505210682744121e-08) - 0.00019841269841207676);
  return turn_sign(a3 + a3 * a4 * (a4 * (a6 + 0.008333333333333196 + a7) - 0.16666666666666666), a1);
}

export class Sine {
  constructor(given = {}) {
    this.dt = 0.01; // the step
    this.t0 = 1.5; // the time of step 0
    this.omega = 2;
    this.damping = 0.1;
    for (const name of Object.keys(given)) {
      if (!Object.prototype.hasOwnProperty.call(this, name)) throw new RangeError(`there is no parameter ${name}`);
    }
    Object.assign(this, given);
    this.prepare();
  }

  // What does not change from step to step. To be called after a change of a parameter.
  prepare() {
    this.c1 = this.omega * this.omega * this.dt;
    this.phi = this.dt * this.omega;
    this.c2 = 2 * this.damping * this.phi;
  }

  // The state at step 0, of velocities and coordinates.
  start(velocities, coordinates) {
    if (velocities.length !== 1) throw new RangeError(`velocities: expected 1 number, got ${velocities.length}`);
    if (coordinates.length !== 1) throw new RangeError(`coordinates: expected 1 number, got ${coordinates.length}`);
    const s = { step: 0 };
    s.v = Float64Array.from(velocities);
    s.y = Float64Array.from(coordinates);
    return s;
  }

  // One step.
  step(s) {
    // The state.
    const v = s.v[0];
    const y = s.y[0];

    // What depends on the state.
    const next_y = y + this.dt * v;
    const dv1 = -this.c1 * sine(next_y) - this.c2 * v;
    const next_v = v + dv1;

    // The state after the step.
    s.v[0] = next_v;
    s.y[0] = next_y;
    s.step += 1;
  }
}

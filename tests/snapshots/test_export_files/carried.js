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
// A module for browsers and Node.
// const m = new Carried({ dt: ... }) sets the parameters that are given; call m.prepare() after a change of one.
// const s = m.start(velocities, coordinates) is the state at step 0, m.step(s) makes one step.
// m.finish(s) finds the velocities; in the state y_prev stands in their place.
//
// Example:
//
//     import { Carried } from "./carried.mjs";
//
//     const v = [0.5];
//     const y = [1];
//     const m = new Carried();
//     const s = m.start(v, y);
//     for (let k = 0; k < 1000; k++) m.step(s);
//     console.log(s.y[0]);

// The bits of a number, by views of the same memory.
const number = new Float64Array(1);
const halves = new Uint32Array(number.buffer);
const whole = new BigUint64Array(number.buffer);
halves[0] = 1;
const low = whole[0] === 1n ? 0 : 1; // which half has the last bit

// The sample that holds at a time: the last that is not after it; before all the first.
function sample(samples, start, interval, t) {
  let i = Math.floor((t - start) / interval * 1.0000000000000568); // t may miss a sample's time by rounding
  if (!(i > 0)) i = 0;
  return samples[Math.min(i, samples.length - 1)];
}

// The samples of x.
const x_samples = [1, 2, 3];

// The samples of x.times.
const x_times_samples = [0, 1, 2];

export class Carried {
  constructor(given = {}) {
    this.dt = 0.01; // the step
    this.t0 = 0; // the time of step 0
    this.omega = 1;
    this.x_start = 0; // x: the time of the first sample
    this.x_interval = 0.4; // x: the time to the next sample
    for (const name of Object.keys(given)) {
      if (!Object.prototype.hasOwnProperty.call(this, name)) throw new RangeError(`there is no parameter ${name}`);
    }
    Object.assign(this, given);
    this.prepare();
  }

  // What does not change from step to step. To be called after a change of a parameter.
  prepare() {
    this.phi = this.dt * this.omega;
    this.c1 = 0 * this.phi;
    this.c2 = this.dt < 0 ? this.dt : 0;
    this.c3 = this.dt - this.c2 - this.c2;
    this.c4 = 0.5 * this.c3;
    this.c5 = 0.5 * this.dt;
    this.c6 = this.c5 < 0 ? this.c5 : 0;
    this.c7 = this.c5 - this.c6;
    this.c8 = this.c7 - this.c6;
  }

  // The state at step 0, of velocities and coordinates.
  start(velocities, coordinates) {
    if (velocities.length !== 1) throw new RangeError(`velocities: expected 1 number, got ${velocities.length}`);
    if (coordinates.length !== 1) throw new RangeError(`coordinates: expected 1 number, got ${coordinates.length}`);
    const s = { step: 0 };
    s.y_prev = new Float64Array(1);
    s.y = Float64Array.from(coordinates);

    const t = this.t0 + s.step * this.dt;

    // The state.
    const v = velocities[0];
    const y = coordinates[0];

    // What depends on the time alone.
    const s1 = t - this.c6;
    const s2 = sample(x_samples, this.x_start, this.x_interval, t - this.c7);
    const s3 = this.x_start + this.x_interval * sample(x_times_samples, this.x_start, this.x_interval, s1);
    const s4 = (s1 - s3) / this.c8;
    const s5 = 0 < s4 ? s4 : 0;
    const s6 = s2 + (s5 < 1 ? s5 : 1) * (sample(x_samples, this.x_start, this.x_interval, s1) - s2);
    const s7 = this.phi * s6;

    // What depends on the state.
    const next_y_prev = y - this.phi * v + 0.5 * (this.phi * (-this.phi * y - this.c1 * v + s7));

    // The carry, in place of v.
    s.y_prev[0] = next_y_prev;
    return s;
  }

  // One step.
  step(s) {
    const t = this.t0 + s.step * this.dt;

    // The state.
    const y_prev = s.y_prev[0];
    const y = s.y[0];

    // What depends on the time alone.
    const s1 = t + this.c4;
    const s2 = sample(x_samples, this.x_start, this.x_interval, t - this.c4);
    const s3 = this.x_start + this.x_interval * sample(x_times_samples, this.x_start, this.x_interval, s1);
    const s4 = (s1 - s3) / this.c3;
    const s5 = 0 < s4 ? s4 : 0;
    const s6 = s2 + (s5 < 1 ? s5 : 1) * (sample(x_samples, this.x_start, this.x_interval, s1) - s2);
    const s7 = this.phi * s6;

    // What depends on the state.
    const dv1 = -this.phi * y - this.c1 * y_prev + s7;
    const next_y = 2 * y - y_prev + this.phi * dv1;
    const next_y_prev = y;

    // The state after the step.
    s.y_prev[0] = next_y_prev;
    s.y[0] = next_y;
    s.step += 1;
  }

  // The velocities at a state.
  finish(s) {
    const velocities = new Float64Array(1);
    const t = this.t0 + s.step * this.dt;

    // The state.
    const y_prev = s.y_prev[0];
    const y = s.y[0];

    // What depends on the time alone.
    const s1 = t - this.c6;
    const s2 = sample(x_samples, this.x_start, this.x_interval, t - this.c7);
    const s3 = this.x_start + this.x_interval * sample(x_times_samples, this.x_start, this.x_interval, s1);
    const s4 = (s1 - s3) / this.c8;
    const s5 = 0 < s4 ? s4 : 0;
    const s6 = s2 + (s5 < 1 ? s5 : 1) * (sample(x_samples, this.x_start, this.x_interval, s1) - s2);
    const s7 = this.phi * s6;

    // What depends on the state.
    const next_v = (y - y_prev) / this.phi + 0.5 * (-this.phi * y - this.c1 * y_prev + s7);

    // The velocities.
    velocities[0] = next_v;
    return velocities;
  }
}

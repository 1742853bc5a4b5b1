// Two runs of one scene with one step, and the true motion beside them.

import { Trajectory } from "./trajectory.js";
import { TRUTHS } from "./truths.js";

// The most samples of a curve over time; with more, every second is dropped.
const MAX_SAMPLES = 3000;
// The most states of a trail.
const MAX_TRAIL = 500;
// How far the two runs with small steps may be apart for the motion to count as known, in the scene's scales.
const TRUST = 1e-6;

// The true motion at the steps of a run: a formula, or a run with small steps, known as long as one with half of these agrees.
export class Truth {
  constructor(scene, dt, values, set) {
    this.scene = scene;
    this.dt = dt;
    this.set = set;
    this.formula = scene.truth ? TRUTHS[scene.truth] : null;
    if (this.formula && this.formula(0, set) === null) this.formula = null;
    this.until = Infinity;
    this.now = { v: set.v, y: set.y };
    if (this.formula || scene.steps.truth === undefined) {
      if (!this.formula) this.lose(0);
      return;
    }
    const finest = scene.dt / (scene.truth_by === "dop853" ? 2 : 16);
    this.n = Math.min(Math.max(1, Math.ceil(dt / finest - 1e-9)), 4096);
    this.coarse = new Trajectory(scene, "truth", dt / this.n, values);
    this.fine = new Trajectory(scene, "truth", dt / (2 * this.n), values);
  }

  // What it is, in words.
  get about() {
    if (this.formula) return "by its formula";
    if (!this.fine) return "not known";
    return `by a run with steps of ${Number(this.fine.dt.toPrecision(3))}`;
  }

  lose(t) {
    this.until = t;
    this.now = null;
  }

  // Go to the time of a step; steps only go up.
  go(k) {
    if (this.now === null) return null;
    const t = k * this.dt;
    if (this.formula) {
      this.now = this.formula(t, this.set);
      if (this.now === null) this.lose(t);
      return this.now;
    }
    const { coarse, fine } = this;
    coarse.steps(k * this.n - coarse.s.step);
    fine.steps(2 * k * this.n - fine.s.step);
    this.now = { v: fine.v, y: fine.y };
    if (coarse.lost !== null || fine.lost !== null || !(apart(coarse, fine, this.scene.scales) < TRUST)) this.lose(t);
    return this.now;
  }
}

const distance = (a, b) => Math.sqrt(a.reduce((sum, x, i) => sum + (x - b[i]) * (x - b[i]), 0));

// The larger of the distances of v and of y, in the largest lengths of these; a block that is always zero has no share.
export function apart(a, b, scales) {
  const [v, y] = [distance(a.v, b.v), distance(a.y, b.y)];
  return Math.max(scales[0] > 0 ? v / scales[0] : v, scales[1] > 0 ? y / scales[1] : y);
}

const copied = ({ v, y }) => ({ v: Float64Array.from(v), y: Float64Array.from(y) });

export class Race {
  // keys are the names of the two methods; trail is the time that a trail goes back.
  constructor(scene, keys, dt, values, trail) {
    this.scene = scene;
    this.dt = dt;
    this.runs = keys.map((key) => new Trajectory(scene, key, dt, values));
    this.truth = new Truth(scene, dt, values, this.runs[0].set);
    this.truthEnergy = (state) => (state && this.runs[0].energyOf ? this.runs[0].energyOf(this.runs[0].set.e, state.v, state.y) : NaN);
    this.k = 0;
    this.every = 1;
    this.t = [];
    this.energies = [[], [], []]; // of both runs and of the true motion
    this.errors = [[], []];
    this.trailBack(trail);
    this.trails = [[], []];
    this.before = [null, null, null]; // both runs and the true motion before the last step
    this.record();
    this.leave();
  }

  // Let trails go back so long: a state is kept every so many steps.
  trailBack(time) {
    this.trailEvery = Math.max(1, Math.round(time / this.dt / MAX_TRAIL));
  }

  // Whether neither run goes on.
  get over() {
    return this.runs.every((run) => run.lost !== null);
  }

  // Steps of both, up to a step and until a time of the clock; returns whether the step was reached.
  advance(to, deadline) {
    while (this.k < to && !this.over) {
      if (this.k === to - 1) this.before = [...this.runs, this.truth.go(this.k)].map((state) => (state && !state.lost ? copied(state) : null));
      this.k += 1;
      for (const run of this.runs) run.step();
      if (this.k % this.every === 0) this.record();
      if (this.k % this.trailEvery === 0) this.leave();
      if ((this.k & 3) === 0 && performance.now() > deadline) return false;
    }
    return true;
  }

  record() {
    const state = this.truth.go(this.k);
    this.t.push(this.k * this.dt);
    this.runs.forEach((run, i) => {
      const alive = run.lost === null;
      this.energies[i].push(alive ? run.energy() : NaN);
      this.errors[i].push(!state ? NaN : alive ? apart(run, state, this.scene.scales) : Infinity);
    });
    this.energies[2].push(this.truthEnergy(state));
    if (this.t.length >= MAX_SAMPLES) {
      this.every *= 2;
      const halved = (list) => list.filter((_, i) => i % 2 === 0);
      this.t = halved(this.t);
      this.energies = this.energies.map(halved);
      this.errors = this.errors.map(halved);
    }
  }

  leave() {
    this.runs.forEach((run, i) => {
      if (run.lost !== null) return;
      const trail = this.trails[i];
      trail.push(copied(run));
      if (trail.length > MAX_TRAIL) trail.shift();
    });
  }
}

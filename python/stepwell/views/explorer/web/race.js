// Two runs of one scene with one step, and the true motion beside them.

import { eigenvalues } from "./roots.js";
import { power } from "./texts.js";
import { MAX_ROOTS, Trajectory } from "./trajectory.js";
import { TRUTHS } from "./truths.js";

// The most samples of a curve over time; with more, every second is dropped.
const MAX_SAMPLES = 3000;
// The most states of a trail.
const MAX_TRAIL = 500;
// The most steps that are made to find the roots of the true motion.
const MAX_TRUE_STEPS = 120;
// How far the two runs with small steps may be apart, in the scene's scales: for the motion to be shown; for an error to be shown
// however small it is; and, in parts of a larger error, for that to be shown.
const TRUST = { motion: 1e-3, any: 1e-6, share: 1e-3 };

// The most parts into which a run that is the truth divides a step, and so far below its tolerance it takes fewer.
const MAX_PARTS = 256;
const FAR_BELOW = 2e-3;

// A run that halves its parts of a step until twice as many change the state by less than a tolerance. It goes on with the finer
// state; the run that it is checked by with the rougher, else both would be one where the step itself is short enough.
class Tight {
  constructor(scene, dt, values, tolerance, finer) {
    Object.assign(this, { dt, tolerance, finer, scales: scene.scales, k: 0, n: 1 });
    this.run = new Trajectory(scene, "truth", dt, values);
    this.begin = this.run.t;
    this.state = copied(this.run);
  }

  // The state after a step in so many parts.
  parts(n) {
    const { run, dt } = this;
    run.m.dt = dt / n;
    run.m.t0 = this.begin + this.k * dt;
    run.m.prepare();
    run.goTo(0, this.state.v, this.state.y);
    for (let i = 0; i < n; i++) run.m.step(run.s);
    return copied(run);
  }

  step() {
    let rough = this.parts(this.n);
    for (;;) {
      const fine = this.parts(2 * this.n);
      const change = apart(rough, fine, this.scales);
      if (change < this.tolerance || this.n >= MAX_PARTS || fine.y.some(Number.isNaN)) {
        this.state = this.finer ? fine : rough;
        this.k += 1;
        if (change < FAR_BELOW * this.tolerance && this.n > 1) this.n /= 2;
        return;
      }
      rough = fine;
      this.n *= 2;
    }
  }

  go(k) {
    while (this.k < k) this.step();
    return this.state;
  }
}

// The true motion at the steps of a run: a formula, or a run to a tolerance, known as long as one to a looser one agrees.
export class Truth {
  constructor(scene, dt, values, set) {
    Object.assign(this, { scene, dt, values, set });
    this.formula = scene.truth ? TRUTHS[scene.truth] : null;
    if (this.formula && this.formula(0, set) === null) this.formula = null;
    this.until = Infinity;
    this.gap = 0; // how far the two runs are apart
    this.now = { v: set.v, y: set.y };
    if (this.formula || scene.steps.truth === undefined) {
      if (!this.formula) this.lose(0);
      return;
    }
    [this.fine, this.coarse] = scene.truth_tolerances.map((tolerance, i) => new Tight(scene, dt, values, tolerance, i === 0));
  }

  // What it is, in words.
  get about() {
    if (this.formula) return "a formula";
    if (!this.fine) return "not known here";
    return `a run to a tolerance of ${power(Math.round(Math.log10(this.fine.tolerance)))}`;
  }

  // The parts into which it divides a step at present.
  get n() {
    return this.fine?.n ?? 1;
  }

  // The roots of a step of the true motion from a state; of a linear scene they are the same everywhere, and found once.
  roots(run) {
    const { scene, dt } = this;
    if (run.lost !== null || run.count > MAX_ROOTS || scene.steps.truth === undefined) return [];
    if (this.everywhere) return this.everywhere;
    const columns = run.count * (scene.linear ? 1 : 2);
    const n = Math.max(1, Math.min(2 * this.n, Math.floor(MAX_TRUE_STEPS / columns)));
    const probe = new Trajectory(scene, "truth", dt / n, this.values);
    const found = eigenvalues(probe.goTo(run.s.step * n, run.v, run.y).jacobian(n));
    if (scene.linear) this.everywhere = found;
    return found;
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
    this.now = this.fine.go(k);
    this.gap = Math.max(this.gap, apart(this.coarse.go(k), this.now, this.scene.scales));
    if (!(this.gap < TRUST.motion)) this.lose(t);
    return this.now;
  }

  // Whether an error is known to three digits, or is at most a millionth.
  knows(error) {
    return this.gap < TRUST.any || this.gap < TRUST.share * error;
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
  // keys are the names of the two methods; trail is the time that a trail goes back; number is the block and index of a number
  // that is watched where there is no energy.
  constructor(scene, keys, dt, values, trail, number) {
    this.scene = scene;
    this.dt = dt;
    this.runs = keys.map((key) => new Trajectory(scene, key, dt, values));
    this.truth = new Truth(scene, dt, values, this.runs[0].set);
    const { energyOf, set } = this.runs[0];
    const [block, i] = number ?? [];
    // What curves over time show: the energy, or a number of the state where the page has no formula for that.
    this.watched = (state) => (energyOf ? energyOf(set.e, state.v, state.y) : block ? state[block][i] : NaN);
    this.truthWatched = (state) => (state ? this.watched(state) : NaN);
    this.k = 0;
    this.every = 1;
    this.t = [];
    this.energies = [[], [], []]; // of both runs and of the true motion
    this.errors = [[], []];
    this.trailBack(trail);
    this.trails = [[], [], []]; // likewise
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
      if (((this.k & 3) === 0 || this.truth.n > 8) && performance.now() > deadline) return false;
    }
    return true;
  }

  record() {
    const state = this.truth.go(this.k);
    this.t.push(this.k * this.dt);
    this.runs.forEach((run, i) => {
      const alive = run.lost === null;
      this.energies[i].push(alive ? this.watched(run) : NaN);
      const error = !state ? NaN : alive ? apart(run, state, this.scene.scales) : Infinity;
      this.errors[i].push(this.truth.knows(error) ? error : NaN);
    });
    this.energies[2].push(this.truthWatched(state));
    if (this.t.length >= MAX_SAMPLES) {
      this.every *= 2;
      const halved = (list) => list.filter((_, i) => i % 2 === 0);
      this.t = halved(this.t);
      this.energies = this.energies.map(halved);
      this.errors = this.errors.map(halved);
    }
  }

  leave() {
    [...this.runs, this.truth.go(this.k)].forEach((state, i) => {
      if (!state || (state.lost ?? null) !== null) return;
      const trail = this.trails[i];
      trail.push({ ...copied(state), k: this.k });
      if (trail.length > MAX_TRAIL) trail.shift();
    });
  }
}

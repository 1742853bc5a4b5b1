// Steps of a scene by a method: the exported code, its parameters, and states that are no longer finite.

import { ENERGIES } from "./energies.js";
import { eigenvalues } from "./roots.js";

// The class of an exported module, made once.
const classes = new Map();

export function classOf(source) {
  if (!classes.has(source)) classes.set(source, new Function(source.replace("export class Step", "return class Step"))());
  return classes.get(source);
}

// The sources of a scene: JSON, deflated, in base 64.
export async function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return JSON.parse(await new Response(stream).text());
}

// Parameters of a step, of the energy, and the start, with the values of the sliders; m is what a step was made with.
export function settings(scene, values, m) {
  const found = { m, e: structuredClone(scene.energy ?? {}), v: [...scene.v], y: [...scene.y] };
  for (const slider of scene.sliders) {
    const value = values[slider.name] ?? slider.value;
    if (value === slider.value) continue; // the scene's own number, to the last bit
    for (const [path, factor] of Object.entries(slider.targets)) put(found, path, value * factor, slider.relative);
  }
  return found;
}

// Set the number at a path such as m.Gm[1], or all of a list at m.mass[*]; what is not there is left out.
export function put(root, path, value, relative) {
  const [, names, index] = /^([\w.]+)(?:\[(\d+|\*)\])?$/.exec(path);
  const parts = names.split(".");
  const last = parts.pop();
  const holder = parts.reduce((object, name) => object?.[name], root);
  if (holder === undefined || holder[last] === undefined) return;
  if (index === undefined || !Array.isArray(holder[last])) {
    holder[last] = relative ? holder[last] * value : value;
    return;
  }
  const list = holder[last];
  for (const i of index === "*" ? list.keys() : [Number(index)]) {
    if (i < list.length) list[i] = relative ? list[i] * value : value;
  }
}

// A state that is this many times as large as at the start counts as blowing up, though it is still finite.
const BLOWN_UP = 1e6;

// The most eigenvalues that are found; their cost grows with the third power, and they are found some times a second.
export const MAX_ROOTS = 40;

export class Trajectory {
  // key is the name of a method, or "truth"; values are those of sliders, by name.
  constructor(scene, key, dt, values) {
    const Step = classOf(scene.sources[scene.steps[key]]);
    this.scene = scene;
    this.dt = dt;
    const m = new Step();
    const set = settings(scene, values, m);
    m.dt = dt;
    m.prepare();
    this.m = m;
    this.energyOf = scene.energy ? ENERGIES[scene.energy.kind] : null;
    this.set = set;
    this.s = m.start(...[set.v, set.y].filter((block) => block.length));
    this.slot = Object.keys(this.s).find((name) => name !== "step" && name !== "tally" && name !== "y");
    this.started = Math.max(1e-300, this.size());
    this.lost = null; // the first step after which the state is not finite
    this.large = null; // the first after which it is a million times as large as at the start
  }

  get t() {
    return this.m.t0 + this.s.step * this.dt;
  }

  get y() {
    return this.s.y ?? EMPTY;
  }

  get v() {
    if (this.m.finish) return this.m.finish(this.s);
    return this.s.v ?? EMPTY;
  }

  energy() {
    return this.energyOf ? this.energyOf(this.set.e, this.v, this.y) : NaN;
  }

  // The largest number of the state; NaN if one is.
  size() {
    let most = 0;
    for (const block of [this.y, this.m.finish ? this.v : (this.s[this.slot] ?? EMPTY)]) {
      for (let i = 0; i < block.length; i++) {
        const x = Math.abs(block[i]);
        if (!(x <= most)) most = x;
        if (x !== x) return NaN;
      }
    }
    return most;
  }

  // One step; false once the state is no longer finite.
  step() {
    if (this.lost !== null) return false;
    this.m.step(this.s);
    const size = this.size();
    if (!(size < Infinity)) this.lost = this.s.step;
    else if (this.large === null && size > BLOWN_UP * this.started) this.large = this.s.step;
    return this.lost === null;
  }

  steps(n) {
    for (let k = 0; k < n && this.step(); k++);
    return this;
  }

  // Go on from a state at a time in steps.
  goTo(step, v, y) {
    this.s = this.m.start(...[v, y].filter((block) => block.length));
    this.s.step = step;
    return this;
  }

  // The derivatives of the state after steps by that before them; blocks in the order of their names in the state.
  jacobian(steps = 1) {
    const { m, s, slot } = this;
    const { scales, linear } = this.scene;
    const blocks = [slot, "y"].filter((name) => name && s[name]?.length);
    const n = blocks.reduce((sum, name) => sum + s[name].length, 0);
    const columns = [];
    const after = (name, i, x) => {
      const copy = { ...s };
      for (const each of blocks) copy[each] = linear ? new Float64Array(s[each].length) : Float64Array.from(s[each]);
      if (name) copy[name][i] += x;
      for (let k = 0; k < steps; k++) m.step(copy);
      return blocks.flatMap((each) => Array.from(copy[each]));
    };
    const rest = linear ? after(null, 0, 0) : null;
    for (const name of blocks) {
      for (let i = 0; i < s[name].length; i++) {
        if (linear) {
          const one = after(name, i, 1);
          columns.push(one.map((x, k) => x - rest[k]));
        } else {
          // The third derivative's part of a central difference and that of rounding are about equal here.
          const by = 6e-6 * Math.max(1e-3, Math.abs(s[name][i]), scales[name.startsWith("v") ? 0 : 1]);
          const [up, down] = [after(name, i, by), after(name, i, -by)];
          columns.push(up.map((x, k) => (x - down[k]) / (2 * by)));
        }
      }
    }
    return Array.from({ length: n }, (_, row) => columns.map((column) => column[row]));
  }

  // The numbers of a state.
  get count() {
    return (this.s[this.slot]?.length ?? 0) + this.y.length;
  }

  // The eigenvalues of a step at this state; none once it is not finite, or of a state of more than MAX_ROOTS numbers.
  roots() {
    return this.lost === null && this.count <= MAX_ROOTS ? eigenvalues(this.jacobian()) : [];
  }
}

const EMPTY = new Float64Array(0);

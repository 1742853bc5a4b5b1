// The step above which a method is unstable, for the marks on the slider of dt.

import { stableTwo } from "./roots.js";
import { LANES, short } from "./texts.js";
import { Trajectory } from "./trajectory.js";

// The frequency of the fastest swing of an undamped scene, by which a method's own limit is divided.
function fastest(scene, m) {
  if (scene.limit === "oscillator") return m.omega;
  const n = m.mass.length;
  return 2 * Math.sqrt(m.stiffness[0] / m.mass[0]) * Math.sin((0.5 * Math.PI * n) / (n + 1));
}

// The step above which a method is unstable: 0 if it is for every step, null if it is for none or the page does not know.
// Method is what the page knows of it, values are those of the sliders, m the parameters of a step.
export function limitOf(scene, method, values, m) {
  if (scene.limit === null || method.limit === null) return null;
  if (scene.limit !== "scan") return method.limit / fastest(scene, m);
  const stable = (dt) => {
    const [[a, b], [c, d]] = new Trajectory(scene, method.name, dt, values).jacobian();
    return stableTwo((a + d) / 2, a * d - b * c);
  };
  let dt = scene.dt / 200;
  if (!stable(dt)) return 0;
  while (stable(dt * 1.05)) {
    dt *= 1.05;
    if (dt > 1000 * scene.dt) return null;
  }
  let [low, high] = [dt, dt * 1.05];
  for (let i = 0; i < 40; i++) {
    const middle = 0.5 * (low + high);
    if (stable(middle)) low = middle;
    else high = middle;
  }
  return low;
}

// Elements for the marks of both methods' limits: place tells where on the slider a step is, from 0 to 1.
export function marksOf(limits, place, colours) {
  const never = [];
  const marks = [];
  limits.forEach((limit, i) => {
    const lane = LANES[i].toUpperCase();
    if (limit === 0) never.push(`${lane} for no dt`);
    const at = limit ? place(limit) : NaN;
    if (!(at >= 0 && at <= 1)) return;
    const same = marks.find((mark) => Math.abs(mark.limit / limit - 1) < 1e-9);
    if (same) same.lanes += `, ${lane}`;
    else marks.push({ limit, at, lanes: lane, colour: colours[i] });
  });
  marks.sort((a, b) => a.at - b.at);
  const nodes = marks.map((mark, i) => {
    const node = document.createElement("span");
    node.textContent = `${mark.lanes} ${short(mark.limit)}`;
    node.title = `stable up to dt = ${mark.limit}`;
    node.style.left = `${100 * mark.at}%`;
    node.style.setProperty("--mark", mark.colour);
    if (marks.length === 2) node.className = i ? "east" : "west";
    else if (mark.at > 0.9 || mark.at < 0.1) node.className = mark.at > 0.5 ? "west" : "east";
    return node;
  });
  if (never.length) {
    const note = document.createElement("span");
    note.className = "none";
    note.textContent = `stable: ${never.join(", ")}`;
    nodes.push(note);
  }
  return nodes;
}

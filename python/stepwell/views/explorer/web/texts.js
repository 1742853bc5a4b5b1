// Numbers and what has become of a run, in words.

import { radius } from "./roots.js";
import { MAX_ROOTS } from "./trajectory.js";

export const byId = (id) => document.getElementById(id);

export const LANES = ["a", "b"];

export const short = (x, digits = 4) => {
  if (!Number.isFinite(x)) return "–";
  const size = Math.abs(x);
  if (size !== 0 && (size >= 1e5 || size < 1e-3)) return x.toExponential(2).replace("e+", "e");
  return String(Number(x.toPrecision(digits)));
};

// The text of an element, written only when it is another.
export function say(id, text) {
  const node = byId(id);
  if (node.textContent !== text) node.textContent = text;
}

export function fate(run) {
  if (run.lost !== null) return `Blew up: after step ${run.lost} (t = ${short(run.lost * run.dt)}) the state is no longer finite.`;
  if (run.large !== null) return `Blowing up: since step ${run.large} (t = ${short(run.large * run.dt)}) the state is over a million times as large as at the start.`;
  return "";
}

export function tellRoots(page, i) {
  const run = page.race.runs[i];
  const most = radius(page.roots[i]);
  const lane = LANES[i].toUpperCase();
  if (run.count > MAX_ROOTS) return `${lane}, z-plane: ${run.count} roots, too many to find in a frame`;
  if (!Number.isFinite(most)) return `${lane}, z-plane: the state is not finite`;
  const size = most > 10 ? short(most, 3) : most.toFixed(5);
  if (!page.scene.linear) return `${lane}, z-plane, at this state: largest |z| = ${size}`;
  const growth = most - 1;
  const word = growth > 1e-9 ? `unstable, grows by ${short(100 * growth, 2)} % a step` : growth < -1e-9 ? "stable, dies away" : "stable, neither grows nor dies";
  return run.lost === null ? `${lane}, z-plane: largest |z| = ${size}, ${word}` : `${lane}, z-plane`;
}

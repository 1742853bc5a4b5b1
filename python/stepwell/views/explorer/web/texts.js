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

const EXPONENTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";
export const power = (n) => `10${n < 0 ? "⁻" : ""}${[...String(Math.abs(n))].map((digit) => EXPONENTS[digit]).join("")}`;

// A number of two digits, to be read at a glance.
export function large(x) {
  if (x === Infinity) return "∞";
  if (!Number.isFinite(x)) return "–";
  if (x === 0 || (Math.abs(x) >= 1e-3 && Math.abs(x) < 1e4)) return String(Number(x.toPrecision(2)));
  const [digits, exponent] = x.toExponential(1).split("e");
  return `${digits}·${power(Number(exponent))}`;
}

// The change of an energy, in words; empty where there is none to speak of.
export function gain(energies) {
  const [begin, now] = [energies[0], energies.at(-1)];
  if (!Number.isFinite(now) || !Number.isFinite(begin) || Math.abs(begin) < 1e-12) return "";
  const share = (100 * (now - begin)) / Math.abs(begin);
  const size = Math.abs(share);
  const digits = size < 0.05 ? "0" : size < 10 ? size.toFixed(1) : size < 1e4 ? String(Math.round(size)) : large(size);
  return `energy ${digits === "0" ? "±" : share < 0 ? "−" : "+"}${digits} %`;
}

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

const sized = (radius) => (radius > 10 ? short(radius, 3) : radius.toFixed(5));

export function tellRoots(page, i) {
  const run = page.race.runs[i];
  const most = radius(page.roots[i]);
  const lane = LANES[i].toUpperCase();
  if (run.count > MAX_ROOTS) return `${lane}, z-plane: ${run.count} roots, too many to find in a frame`;
  if (!Number.isFinite(most)) return `${lane}, z-plane: the state is not finite`;
  const size = sized(most);
  const truly = radius(page.trueRoots[i]);
  if (!page.scene.linear) {
    const own = Number.isFinite(truly) ? `; ${sized(truly)} of the true motion${truly > 1.001 ? ", which is unstable here itself" : ""}` : "";
    return `${lane}, z-plane, at this state: largest |z| = ${size}${own}`;
  }
  const growth = most - 1;
  if (truly > 1 + 1e-9) return `${lane}, z-plane: largest |z| = ${size}; ${sized(truly)} of the true motion, which grows itself`;
  const word = growth > 1e-9 ? `unstable, grows by ${short(100 * growth, 2)} % a step` : growth < -1e-9 ? "stable, dies away" : "stable, neither grows nor dies";
  return run.lost === null ? `${lane}, z-plane: largest |z| = ${size}, ${word}` : `${lane}, z-plane`;
}

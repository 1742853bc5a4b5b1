// The phase plane, the z-plane, and curves over time.

import { radius } from "./roots.js";
import { power } from "./texts.js";

const MARGIN = 10;

// So many of the last steps show their shears.
const SHEARS = 12;

// Curves leave the picture where they are this many of its sizes away.
const FAR = 3;

function shown(x, low, high) {
  const size = high - low;
  return Number.isFinite(x) && x > low - FAR * size && x < high + FAR * size;
}

// A line through the points that can be shown, with gaps at the others.
function curve(pen, points) {
  pen.beginPath();
  let down = false;
  for (const point of points) {
    if (!point) {
      down = false;
    } else if (down) {
      pen.lineTo(point[0], point[1]);
    } else {
      pen.moveTo(point[0], point[1]);
      down = true;
    }
  }
  pen.stroke();
}

const padded = ([low, high]) => {
  const by = 0.12 * (high - low) || 1;
  return [low - by, high + by];
};

export function drawPhase({ pen, width, height }, ranges, pair, run, truth, trail, look) {
  const [right, up] = [pair.right, pair.up].map(([block, i]) => padded(ranges[block][i]));
  const x = (z) => MARGIN + ((z - right[0]) / (right[1] - right[0])) * (width - 2 * MARGIN);
  const y = (z) => height - MARGIN - ((z - up[0]) / (up[1] - up[0])) * (height - 2 * MARGIN);
  const of = (state) => {
    const [a, b] = [state[pair.right[0]][pair.right[1]], state[pair.up[0]][pair.up[1]]];
    return shown(a, ...right) && shown(b, ...up) ? [x(a), y(b)] : null;
  };
  pen.strokeStyle = look.line;
  pen.lineWidth = 1;
  curve(pen, [[x(0), 0], [x(0), height]]);
  curve(pen, [[0, y(0)], [width, y(0)]]);
  pen.strokeStyle = look.truth;
  curve(pen, look.truthTrail.map(of));
  if (look.ellipse) {
    pen.strokeStyle = look.text;
    pen.setLineDash([5, 4]);
    curve(pen, look.ellipse.map(([v, z]) => of({ v: [v], y: [z] })));
    pen.setLineDash([]);
  }
  if (look.shears) drawShears(pen, trail, of, look);
  pen.strokeStyle = look.colour;
  pen.lineWidth = 1.25;
  pen.globalAlpha = 0.7;
  const path = trail.map(of);
  curve(pen, path);
  if (look.dots) {
    pen.fillStyle = look.colour;
    for (const point of path) if (point) pen.fillRect(point[0] - 1.25, point[1] - 1.25, 2.5, 2.5);
  }
  pen.globalAlpha = 1;
  const now = run.lost === null ? of(run) : null;
  const there = truth ? of(truth) : null;
  if (there) {
    pen.strokeStyle = look.truth;
    pen.beginPath();
    pen.arc(there[0], there[1], 7, 0, 2 * Math.PI);
    pen.stroke();
  }
  if (now) {
    pen.fillStyle = look.colour;
    pen.beginPath();
    pen.arc(now[0], now[1], 4.5, 0, 2 * Math.PI);
    pen.fill();
  }
  pen.fillStyle = look.faint;
  pen.font = look.font;
  pen.textAlign = "right";
  pen.fillText(pair.right[2], width - 5, Math.min(Math.max(y(0) - 5, 14), height - 6));
  pen.textAlign = "left";
  pen.fillText(pair.up[2], Math.min(Math.max(x(0) + 5, 4), width - 24), 13);
}

// The last steps as the two shears of which each is made: one block changes, then the other.
function drawShears(pen, trail, of, look) {
  const corners = [];
  for (let i = Math.max(1, trail.length - SHEARS); i < trail.length; i++) {
    const [before, after] = [trail[i - 1], trail[i]];
    corners.push(before, look.shears === "vy" ? { v: after.v, y: before.y } : { v: before.v, y: after.y }, after);
  }
  pen.strokeStyle = look.faint;
  pen.lineWidth = 1.25;
  curve(pen, corners.map(of));
}

// The unit circle, the roots of a step, which may be far outside, and those of the true motion as rings. A root is red where it
// means that the method is unstable: it is outside in a linear scene whose true motion does not grow as fast.
export function drawRoots({ pen, width, height }, roots, trueRoots, linear, look) {
  const worst = linear ? Math.max(1, radius(trueRoots) || 0) + 1e-6 : Infinity;
  const most = Math.min(Math.max(1.15, radius(roots) * 1.1 || 0, radius(trueRoots) * 1.1 || 0), 4);
  const unit = (Math.min(width, height) / 2 - MARGIN) / most;
  const at = (z) => {
    const size = Math.hypot(z.re, z.im);
    const inside = size > most ? most / size : 1;
    return [width / 2 + unit * z.re * inside, height / 2 - unit * z.im * inside];
  };
  pen.strokeStyle = look.line;
  pen.lineWidth = 1;
  curve(pen, [[0, height / 2], [width, height / 2]]);
  curve(pen, [[width / 2, 0], [width / 2, height]]);
  pen.strokeStyle = look.faint;
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.arc(width / 2, height / 2, unit, 0, 2 * Math.PI);
  pen.stroke();
  pen.fillStyle = look.faint;
  pen.font = look.font;
  pen.textAlign = "left";
  pen.fillText("z", 5, 14);
  pen.strokeStyle = look.truth;
  pen.lineWidth = 1.75;
  for (const root of trueRoots) {
    pen.beginPath();
    pen.arc(...at(root), 6, 0, 2 * Math.PI);
    pen.stroke();
  }
  for (const root of roots) {
    const [x, y] = at(root);
    pen.lineWidth = 2.25;
    pen.strokeStyle = Math.hypot(root.re, root.im) > worst ? look.bad : look.colour;
    curve(pen, [[x - 4, y - 4], [x + 4, y + 4]]);
    curve(pen, [[x - 4, y + 4], [x + 4, y - 4]]);
  }
}

// Round numbers between two, at most about so many.
function ticks(low, high, most) {
  const raw = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * ([1, 2, 5, 10].find((each) => each * power >= raw) ?? 10);
  const found = [];
  for (let i = Math.ceil(low / step); i * step <= high; i++) found.push(Number((i * step).toPrecision(12)));
  return found;
}

const written = (x) => (x !== 0 && (Math.abs(x) >= 1e5 || Math.abs(x) < 1e-3) ? x.toExponential(0).replace("e+", "e") : String(x));

// Curves over time: each has values and a look; with log, their decimal logarithms are drawn.
export function drawCurves({ pen, width, height }, t, curves, range, look, log) {
  const left = 46;
  const below = 20;
  const end = Math.max(t.at(-1) ?? 0, 1e-12);
  const [low, high] = range;
  const x = (time) => left + (time / end) * (width - left - 8);
  const y = (z) => 8 + ((high - z) / (high - low)) * (height - below - 14);
  pen.font = look.font;
  pen.lineWidth = 1;
  pen.fillStyle = look.faint;
  pen.textAlign = "right";
  for (const tick of ticks(low, high, 5)) {
    if (log && !Number.isInteger(tick)) continue; // there is no room for parts of a decade
    pen.strokeStyle = look.line;
    curve(pen, [[left, y(tick)], [width - 8, y(tick)]]);
    pen.fillText(log ? power(tick) : written(tick), left - 6, y(tick) + 4);
  }
  pen.textAlign = "center";
  for (const tick of ticks(0, end, Math.max(2, width / 110))) pen.fillText(written(tick), x(tick), height - 4);
  pen.save();
  pen.beginPath();
  pen.rect(left, 2, width - left - 4, height - below - 2);
  pen.clip();
  for (const { values, colour, dash, thick } of curves) {
    pen.strokeStyle = colour;
    pen.lineWidth = thick ?? 1.6;
    pen.setLineDash(dash ?? []);
    curve(
      pen,
      values.map((value, i) => {
        const z = log ? Math.log10(value) : value;
        if (log && value === Infinity) return [x(t[i]), y(high + 1)];
        return shown(z, low, high) ? [x(t[i]), y(z)] : z > high ? [x(t[i]), y(high + (high - low))] : null;
      }),
    );
  }
  pen.setLineDash([]);
  pen.restore();
}

// The range of energies: around that of the start, no wider than needed and no wider than what the start can lose or gain.
export function energyRange(energies, most) {
  const begin = energies[0][0];
  if (!Number.isFinite(begin)) return [-1, 1];
  let [low, high] = [begin, begin];
  for (const values of energies) {
    for (const value of values) {
      if (!Number.isFinite(value)) continue;
      low = Math.max(Math.min(low, value), begin - most);
      high = Math.min(Math.max(high, value), begin + most);
    }
  }
  const least = 1e-9 * (Math.abs(begin) + most);
  const pad = Math.max(0.08 * (high - low), least);
  return [low - pad, high + pad];
}

// The decades that errors of two runs go through.
export function errorRange(errors) {
  let [low, high] = [0, 0];
  for (const values of errors) {
    for (const value of values) {
      if (!(value > 0 && value < Infinity)) continue;
      low = Math.min(low, Math.floor(Math.log10(value)));
      high = Math.max(high, Math.ceil(Math.log10(value)));
    }
  }
  return [Math.max(Math.min(low, -2), -17) - 0.3, Math.min(high, 4) + 0.5];
}

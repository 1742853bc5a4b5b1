// The ellipse in the phase plane of an oscillator on which a method keeps its states, as the true motion keeps them on a circle.

import { eigenvalues } from "./roots.js";
import { Trajectory } from "./trajectory.js";

// How far the determinant of a step may be from 1, and states from the ellipse, by rounding.
const ROUNDING = 1e-9;
// The most steps from one state that is looked at to the next.
const MAX_APART = 20_000;

const form = ([v, y]) => [v * v, v * y, y * y];
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// The angle of a step; NaN where its roots are real.
function angleOf(matrix) {
  const [root] = eigenvalues(matrix);
  return root && root.im !== 0 ? Math.abs(Math.atan2(root.im, root.re)) : NaN;
}

// The coefficients [a, b, c] of a·v² + b·v·y + c·y² = 1; null where the method has no such ellipse.
export function conserved(scene, key, dt, values) {
  if (!scene.linear || scene.v.length !== 1 || scene.y.length !== 1) return null;
  const run = new Trajectory(scene, key, dt, values);
  const angle = angleOf(run.jacobian());
  if (!(angle > 0)) return null;
  // With short steps many a determinant is 1 to rounding: it counts with a step of about a radian.
  const [[a, b], [c, d]] = new Trajectory(scene, key, dt / angle, values).jacobian();
  if (!(Math.abs(a * d - b * c - 1) < ROUNDING)) return null;
  const apart = Math.ceil(1 / angle);
  if (apart > MAX_APART) return null;
  const rows = [];
  for (let i = 0; i < 5; i++) {
    if (i) run.steps(apart);
    rows.push(form([run.v[0], run.y[0]]));
  }
  // Cramer's rule for the ellipse through the first three; the others must be on it, too: no force drives the oscillator.
  const [one, two, three] = rows;
  const size = dot(one, cross(two, three));
  const sides = [cross(two, three), cross(three, one), cross(one, two)];
  const ellipse = [0, 1, 2].map((i) => (sides[0][i] + sides[1][i] + sides[2][i]) / size);
  if (!(4 * ellipse[0] * ellipse[2] > ellipse[1] ** 2) || !(ellipse[0] > 0)) return null;
  return rows.every((row) => Math.abs(dot(row, ellipse) - 1) < ROUNDING * Math.max(1, 1 / angle)) ? ellipse : null;
}

// Its points [v, y], all around.
export function around([a, b, c], count = 96) {
  return Array.from({ length: count + 1 }, (_, i) => {
    const [v, y] = [Math.cos((2 * Math.PI * i) / count), Math.sin((2 * Math.PI * i) / count)];
    const radius = 1 / Math.sqrt(dot([a, b, c], form([v, y])));
    return [radius * v, radius * y];
  });
}

const round = (x) => String(Number(x.toPrecision(3)));

// Its equation, with 1 before v².
export function equationOf([a, b, c]) {
  const [mixed, own, right] = [b / a, c / a, 1 / a];
  const times = (x) => (round(Math.abs(x)) === "1" ? "" : `${round(Math.abs(x))}·`);
  const middle = Math.abs(mixed) < ROUNDING ? "" : ` ${mixed < 0 ? "−" : "+"} ${times(mixed)}v·y`;
  return `v²${middle} + ${times(own)}y² = ${round(right)}`;
}

// The eigenvalues of a step: the roots in the z-plane.

// The roots of z² − 2pz + q, p half the trace and q the determinant of a matrix of two rows.
export function rootsOfTwo(p, q) {
  const inside = p * p - q;
  if (inside < 0) {
    const im = Math.sqrt(-inside);
    return [
      { re: p, im },
      { re: p, im: -im },
    ];
  }
  // The root of larger size first: the other is q over it, which loses no digits.
  const larger = p < 0 ? p - Math.sqrt(inside) : p + Math.sqrt(inside);
  return [
    { re: larger, im: 0 },
    { re: larger === 0 ? 0 : q / larger, im: 0 },
  ];
}

// The eigenvalues of a real matrix, an array of rows, the largest first; empty if a number is not finite.
export function eigenvalues(matrix) {
  const n = matrix.length;
  if (!matrix.every((row) => row.every(Number.isFinite))) return [];
  if (n === 1) return [{ re: matrix[0][0], im: 0 }];
  if (n === 2) {
    const [[a, b], [c, d]] = matrix;
    return rootsOfTwo((a + d) / 2, a * d - b * c);
  }
  const found = ofHessenberg(hessenberg(matrix));
  return found.sort((a, b) => Math.hypot(b.re, b.im) - Math.hypot(a.re, a.im));
}

export function radius(roots) {
  return roots.length ? Math.max(...roots.map((z) => Math.hypot(z.re, z.im))) : NaN;
}

// A similar matrix with zeros below the first diagonal under the main one, by elimination with pivots.
function hessenberg(matrix) {
  const n = matrix.length;
  const a = matrix.map((row) => Float64Array.from(row));
  for (let k = 1; k < n - 1; k++) {
    let pivot = k;
    for (let i = k + 1; i < n; i++) if (Math.abs(a[i][k - 1]) > Math.abs(a[pivot][k - 1])) pivot = i;
    if (a[pivot][k - 1] === 0) continue;
    [a[pivot], a[k]] = [a[k], a[pivot]];
    for (const row of a) [row[pivot], row[k]] = [row[k], row[pivot]];
    for (let i = k + 1; i < n; i++) {
      const share = a[i][k - 1] / a[k][k - 1];
      if (share === 0) continue;
      for (let j = k - 1; j < n; j++) a[i][j] -= share * a[k][j];
      a[i][k - 1] = 0;
      for (const row of a) row[k] += share * row[i];
    }
  }
  return a;
}

// QR steps on a Hessenberg matrix of complex numbers, each with Wilkinson's shift: the eigenvalue of the last two rows that is
// nearest to the last element.
function ofHessenberg(real) {
  const re = real;
  const im = real.map((row) => new Float64Array(row.length));
  const found = [];
  const size = Math.max(Number.MIN_VALUE, ...re.map((row) => row.reduce((sum, x) => sum + Math.abs(x), 0)));
  let last = real.length - 1;
  let turns = 0;
  while (last >= 0) {
    let first = last;
    while (first > 0) {
      const below = Math.hypot(re[first][first - 1], im[first][first - 1]);
      const around = abs(re, im, first - 1) + abs(re, im, first);
      if (below <= Number.EPSILON * (around || size)) break;
      first -= 1;
    }
    if (first === last || turns > 60) {
      found.push({ re: re[last][last], im: im[last][last] });
      last -= 1;
      turns = 0;
      continue;
    }
    turns += 1;
    const shift = turns % 11 === 10 ? exceptional(re, im, last) : wilkinson(re, im, last);
    qr(re, im, first, last, shift);
  }
  return found;
}

const abs = (re, im, i) => Math.hypot(re[i][i], im[i][i]);

// A shift that breaks a cycle.
function exceptional(re, im, last) {
  return { re: re[last][last] + Math.abs(re[last][last - 1]), im: im[last][last] };
}

function wilkinson(re, im, last) {
  const a = { re: re[last - 1][last - 1], im: im[last - 1][last - 1] };
  const b = { re: re[last - 1][last], im: im[last - 1][last] };
  const c = { re: re[last][last - 1], im: im[last][last - 1] };
  const d = { re: re[last][last], im: im[last][last] };
  const half = { re: (a.re - d.re) / 2, im: (a.im - d.im) / 2 };
  const bc = times(b, c);
  const square = times(half, half);
  const root = squareRoot({ re: square.re + bc.re, im: square.im + bc.im });
  const sign = half.re * root.re + half.im * root.im < 0 ? -1 : 1;
  const below = { re: half.re + sign * root.re, im: half.im + sign * root.im };
  const length = below.re * below.re + below.im * below.im;
  if (length === 0) return d;
  const share = times(bc, { re: below.re / length, im: -below.im / length });
  return { re: d.re - share.re, im: d.im - share.im };
}

const times = (a, b) => ({ re: a.re * b.re - a.im * b.im, im: a.re * b.im + a.im * b.re });

function squareRoot(z) {
  const length = Math.hypot(z.re, z.im);
  const re = Math.sqrt((length + Math.abs(z.re)) / 2);
  const im = re === 0 ? 0 : z.im / (2 * re);
  return z.re >= 0 ? { re, im } : { re: Math.abs(im), im: z.im < 0 ? -re : re };
}

// One QR step of the rows and columns from first to last: rotations from the left, then their conjugates from the right.
function qr(re, im, first, last, shift) {
  const rotations = [];
  for (let i = first; i <= last; i++) {
    re[i][i] -= shift.re;
    im[i][i] -= shift.im;
  }
  for (let k = first; k < last; k++) {
    const a = { re: re[k][k], im: im[k][k] };
    const b = { re: re[k + 1][k], im: im[k + 1][k] };
    const length = Math.hypot(a.re, a.im, b.re, b.im);
    const c = length === 0 ? { re: 1, im: 0 } : { re: a.re / length, im: a.im / length };
    const s = length === 0 ? { re: 0, im: 0 } : { re: b.re / length, im: b.im / length };
    rotations.push([c, s]);
    for (let j = k; j <= last; j++) {
      const x = { re: re[k][j], im: im[k][j] };
      const y = { re: re[k + 1][j], im: im[k + 1][j] };
      re[k][j] = c.re * x.re + c.im * x.im + s.re * y.re + s.im * y.im;
      im[k][j] = c.re * x.im - c.im * x.re + s.re * y.im - s.im * y.re;
      re[k + 1][j] = c.re * y.re - c.im * y.im - (s.re * x.re - s.im * x.im);
      im[k + 1][j] = c.re * y.im + c.im * y.re - (s.re * x.im + s.im * x.re);
    }
  }
  for (let k = first; k < last; k++) {
    const [c, s] = rotations[k - first];
    for (let i = first; i <= Math.min(k + 1, last); i++) {
      const x = { re: re[i][k], im: im[i][k] };
      const y = { re: re[i][k + 1], im: im[i][k + 1] };
      re[i][k] = x.re * c.re - x.im * c.im + (y.re * s.re - y.im * s.im);
      im[i][k] = x.re * c.im + x.im * c.re + (y.re * s.im + y.im * s.re);
      re[i][k + 1] = y.re * c.re + y.im * c.im - (x.re * s.re + x.im * s.im);
      im[i][k + 1] = y.im * c.re - y.re * c.im - (x.im * s.re - x.re * s.im);
    }
  }
  for (let i = first; i <= last; i++) {
    re[i][i] += shift.re;
    im[i][i] += shift.im;
  }
}

// Whether both roots of z² − 2pz + q lie in the unit circle or on it, up to rounding (Jury's criterion).
export function stableTwo(p, q) {
  const rounding = 1e-12;
  return Math.abs(q) <= 1 + rounding && Math.abs(2 * p) <= 1 + q + rounding;
}

// The motion of a scene on a canvas, by the kind of its system.

const TURN = (35 * Math.PI) / 180;
const TILT = (20 * Math.PI) / 180;

// From the right, from above: of x, y, z to the right and up.
function seen([x, y, z]) {
  const right = x * Math.cos(TURN) + y * Math.sin(TURN);
  const away = y * Math.cos(TURN) - x * Math.sin(TURN);
  return [right, z * Math.cos(TILT) + away * Math.sin(TILT)];
}

// A map from places to pixels that shows a box, with equal units to the right and up.
function window_(box, width, height, margin = 14) {
  const spans = [box[1] - box[0] || 1, box[3] - box[2] || 1];
  const unit = Math.min((width - 2 * margin) / spans[0], (height - 2 * margin) / spans[1]);
  const middle = [(box[0] + box[1]) / 2, (box[2] + box[3]) / 2];
  return { at: ([x, y]) => [width / 2 + unit * (x - middle[0]), height / 2 - unit * (y - middle[1])], unit };
}

function line(pen, points) {
  pen.beginPath();
  points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.stroke();
}

function disc(pen, [x, y], radius, fill) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  if (fill) pen.fill();
  else pen.stroke();
}

// The true place of a block, around it.
function outline(pen, x, y, long, high, look) {
  pen.strokeStyle = look.truth;
  pen.lineWidth = 2.5;
  pen.strokeRect(x - long / 2 - 3, y - high / 2 - 3, long + 6, high + 6);
}

// A zigzag from one place to another.
function spring(pen, [x0, y], [x1], half) {
  const turns = 12;
  const points = [[x0, y]];
  for (let i = 1; i < turns; i++) points.push([x0 + ((x1 - x0) * (i - 0.5)) / (turns - 1), y + (i % 2 ? -half : half)]);
  line(pen, [...points, [x1, y]]);
}

// What a pen on the block draws on paper that is drawn away downwards: the place over the last seconds, and the true one in grey.
function strip(pen, { trail, trueTrail, now }, look, right, top, bottom) {
  const down = ({ k }) => top + ((now - k * look.dt) / look.back) * (bottom - top);
  const seen = (states) => states.filter((state) => down(state) <= bottom).map((state) => [right(state.y[0]), down(state)]);
  pen.lineWidth = 2.5;
  pen.strokeStyle = look.truth;
  line(pen, seen(trueTrail));
  pen.lineWidth = 1.75;
  pen.strokeStyle = look.colour;
  line(pen, seen(trail));
}

// Points of a block of states in the plane of the picture.
function placesOf(y, dim) {
  const found = [];
  for (let i = 0; i + dim <= y.length; i += dim) found.push(dim === 3 ? seen([y[i], y[i + 1], y[i + 2]]) : [y[i], y[i + 1]]);
  return found;
}

// The box of all points of a motion, from the least and largest numbers of each coordinate.
function boxOf(ranges, motion) {
  const { dim } = motion;
  const places = [...(motion.anchors ?? []), ...(motion.marks ?? [])].map((each) => (dim === 3 ? seen(each) : each));
  for (let i = 0; i + dim <= ranges.length; i += dim) {
    for (let corner = 0; corner < 2 ** dim; corner++) {
      const place = Array.from({ length: dim }, (_, c) => ranges[i + c][(corner >> c) & 1]);
      places.push(dim === 3 ? seen(place) : place);
    }
  }
  if (motion.floor !== undefined && dim === 2) places.push([places[0][0], motion.floor]);
  const [x, y] = [places.map((p) => p[0]), places.map((p) => p[1])];
  return [Math.min(...x), Math.max(...x), Math.min(...y), Math.max(...y)];
}

// How each kind draws: of a sheet, what is to be drawn, and the look.
const KINDS = {
  spring({ pen, width, height }, drawn, look) {
    const { y, truth, range } = drawn;
    const size = Math.min(0.2 * height, 56);
    const { at } = window_([Math.min(range[0], 0) * 1.1, Math.max(range[1], 0) * 1.1, -0.01, 0.01], width, height, size / 2 + 12);
    const right = (z) => at([z, 0])[0];
    const wall = 8;
    const middle = 10 + size / 2;
    const ground = middle + size / 2;
    pen.strokeStyle = look.faint;
    pen.lineWidth = 1;
    line(pen, [[wall, 4], [wall, ground], [width - 6, ground]]);
    pen.setLineDash([3, 4]);
    line(pen, [[right(0), 4], [right(0), height - 4]]);
    pen.setLineDash([]);
    strip(pen, drawn, look, right, ground + 6, height - 4);
    pen.strokeStyle = look.faint;
    pen.lineWidth = 2;
    const x = right(y[0]);
    spring(pen, [wall, middle], [x - size / 2, middle], size / 4);
    pen.fillStyle = look.colour;
    pen.fillRect(x - size / 2, middle - size / 2, size, size);
    if (truth) outline(pen, right(truth.y[0]), middle, size, size, look);
  },

  block({ pen, width, height }, drawn, look) {
    const { y, truth, range } = drawn;
    const [long, high] = [Math.min(0.26 * height, 72), Math.min(0.2 * height, 56)];
    const { at } = window_([range[0], range[1], -0.01, 0.01], width, height, long / 2 + 12);
    const right = (z) => at([z, 0])[0];
    const ground = 10 + high;
    pen.strokeStyle = look.faint;
    pen.lineWidth = 1;
    line(pen, [[8, ground], [width - 8, ground]]);
    strip(pen, drawn, look, right, ground + 6, height - 4);
    pen.fillStyle = look.colour;
    pen.fillRect(right(y[0]) - long / 2, ground - high, long, high);
    if (truth) outline(pen, right(truth.y[0]), ground - high / 2, long, high, look);
  },

  pendulum({ pen, width, height }, { y, truth }, look) {
    const length = Math.min(width, height) / 2 - 22;
    const centre = [width / 2, height / 2];
    const end = (angle) => [centre[0] + length * Math.sin(angle), centre[1] + length * Math.cos(angle)];
    pen.strokeStyle = look.line;
    pen.lineWidth = 1;
    disc(pen, centre, length, false);
    if (truth) {
      pen.strokeStyle = look.truth;
      line(pen, [centre, end(truth.y[0])]);
      disc(pen, end(truth.y[0]), 11, false);
    }
    pen.strokeStyle = look.text;
    pen.lineWidth = 2;
    line(pen, [centre, end(y[0])]);
    pen.fillStyle = look.colour;
    disc(pen, end(y[0]), 11, true);
  },

  chain({ pen, width, height }, { y, truth, range }, look) {
    const n = y.length;
    const most = Math.max(Math.abs(range[0]), Math.abs(range[1])) || 1;
    const x = (i) => 12 + ((width - 24) * (i + 1)) / (n + 1);
    const up = (z) => height / 2 - (z / most) * (height / 2 - 18);
    const places = (of) => [[x(-1), up(0)], ...Array.from(of, (z, i) => [x(i), up(z)]), [x(n), up(0)]];
    pen.strokeStyle = look.line;
    pen.lineWidth = 1;
    line(pen, [[x(-1), up(0)], [x(n), up(0)]]);
    if (truth) {
      pen.strokeStyle = look.truth;
      line(pen, places(truth.y));
      places(truth.y).slice(1, -1).forEach((place) => disc(pen, place, 7, false));
    }
    pen.strokeStyle = look.colour;
    pen.fillStyle = look.colour;
    pen.lineWidth = 1.5;
    line(pen, places(y));
    places(y).slice(1, -1).forEach((place) => disc(pen, place, 5, true));
  },

  points({ pen, width, height }, { y, truth, trail, motion, ranges }, look) {
    const { dim } = motion;
    const { at } = window_(boxOf(ranges, motion), width, height);
    const places = placesOf(y, dim);
    const anchors = (motion.anchors ?? []).map((each) => (dim === 3 ? seen(each) : each));
    if (motion.floor !== undefined && dim === 2) {
      const [, ground] = at([0, motion.floor]);
      pen.strokeStyle = look.faint;
      pen.lineWidth = 1.5;
      line(pen, [[4, ground], [width - 4, ground]]);
    }
    for (const mark of motion.marks ?? []) {
      pen.fillStyle = look.faint;
      disc(pen, at(mark), 5, true);
    }
    const linked = motion.links?.length;
    pen.lineWidth = 1.25;
    pen.strokeStyle = look.colour;
    const drawn = linked ? [places.length - 1] : places.keys();
    for (const i of drawn) {
      const path = trail.map((state) => at(placesOf(state.y.subarray(dim * i, dim * (i + 1)), dim)[0]));
      const quarter = Math.ceil(path.length / 4);
      for (let part = 0; part < 4; part++) {
        pen.globalAlpha = 0.15 + 0.2 * part;
        line(pen, path.slice(part * quarter, (part + 1) * quarter + 1));
      }
    }
    pen.globalAlpha = 1;
    if (truth) {
      pen.strokeStyle = look.truth;
      pen.lineWidth = 2.25;
      placesOf(truth.y, dim).forEach((place) => disc(pen, at(place), 9, false));
    }
    pen.strokeStyle = look.text;
    pen.lineWidth = 1.5;
    for (const [i, j] of motion.links ?? []) {
      const end = (k) => at(k < 0 ? anchors[-1 - k] : places[k]);
      line(pen, [end(i), end(j)]);
    }
    pen.fillStyle = look.faint;
    anchors.forEach((place) => disc(pen, at(place), 3.5, true));
    pen.fillStyle = look.colour;
    places.forEach((place) => disc(pen, at(place), 6, true));
  },

  // A body by a box whose sides fit its inertia, turned by the quaternion y.
  body({ pen, width, height }, { y, truth, trail, motion }, look) {
    const { at } = window_([-1.35, 1.35, -1.35, 1.35], width, height);
    const [a, b, c] = motion.inertia;
    const half = [b + c - a, c + a - b, a + b - c].map((x) => Math.sqrt(Math.max(x, 0.05)));
    const size = Math.hypot(...half);
    const corner = (q, signs) => at(seen(turned(q, signs.map((sign, i) => (sign * half[i] * 1.15) / size))));
    const edges = (q, edge) => {
      for (const axis of [0, 1, 2]) {
        for (const [s, t] of [[-1, -1], [-1, 1], [1, -1], [1, 1]]) {
          const ends = [-1, 1].map((end) => corner(q, [0, 1, 2].map((i) => (i === axis ? end : i === (axis + 1) % 3 ? s : t))));
          edge(ends, axis);
        }
      }
    };
    pen.strokeStyle = look.colour;
    pen.globalAlpha = 0.5;
    pen.lineWidth = 1;
    line(pen, trail.map((state) => at(seen(turned(state.y, [0, 0, 1.2])))));
    pen.globalAlpha = 1;
    if (truth) {
      pen.strokeStyle = look.truth;
      edges(truth.y, (ends) => line(pen, ends));
    }
    pen.lineWidth = 2;
    pen.strokeStyle = look.colour;
    edges(y, (ends) => line(pen, ends));
    pen.strokeStyle = look.text;
    line(pen, [at(seen([0, 0, 0])), at(seen(turned(y, [0, 0, 1.2])))]);
    pen.fillStyle = look.text;
    disc(pen, at(seen(turned(y, [0, 0, 1.2]))), 4, true);
  },

  // Numbers of a state over the time of the trail, for systems of which the page knows nothing else.
  curves({ pen, width, height }, { y, trail, trueTrail, ranges, block, truth }, look) {
    const low = Math.min(...ranges.map((each) => each[0]));
    const high = Math.max(...ranges.map((each) => each[1]));
    const up = (z) => height - 12 - ((z - low) / (high - low || 1)) * (height - 24);
    const end = Math.max(trail.at(-1)?.k ?? 0, trueTrail.at(-1)?.k ?? 0);
    const begin = Math.min(trail[0]?.k ?? 0, trueTrail[0]?.k ?? 0);
    const x = (k) => 8 + ((width - 40) * (k - begin)) / Math.max(1, end - begin);
    const path = (states, i) => line(pen, states.map((state) => [x(state.k), up(state[block][i])]));
    const count = Math.min(y.length, 12);
    pen.font = look.font;
    pen.textAlign = "left";
    for (let i = 0; i < count; i++) {
      pen.strokeStyle = look.truth;
      pen.lineWidth = 3.5;
      path(trueTrail, i);
      pen.strokeStyle = look.colour;
      pen.fillStyle = look.colour;
      pen.globalAlpha = 1 - 0.06 * i;
      pen.lineWidth = 1.5;
      path(trail, i);
      disc(pen, [x(trail.at(-1)?.k ?? 0), up(y[i])], 3, true);
      pen.globalAlpha = 1;
      if (truth) {
        pen.strokeStyle = look.truth;
        disc(pen, [x(end), up(truth[block][i])], 7, false);
      }
      pen.fillStyle = look.text;
      pen.fillText(count > 1 ? `${block}[${i}]` : block, x(end) + 10, up(truth ? truth[block][i] : y[i]) + 4);
    }
  },
};

// A vector of the body's axes in those of space.
function turned([a, b, c, d], [x, y, z]) {
  const square = a * a + b * b + c * c + d * d || 1;
  return [
    ((a * a + b * b - c * c - d * d) * x + 2 * (b * c - a * d) * y + 2 * (b * d + a * c) * z) / square,
    (2 * (b * c + a * d) * x + (a * a + c * c - b * b - d * d) * y + 2 * (c * d - a * b) * z) / square,
    (2 * (b * d - a * c) * x + 2 * (c * d + a * b) * y + (a * a + d * d - b * b - c * c) * z) / square,
  ];
}

// Whether a number of a state is outside the picture.
function outside(block, ranges) {
  return ranges.some(([low, high], i) => Math.abs(block[i] - (low + high) / 2) > 0.75 * (high - low) && high > low);
}

// The most that pictures zoom out.
const MAX_ZOOM = 4;

// How far pictures zoom out to show states: 1, or more if numbers of one leave their ranges, in steps.
export function zoomFor(ranges, states) {
  let most = 1;
  for (const name of ["v", "y"]) {
    ranges[name].forEach(([low, high], i) => {
      const half = (high - low) / 2;
      if (!(half > 0)) return;
      for (const state of states) {
        const away = Math.abs(state[name][i] - (low + high) / 2) / half;
        if (away > 1.1 * most && away < Infinity) most = away;
      }
    });
  }
  return most > 1.1 ? Math.min(MAX_ZOOM, Math.ceil(4 * most) / 4) : 1;
}

// Ranges that are this many times as wide, about the same middle.
export function widened(ranges, zoom) {
  const wide = ([low, high]) => [(low + high - zoom * (high - low)) / 2, (low + high + zoom * (high - low)) / 2];
  return zoom === 1 ? ranges : { v: ranges.v.map(wide), y: ranges.y.map(wide) };
}

// Draw a run: its state, the true one if that is known, its trail; look has the colours.
export function drawMotion(paper, scene, allRanges, run, truth, trail, look) {
  const trueTrail = look.truthTrail;
  const state = run.lost === null ? run : (trail.at(-1) ?? run);
  const block = state.y.length ? "y" : "v";
  const ranges = allRanges[block];
  const range = [Math.min(...ranges.map((each) => each[0])), Math.max(...ranges.map((each) => each[1]))];
  const { motion } = scene;
  if (run.lost !== null) paper.pen.globalAlpha = 0.35;
  KINDS[motion.kind](paper, { y: state[block], truth, trail, trueTrail, motion, range, ranges, block, now: look.now }, look);
  paper.pen.globalAlpha = 1;
  if (motion.kind !== "pendulum" && motion.kind !== "body" && outside(state[block], ranges)) {
    paper.pen.fillStyle = look.bad;
    paper.pen.font = look.font;
    paper.pen.textAlign = "center";
    paper.pen.fillText("outside the picture", paper.width / 2, paper.height - 6);
  }
}

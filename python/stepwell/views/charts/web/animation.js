"use strict";
// Numbers are given as 16 bits each: low + step · code; the last code stands for what is not known.
const NONE = 65535;

function decode(given) {
  const bytes = Uint8Array.from(atob(given.codes), (c) => c.charCodeAt(0));
  const values = new Float64Array(bytes.length / 2);
  for (let i = 0; i < values.length; i++) {
    const code = bytes[2 * i] + 256 * bytes[2 * i + 1];
    values[i] = code === NONE ? NaN : given.low + given.step * code;
  }
  return values;
}

// The colours of a light and of a dark page: text, lines between points, the ground, frames, what lies below a curve.
const LIGHT = {
  ink: "#111", text: "#555", line: "#333", ground: "#fff", frame: "#bbb", grid: "#e6e6e6", exact: "#d4d4d4", rest: "#cfcfcf", now: "#888",
};
const DARK = {
  ink: "#eee", text: "#b4b8be", line: "#d0d4da", ground: "#14171b", frame: "#555b63", grid: "#2a2f36", exact: "#4a5058", rest: "#6a717a", now: "#9aa0a8",
};
let look = LIGHT;

// A colour of the data that is seen on the ground: on a dark one half way to white, and grey as a line.
function seen(colour) {
  if (look === LIGHT) return colour;
  if (colour.length === 4) return look.line;
  const parts = [1, 3, 5].map((i) => Math.round(0.5 * (parseInt(colour.slice(i, i + 2), 16) + 255)));
  return `rgb(${parts.join(",")})`;
}

// A panel on the canvas: its frame in pixels, and the scale from its limits to that frame.
function framed(size, panel) {
  const [left, top, width, height] = panel.place ?? panel.rect;
  const [x0, x1, y0, y1] = panel.limits;
  const box = { x: left * size.width, y: top * size.height, w: width * size.width, h: height * size.height };
  let sx = box.w / (x1 - x0), sy = box.h / (y1 - y0);
  if (panel.equal) sx = sy = Math.min(sx, sy);
  const cx = box.x + 0.5 * box.w, cy = box.y + 0.5 * box.h, mx = 0.5 * (x0 + x1), my = 0.5 * (y0 + y1);
  return { box, at: (x, y) => [cx + sx * (x - mx), cy - sy * (y - my)] };
}

function polyline(g, places, colour, width, dash = []) {
  g.strokeStyle = colour;
  g.lineWidth = width;
  g.setLineDash(dash);
  g.lineJoin = "round";
  g.beginPath();
  let down = false;
  for (const [x, y] of places) {
    const finite = Number.isFinite(x) && Number.isFinite(y);
    if (finite && down) g.lineTo(x, y);
    else if (finite) g.moveTo(x, y);
    down = finite;
  }
  g.stroke();
  g.setLineDash([]);
}

function disc(g, [x, y], radius, colour) {
  g.beginPath();
  g.arc(x, y, radius, 0, 2 * Math.PI);
  g.fillStyle = colour;
  g.fill();
  g.lineWidth = 1.2;
  g.strokeStyle = look.ground;
  g.stroke();
}

function words(g, text, x, y, align = "left", font = 15) {
  g.font = `${font}px system-ui, sans-serif`;
  g.fillStyle = look.text;
  g.textAlign = align;
  g.fillText(text, x, y);
}

// The places of all points at a state; an animation of few states goes straight from one to the next.
function placed(panel, now) {
  const n = 2 * panel.count, first = Math.floor(now), share = now - first;
  const from = panel.values.subarray(first * n, (first + 1) * n);
  if (share === 0) return from;
  const to = panel.values.subarray((first + 1) * n, (first + 2) * n);
  return from.map((value, i) => value + share * (to[i] - value));
}

function points(g, size, panel, now, given) {
  const { box, at } = framed(size, panel);
  g.save();
  g.beginPath();
  g.rect(box.x, box.y, box.w, box.h);
  g.clip();
  for (const exact of panel.exact) polyline(g, pairs(exact.values).map((p) => at(...p)), look.exact, 5);
  const places = placed(panel, now), place = (i) => at(places[2 * i], places[2 * i + 1]);
  const first = Math.floor(now);
  if (panel.trail > 0) {
    for (let i = 0; i < panel.count; i++) {
      const trail = [];
      for (let k = first; k >= 0 && Math.abs(given.t[first] - given.t[k]) <= panel.trail; k--) {
        trail.push(at(panel.values[2 * (k * panel.count + i)], panel.values[2 * (k * panel.count + i) + 1]));
      }
      g.globalAlpha = 0.6;
      polyline(g, trail, seen(panel.colours[i % panel.colours.length]), panel.count > 5 ? 0.9 : 2.2);
      g.globalAlpha = 1;
    }
  }
  for (const [a, b] of panel.links) polyline(g, [place(a), place(b)], look.line, panel.links.length > 60 ? 0.8 : 2.2);
  for (const [anchor, b] of panel.held) polyline(g, [at(...panel.fixed[anchor].at), place(b)], look.line, 2.2);
  for (const body of panel.fixed) {
    const here = at(...body.at);
    disc(g, here, body.radius, seen(body.colour));
    const side = here[0] > box.x + 0.5 * box.w ? -1 : 1; // towards the middle, where there is room
    const align = side < 0 ? "right" : "left";
    if (body.name) words(g, body.name, here[0] + side * (body.radius + 3), here[1] - body.radius - 5, align);
  }
  if (panel.radius > 0) {
    for (let i = 0; i < panel.count; i++) disc(g, place(i), panel.radius, seen(panel.colours[i % panel.colours.length]));
  }
  g.restore();
  words(g, panel.name, box.x, box.y - 8);
}

function pairs(values) {
  const found = [];
  for (let i = 0; i + 1 < values.length; i += 2) found.push([values[i], values[i + 1]]);
  return found;
}

function series(g, size, panel, now, given) {
  const { box, at } = framed(size, panel);
  const first = Math.floor(now), [t0, t1, low, high] = panel.limits;
  g.strokeStyle = look.frame;
  g.lineWidth = 1;
  g.strokeRect(box.x, box.y, box.w, box.h);
  for (const [value, text] of panel.ticks) {
    const [x, y] = at(t0, value);
    polyline(g, [[box.x, y], [box.x + box.w, y]], look.grid, 1);
    words(g, text, x - 6, y + 5, "right", 13);
  }
  g.save();
  g.beginPath();
  g.rect(box.x, box.y, box.w, box.h);
  g.clip();
  for (const line of panel.lines) {
    const all = Array.from(line.values, (value, k) => at(given.t[k], value));
    polyline(g, all, line.exact ? look.exact : look.rest, line.exact ? 5 : 1.4);
    if (!line.exact) {
      polyline(g, all.slice(0, first + 1), seen(line.colour), 2);
      if (Number.isFinite(line.values[first])) disc(g, all[first], 5, seen(line.colour));
    }
  }
  polyline(g, [at(given.t[first], low), at(given.t[first], high)], look.now, 1);
  g.restore();
  words(g, panel.name, box.x, box.y - 8);
}

function rows(g, size, panel, now) {
  const { box, at } = framed(size, panel);
  const first = Math.floor(now), n = panel.count;
  const state = (values) => Array.from(values.subarray(first * n, (first + 1) * n), (value, i) => at(i + 1, value));
  polyline(g, [at(panel.limits[0], 0), at(panel.limits[1], 0)], look.frame, 1);
  if (panel.exact) polyline(g, state(panel.exact.values), look.exact, 8);
  const here = state(panel.values);
  polyline(g, here, look.line, 1.4);
  here.forEach((place, i) => {
    disc(g, place, n > 30 ? 3 : 8, seen(panel.colours[0]));
    if (n <= 30) words(g, String(i + 1), place[0], box.y + box.h + 16, "center", 13);
  });
  words(g, panel.name, box.x, box.y - 8);
}

// A body in space: its faces, turned and seen from a screen, the farthest first.
function solid(g, size, panel, now, given) {
  const { box, at } = framed(size, panel);
  const first = Math.floor(now), m = panel.values.subarray(9 * first, 9 * first + 9), [right, up, near] = panel.screen;
  const turned = (p) => [0, 1, 2].map((i) => m[3 * i] * p[0] + m[3 * i + 1] * p[1] + m[3 * i + 2] * p[2]);
  const on = (axis, p) => axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2];
  const onScreen = (p) => at(on(right, p), on(up, p));
  const circle = [...Array(73).keys()].map((i) => [Math.cos(i * Math.PI / 36), Math.sin(i * Math.PI / 36), 0]);
  polyline(g, circle.map(onScreen), look.frame, 1.2);
  if (panel.tip) {
    const trail = [];
    for (let k = first; k >= 0 && Math.abs(given.t[first] - given.t[k]) <= panel.trail; k--) {
      const one = panel.values.subarray(9 * k, 9 * k + 9);
      trail.push(onScreen([0, 1, 2].map((i) => on(panel.tip, one.subarray(3 * i, 3 * i + 3)))));
    }
    polyline(g, trail, seen(panel.colours[0]), 2);
  }
  const shown = panel.faces.map(([corners, fill]) => ({ corners: corners.map(turned), fill }));
  if (panel.tip) shown.push({ corners: [[0, 0, 0], turned(panel.tip)], fill: null });
  const depth = (face) => face.corners.reduce((sum, p) => sum + on(near, p), 0) / face.corners.length;
  shown.sort((a, b) => depth(a) - depth(b));
  for (const { corners, fill } of shown) {
    const places = corners.map(onScreen);
    if (fill) {
      g.beginPath();
      places.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
      g.closePath();
      g.fillStyle = fill;
      g.fill();
    }
    polyline(g, fill ? [...places, places[0]] : places, look.ink, fill ? 1 : 3);
  }
  words(g, panel.name, box.x, box.y - 8);
}

const DRAWN = { points, series, rows, solid };

function unpack(given) {
  given.t = decode(given.t);
  for (const panel of given.panels) {
    if (panel.data) panel.values = decode(panel.data);
    if (panel.joined) panel.links = pairs(decode(panel.joined));
    for (const line of [...(panel.lines ?? []), ...(Array.isArray(panel.exact) ? panel.exact : [panel.exact ?? {}])]) {
      if (line.data) line.values = decode(line.data);
    }
  }
  return given;
}

// On a narrow page the panels are below each other, each as wide as the page, so that texts stay readable.
const WIDE = { width: 1000, height: 562.5 }, NARROW = 620;

function arranged(panels, width) {
  if (width >= NARROW) {
    for (const panel of panels) panel.place = panel.rect;
    return WIDE;
  }
  const size = { width: 400, height: 0 }, boxes = [];
  for (const panel of panels) {
    const curve = panel.type === "series", [x0, x1, y0, y1] = panel.limits;
    const left = curve ? 56 : 8, high = curve ? 120 : panel.equal ? Math.min(384, (384 * (y1 - y0)) / (x1 - x0)) : 220;
    boxes.push([left, size.height + 26, 392 - left, high]);
    size.height += high + (panel.type === "rows" ? 54 : 38);
  }
  panels.forEach((panel, i) => {
    const [x, y, w, h] = boxes[i];
    panel.place = [x / size.width, y / size.height, w / size.width, h / size.height];
  });
  return size;
}

function start(given) {
  const byId = (id) => document.getElementById(id);
  const canvas = byId("picture"), play = byId("play"), slider = byId("time"), clock = byId("clock");
  const last = given.t.length - 1, systemIsDark = matchMedia("(prefers-color-scheme: dark)");
  let now = 0, running = true, before = null, siteTheme = "auto";
  byId("title").textContent = given.title;
  byId("about").textContent = given.about;
  slider.max = last;

  function show() {
    const dark = siteTheme === "dark" || (siteTheme === "auto" && systemIsDark.matches);
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    look = dark ? DARK : LIGHT;
    const size = arranged(given.panels, canvas.clientWidth);
    canvas.style.aspectRatio = `${size.width} / ${size.height}`;
    const scale = Math.max(1, (canvas.clientWidth / size.width) * (window.devicePixelRatio || 1));
    canvas.width = Math.round(size.width * scale);
    canvas.height = Math.round(size.height * scale);
    const g = canvas.getContext("2d");
    g.setTransform(scale, 0, 0, scale, 0, 0);
    g.clearRect(0, 0, size.width, size.height);
    for (const panel of given.panels) DRAWN[panel.type](g, size, panel, given.between ? now : Math.floor(now), given);
    slider.value = Math.floor(now);
    clock.textContent = `t = ${given.t[Math.floor(now)].toFixed(given.digits)}`;
  }
  function tick(time) {
    if (before !== null) now += ((time - before) / 1000) * (last / given.seconds);
    before = time;
    if (now >= last) now = 0;
    show();
    if (running) requestAnimationFrame(tick);
  }
  function run(on) {
    if (on === running) return;
    running = on;
    before = null;
    play.textContent = on ? "Pause" : "Play";
    if (on) requestAnimationFrame(tick);
  }
  function go(to) {
    run(false);
    now = Math.min(last, Math.max(0, Math.floor(to)));
    show();
  }
  play.addEventListener("click", () => run(!running));
  slider.addEventListener("input", () => go(Number(slider.value)));
  addEventListener("resize", show);
  systemIsDark.addEventListener("change", show);
  // A site that shows the page in a frame says by a message which theme its reader chose.
  window.addEventListener("message", ({ data }) => {
    const theme = data?.theme;
    if (!["light", "dark", "auto"].includes(theme)) return;
    siteTheme = theme;
    show();
  });
  addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 10 : 1;
    const to = { ArrowLeft: now - step, ArrowRight: now + step, Home: 0, End: last }[event.key];
    if (event.key === " ") run(!running);
    else if (to !== undefined) go(to);
    else return;
    event.preventDefault();
  });
  requestAnimationFrame(tick);
}

if (typeof document !== "undefined") start(unpack(JSON.parse(document.getElementById("data").textContent)));

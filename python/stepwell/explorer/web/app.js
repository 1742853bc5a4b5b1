// The page: its controls, the loop over frames, and the link that holds its state.

import { drawMotion, widened, zoomFor } from "./motion.js";
import { colourOf, palette, sheet } from "./palette.js";
import { drawCurves, drawPhase, drawRoots, energyRange, errorRange } from "./plots.js";
import { Race } from "./race.js";
import { radius, stableTwo } from "./roots.js";
import { format, number, parse } from "./state.js";
import { MAX_ROOTS, Trajectory, unpack } from "./trajectory.js";

const LANES = ["a", "b"];
// Milliseconds of a frame in which steps are made; the rest of its 16 is for drawing.
const STEP_BUDGET = 8;
// The longest time between two frames that counts, in seconds: a page in the background does not run on.
const MAX_FRAME = 0.1;
// Milliseconds between two updates of texts and roots.
const SELDOM = 120;
// Seconds that a trail goes back.
const TRAIL = 5;
// The ends of the slider of dt, as multiples of the scene's step.
const DT_ENDS = [1 / 100, 20];
// The most steps that a link restores.
const MAX_RESTORED = 200_000;

const byId = (id) => document.getElementById(id);
const data = JSON.parse(byId("data").textContent);
const methods = new Map(data.methods.map((each) => [each.name, each]));
const still = matchMedia("(prefers-reduced-motion: reduce)");

const page = {
  scene: null,
  keys: ["false_euler", "rk4"],
  dt: 0.1,
  speed: 0,
  phase: 0,
  values: {},
  playing: false,
  race: null,
  target: 0, // the time up to which steps are wanted
  roots: [[], []],
  limits: [null, null],
  framesMs: [],
};

// ---- texts

const short = (x, digits = 4) => {
  if (!Number.isFinite(x)) return "–";
  const size = Math.abs(x);
  if (size !== 0 && (size >= 1e5 || size < 1e-3)) return x.toExponential(2).replace("e+", "e");
  return String(Number(x.toPrecision(digits)));
};

function say(id, text) {
  const node = byId(id);
  if (node.textContent !== text) node.textContent = text;
}

function fate(run) {
  if (run.lost !== null) return `Blew up: after step ${run.lost} (t = ${short(run.lost * run.dt)}) the state is no longer finite.`;
  if (run.large !== null) return `Blowing up: since step ${run.large} (t = ${short(run.large * run.dt)}) the state is over a million times as large as at the start.`;
  return "";
}

function tellRoots(i) {
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

// ---- stability limits on the slider of dt

// The frequency of the fastest swing of an undamped scene, by which a method's own limit is divided.
function fastest() {
  const { m } = page.race.runs[0];
  if (page.scene.limit === "oscillator") return m.omega;
  const n = m.mass.length;
  return 2 * Math.sqrt(m.stiffness[0] / m.mass[0]) * Math.sin((0.5 * Math.PI * n) / (n + 1));
}

// The step above which a method is unstable: 0 if it is for every step, null if the page does not know.
function limitOf(key) {
  const { scene, values } = page;
  if (scene.limit === null) return null;
  if (scene.limit !== "scan") return methods.get(key).limit / fastest();
  const stable = (dt) => {
    const [[a, b], [c, d]] = new Trajectory(scene, key, dt, values).jacobian();
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

const ends = () => DT_ENDS.map((share) => share * page.scene.dt);
const place = (dt) => Math.log(dt / ends()[0]) / Math.log(ends()[1] / ends()[0]);

function showLimits() {
  page.limits = page.keys.map(limitOf);
  const box = byId("limits");
  box.replaceChildren();
  const never = [];
  const marks = [];
  page.limits.forEach((limit, i) => {
    const lane = LANES[i].toUpperCase();
    if (limit === 0) never.push(`${lane} for no dt`);
    const at = limit ? place(limit) : NaN;
    if (!(at >= 0 && at <= 1)) return;
    const same = marks.find((mark) => Math.abs(mark.limit / limit - 1) < 1e-9);
    if (same) same.lanes += `, ${lane}`;
    else marks.push({ limit, at, lanes: lane, colour: colours()[i] });
  });
  marks.sort((a, b) => a.at - b.at);
  marks.forEach((mark, i) => {
    const node = document.createElement("span");
    node.textContent = `${mark.lanes} ${short(mark.limit)}`;
    node.title = `stable up to dt = ${mark.limit}`;
    node.style.left = `${100 * mark.at}%`;
    node.style.color = mark.colour;
    if (marks.length === 2) node.className = i ? "east" : "west";
    else if (mark.at > 0.9 || mark.at < 0.1) node.className = mark.at > 0.5 ? "west" : "east";
    box.append(node);
  });
  if (never.length) {
    const note = document.createElement("span");
    note.className = "none";
    note.textContent = `stable: ${never.join(", ")}`;
    box.append(note);
  }
}

// ---- the scene and its controls

const colours = () => {
  const { dark } = palette();
  return page.keys.map((key) => colourOf(methods.get(key), dark));
};

// Load a scene by its name; its steps are unpacked when they are first needed.
async function load(name, words = {}) {
  const scene = data.scenes.find((each) => each.name === name) ?? data.scenes[0];
  scene.sources ??= await unpack(scene.packed);
  page.scene = scene;
  const known = Object.keys(scene.steps).filter((key) => key !== "truth");
  const asked = [words.a ?? page.keys[0], words.b ?? page.keys[1]];
  page.keys = asked.map((key, i) => (known.includes(key) ? key : known.includes(["false_euler", "rk4"][i]) ? ["false_euler", "rk4"][i] : known[0]));
  page.dt = number(words.dt, ...ends().map((end, i) => end * [0.01, 100][i]), scene.dt);
  page.speed = number(words.speed, -4, 4, 0);
  page.phase = Math.round(number(words.phase, 0, scene.phases.length - 1, scene.phase));
  page.values = {};
  for (const slider of scene.sliders) page.values[slider.name] = number(words[`p.${slider.name}`], slider.low, slider.high, slider.value);
  fillControls(known);
  restart();
  const at = Math.round(number(words.at, 0, MAX_RESTORED, 0));
  const { race } = page;
  while (race === page.race && !race.over && !race.advance(at, performance.now() + 50)) {
    say("clock", `step ${race.k} of ${at}`);
    await new Promise((done) => setTimeout(done));
  }
  if (race !== page.race) return; // another scene was chosen meanwhile
  page.target = race.k * page.dt;
  draw();
  tell();
}

function option(value, text, reason) {
  const made = document.createElement("option");
  made.value = value;
  made.textContent = text;
  if (reason) {
    made.disabled = true;
    made.title = reason;
  }
  return made;
}

function fillControls(known) {
  const { scene } = page;
  document.title = `${scene.title} · stepwell explorer`;
  byId("scene").value = scene.name;
  say("about", scene.description);
  LANES.forEach((lane, i) => {
    const options = data.methods.map((each) => option(each.name, each.title, known.includes(each.name) ? "" : scene.refused[each.name]));
    byId(`method-${lane}`).replaceChildren(...options);
    byId(`method-${lane}`).value = page.keys[i];
  });
  byId("phase").replaceChildren(...scene.phases.map((pair, i) => option(i, pair.label)));
  byId("phase").value = page.phase;
  byId("sliders").replaceChildren(...scene.sliders.map(sliderOf));
  showNumbers();
}

// Decimals of a slider: some three hundred places from end to end.
const stepOf = (slider) => 10 ** Math.floor(Math.log10((slider.high - slider.low) / 300));

function sliderOf(slider) {
  const label = document.createElement("label");
  label.className = "slide";
  label.htmlFor = `p-${slider.name}`; // else it would be the label of the output in it
  if (slider.about) label.title = slider.about;
  const output = document.createElement("output");
  const span = document.createElement("span");
  span.append(slider.label, output);
  const input = document.createElement("input");
  Object.assign(input, { id: label.htmlFor, type: "range", min: slider.low, max: slider.high, step: "any", value: page.values[slider.name] });
  input.dataset.name = slider.name;
  const step = stepOf(slider);
  output.textContent = short(page.values[slider.name]);
  const set = (value) => {
    const near = Math.abs(value - slider.value) < 3 * step; // the scene's own value is easy to find again
    page.values[slider.name] = near ? slider.value : Number((Math.round(value / step) * step).toPrecision(8));
    output.textContent = short(page.values[slider.name]);
    restart();
    wanted();
  };
  input.addEventListener("input", () => set(Number(input.value)));
  // With step "any" arrow keys would move it by one unit of the parameter.
  input.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!by) return;
    event.preventDefault();
    const from = page.values[slider.name];
    const to = Math.min(Math.max(from + 4 * by * step, slider.low), slider.high);
    input.value = to;
    set(to);
    input.value = page.values[slider.name];
  });
  label.append(span, input);
  return label;
}

function showNumbers() {
  byId("dt").value = Math.round(1000 * place(page.dt));
  byId("dt").setAttribute("aria-valuetext", `${short(page.dt)} units of time`);
  say("dt-value", short(page.dt));
  byId("speed").value = page.speed;
  say("speed-value", `${short(2 ** page.speed, 3)}×`);
}

// Begin anew with the settings as they are.
function restart() {
  const { scene } = page;
  page.race = new Race(scene, page.keys, page.dt, page.values, TRAIL * scene.rate * 2 ** page.speed);
  page.target = 0;
  page.zoom = 1; // pictures zoom out while a run goes on, and in again with the next
  page.told = ["", ""];
  say("truth", page.race.truth.about);
  showLimits();
  if (byId("code").open) showCode();
  const [a, b] = colours();
  document.documentElement.style.setProperty("--a", a);
  document.documentElement.style.setProperty("--b", b);
  page.dirty = true;
  page.seldom = 0;
}

function showCode() {
  page.keys.forEach((key, i) => say(`code-${LANES[i]}`, page.scene.sources[page.scene.steps[key]]));
}

function setDt(dt) {
  const [low, high] = ends();
  page.dt = Math.min(Math.max(dt, low), high);
  showNumbers();
  restart();
  wanted();
}

function play(on) {
  if (!page.race) return;
  page.playing = on && !page.race.over;
  say("play", page.playing ? "Pause" : "Play");
  byId("play").setAttribute("aria-pressed", String(page.playing));
  page.last = performance.now();
  if (!page.playing) page.target = page.race.k * page.dt;
  wanted();
  if (!page.playing) page.dirty = true;
}

function oneStep() {
  play(false);
  page.race.advance(page.race.k + 1, Infinity);
  page.target = page.race.k * page.dt;
  page.dirty = true;
  page.seldom = 0;
  wanted();
}

// ---- the link

const words = () => {
  const { scene, keys, dt, speed, phase, values, race, playing } = page;
  const state = { scene: scene.name, a: keys[0], b: keys[1], dt };
  if (speed) state.speed = speed;
  if (phase !== scene.phase) state.phase = phase;
  for (const slider of scene.sliders) if (values[slider.name] !== slider.value) state[`p.${slider.name}`] = values[slider.name];
  if (!playing && race.k && race.k <= MAX_RESTORED) state.at = race.k;
  if (!playing) state.play = 0;
  return format(state);
};

let waiting = 0;
let own = location.hash;

// Write the state into the address, not more often than browsers allow.
function wanted() {
  clearTimeout(waiting);
  waiting = setTimeout(writeLink, 250);
}

function writeLink() {
  own = words();
  try {
    history.replaceState(null, "", own);
  } catch {
    // A frame of a notebook has no address of its own; there the state is in no link.
  }
}

async function readLink() {
  if (typeof DecompressionStream === "undefined") {
    say("about", "This browser is too old for this page: it cannot unpack the steps (DecompressionStream, in browsers since 2023).");
    return;
  }
  const given = parse(location.hash);
  play(false);
  await load(given.scene ?? data.scenes[0].name, given);
  play(given.play === undefined ? !still.matches && given.at === undefined : given.play !== "0");
}

async function copyLink() {
  writeLink();
  const link = location.href.split("#")[0] + own;
  try {
    await navigator.clipboard.writeText(link);
    announce("The link is copied.");
    say("link", "Copied");
    setTimeout(() => say("link", "Copy link"), 1500);
  } catch {
    prompt("The link of this state:", link);
  }
}

function announce(text) {
  say("news", text);
}

// ---- frames

// States as pictures show them: while it plays, on the way from the state before a step to that after it.
function displayed() {
  const { race } = page;
  const now = [...race.runs, race.truth.go(race.k)];
  const share = page.playing ? Math.min(Math.max(page.target / page.dt - race.k, 0), 1) : 1;
  return now.map((state, i) => {
    const before = race.before[i];
    if (!state || !before || share === 1 || state.lost) return state;
    const between = (name) => Float64Array.from(state[name], (x, j) => before[name][j] + share * (x - before[name][j]));
    return { lost: null, v: between("v"), y: between("y") };
  });
}

function draw() {
  const { race, scene } = page;
  const look = palette();
  const own = colours();
  const shown = displayed();
  const truth = shown[2];
  const pair = scene.phases[page.phase];
  const dots = page.dt * 64 > TRAIL * scene.rate * 2 ** page.speed; // so few states that each gets a dot
  const seen = race.runs.flatMap((run, i) => (run.lost === null ? [race.trails[i][0], run] : [])).filter(Boolean);
  page.zoom = Math.max(page.zoom, zoomFor(scene.ranges, seen));
  const ranges = widened(scene.ranges, page.zoom);
  race.runs.forEach((run, i) => {
    const lane = LANES[i];
    const mine = { ...look, colour: own[i], dots };
    const trail = shown[i] === run ? race.trails[i] : [...race.trails[i].slice(0, race.trailEvery === 1 ? -1 : undefined), shown[i]];
    drawMotion(sheet(byId(`motion-${lane}`)), scene, ranges, shown[i], truth, trail, mine);
    drawPhase(sheet(byId(`phase-${lane}`)), ranges, pair, shown[i], truth, trail, mine);
  });
  const dash = page.keys[0] === page.keys[1] ? [6, 5] : [];
  const lines = (of) => [
    { values: of[0], colour: own[0], dash: [] },
    { values: of[1], colour: own[1], dash },
  ];
  const begin = Math.abs(race.energies[0][0]) || 1;
  const energies = [{ values: race.energies[2], colour: look.truth, thick: 3 }, ...lines(race.energies)];
  if (scene.energy) drawCurves(sheet(byId("energy")), race.t, energies, energyRange(race.energies, 2 * begin), look, false);
  else blank("energy", "the page has no formula for the energy of this system", look);
  if (race.truth.until > 0) drawCurves(sheet(byId("error")), race.t, lines(race.errors), errorRange(race.errors), look, true);
  else blank("error", "the true motion is not known", look);
}

function blank(id, text, look) {
  const { pen, width, height } = sheet(byId(id));
  pen.fillStyle = look.faint;
  pen.font = look.font;
  pen.textAlign = "center";
  pen.fillText(text, width / 2, height / 2);
}

function tell() {
  const { race, scene } = page;
  const look = palette();
  const own = colours();
  race.runs.forEach((run, i) => {
    const lane = LANES[i];
    const method = methods.get(page.keys[i]);
    page.roots[i] = run.roots();
    drawRoots(sheet(byId(`roots-${lane}`)), page.roots[i], { ...look, colour: own[i] });
    say(`roots-told-${lane}`, tellRoots(i));
    const error = race.errors[i].at(-1);
    const parts = [`order ${method.order}`, `${method.evaluations} evaluation${method.evaluations > 1 ? "s" : ""} a step`];
    if (Number.isFinite(error)) parts.push(`error ${short(error, 2)}`);
    const energy = race.energies[i].at(-1);
    if (Number.isFinite(energy)) parts.push(`energy ${short(energy, 5)}`);
    say(`told-${lane}`, parts.join(" · "));
    const ends = fate(run);
    if (ends && ends !== page.told[i]) announce(`${method.title}: ${ends}`);
    page.told[i] = ends;
    say(`lost-${lane}`, ends);
    byId(`motion-${lane}`).setAttribute("aria-label", `Motion of ${scene.title} by ${method.title} at t = ${short(run.t)}. ${ends}`);
    byId(`phase-${lane}`).setAttribute("aria-label", `Phase plane, ${scene.phases[page.phase].label}, by ${method.title}`);
    byId(`roots-${lane}`).setAttribute("aria-label", tellRoots(i));
  });
  const behind = page.playing && page.slow ? ", slowed" : "";
  say("clock", `t = ${short(race.k * race.dt)}, step ${race.k}${behind}`);
  byId("energy").setAttribute("aria-label", `Energy over time: A ${short(race.energies[0].at(-1))}, B ${short(race.energies[1].at(-1))}, true ${short(race.energies[2].at(-1))}`);
  byId("error").setAttribute("aria-label", `Error over time: A ${short(race.errors[0].at(-1), 2)}, B ${short(race.errors[1].at(-1), 2)}`);
  const until = race.truth.until;
  const about = until < Infinity && until > 0 ? `, known up to t = ${short(until)}` : "";
  say("truth", race.truth.about + about);
}

function frame(now) {
  requestAnimationFrame(frame);
  if (!page.race) return;
  const began = performance.now();
  if (page.playing) {
    const passed = Math.min((now - page.last) / 1000, MAX_FRAME);
    page.last = now;
    page.target += Math.max(0, passed) * page.scene.rate * 2 ** page.speed;
    const to = Math.floor(page.target / page.dt + 1e-9);
    page.slow = !page.race.advance(to, began + STEP_BUDGET);
    if (page.slow) page.target = page.race.k * page.dt;
    if (page.race.over) play(false);
  }
  if (page.playing || page.dirty) {
    draw();
    if (began - (page.seldom || 0) > SELDOM || page.dirty) {
      page.seldom = began;
      tell();
    }
    page.dirty = false;
    if (page.playing) {
      page.framesMs.push(performance.now() - began);
      if (page.framesMs.length > 600) page.framesMs.shift();
    }
  }
}

// ---- what users do

function listen() {
  const on = (id, event, does) => byId(id).addEventListener(event, does);
  on("scene", "change", async (event) => {
    const going = page.playing;
    play(false);
    await load(event.target.value, { a: page.keys[0], b: page.keys[1] });
    play(going);
  });
  LANES.forEach((lane, i) =>
    on(`method-${lane}`, "change", (event) => {
      page.keys[i] = event.target.value;
      restart();
      wanted();
    }),
  );
  on("phase", "change", (event) => {
    page.phase = Number(event.target.value);
    page.dirty = true;
    wanted();
  });
  on("dt", "input", (event) => {
    const [low, high] = ends();
    setDt(Number((low * (high / low) ** (event.target.value / 1000)).toPrecision(3)));
  });
  on("speed", "input", (event) => {
    page.speed = Number(event.target.value);
    showNumbers();
    page.race.trailEvery = Math.max(1, Math.round((TRAIL * page.scene.rate * 2 ** page.speed) / page.dt / 500));
    wanted();
  });
  on("play", "click", () => {
    if (page.race.over) restart();
    play(!page.playing);
  });
  on("one", "click", oneStep);
  on("reset", "click", () => {
    restart();
    wanted();
  });
  on("link", "click", copyLink);
  on("code", "toggle", () => byId("code").open && showCode());
  window.addEventListener("hashchange", () => location.hash !== own && readLink());
  window.addEventListener("resize", () => (page.dirty = true));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    restartColours();
    page.dirty = true;
  });
  document.addEventListener("keydown", pressed);
}

function restartColours() {
  const [a, b] = colours();
  document.documentElement.style.setProperty("--a", a);
  document.documentElement.style.setProperty("--b", b);
  showLimits();
}

function pressed(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("select, pre")) return;
  const slides = event.target.matches("input");
  const presses = event.target.closest("button, summary");
  if (event.key === " " && !presses) {
    event.preventDefault();
    byId("play").click();
  } else if (event.key === "r" || event.key === "R") {
    byId("reset").click();
  } else if (!slides && event.key === "ArrowRight") {
    event.preventDefault();
    oneStep();
  } else if (!slides && (event.key === "ArrowUp" || event.key === "ArrowDown")) {
    event.preventDefault();
    setDt(Number((page.dt * (event.key === "ArrowUp" ? 1.05 : 1 / 1.05)).toPrecision(3)));
  }
}

byId("scene").replaceChildren(...data.scenes.map((each) => option(each.name, each.title)));
listen();
page.ready = readLink();
requestAnimationFrame(frame);

// For the console of a browser, and for tests: the scene, both runs, the state of the link.
window.explorer = { page, data, load, play, words, Trajectory, unpack };

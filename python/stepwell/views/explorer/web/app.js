// The page: its controls, the loop over frames, and the link that holds its state.

import { conserved } from "./conserved.js";
import { limitOf, marksOf } from "./limits.js";
import { colourOf, inkOn, palette } from "./palette.js";
import { draw, tell } from "./pictures.js";
import { Race } from "./race.js";
import { sliderOf } from "./slider.js";
import { format, number, parse } from "./state.js";
import { LANES, byId, say, short } from "./texts.js";
import { Trajectory, unpack } from "./trajectory.js";

// Milliseconds of a frame in which steps are made; the rest of its 16 is for drawing.
const STEP_BUDGET = 6;
// The longest time between two frames that counts, in seconds: a page in the background does not run on.
const MAX_FRAME = 0.1;
// Milliseconds between two updates of texts and roots, which are those of either run in turn.
const SELDOM = 60;
// Seconds that a trail goes back.
const TRAIL = 5;
// The ends of the slider of dt, as multiples of the scene's step.
const DT_ENDS = [1 / 100, 20];
// The most steps that a link restores.
const MAX_RESTORED = 200_000;

const data = JSON.parse(byId("data").textContent);
const methods = new Map(data.methods.map((each) => [each.name, each]));
const still = matchMedia("(prefers-reduced-motion: reduce)");
const systemIsDark = matchMedia("(prefers-color-scheme: dark)");
// What a site that shows the page in a frame asks for, by a message: "light", "dark", or "auto" as the system.
let siteTheme = "auto";

const page = {
  scene: null,
  keys: ["", ""],
  chosen: [false, false], // whether a user chose the method: it then stays with the next scene
  dt: 0.1,
  speed: 0,
  phase: 0,
  values: {},
  playing: false,
  race: null,
  target: 0, // the time up to which steps are wanted
  roots: [[], []],
  trueRoots: [[], []],
  ellipses: [null, null],
  shears: [null, null],
  limits: [null, null],
  zooms: [1, 1],
  framesMs: [],
};

// ---- stability limits on the slider of dt

const ends = () => [Math.min(page.scene.dt, page.scene.step) * DT_ENDS[0], Math.max(page.scene.dt, page.scene.step) * DT_ENDS[1]];
const place = (dt) => Math.log(dt / ends()[0]) / Math.log(ends()[1] / ends()[0]);

function showLimits() {
  page.limits = page.keys.map((key) => limitOf(page.scene, methods.get(key), page.values, page.race.runs[0].m));
  byId("limits").replaceChildren(...marksOf(page.limits, place, colours()));
}

// ---- the scene and its controls

// Methods of one family have one colour: the second of them is that of letters.
const colours = () => {
  const { dark, text } = palette();
  const [a, b] = page.keys.map((key) => colourOf(methods.get(key), dark));
  return [a, a === b && page.keys[0] !== page.keys[1] ? text : b];
};

// Load a scene by its name; its steps are unpacked when they are first needed.
async function load(name, words = {}) {
  const scene = data.scenes.find((each) => each.name === name) ?? data.scenes[0];
  scene.sources ??= await unpack(scene.packed);
  page.scene = scene;
  const known = Object.keys(scene.steps).filter((key) => key !== "truth");
  const asked = [words.a, words.b];
  page.chosen = asked.map((key) => known.includes(key));
  page.keys = asked.map((key, i) => [key, scene.pair[i], "false_euler", "rk4"].find((each) => known.includes(each)) ?? known[0]);
  page.dt = number(words.dt, ...ends().map((end, i) => end * [0.01, 100][i]), scene.step);
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
  show();
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
  say("title", scene.title);
  say("about", scene.description);
  LANES.forEach((lane, i) => {
    const options = data.methods.map((each) => option(each.name, each.title, known.includes(each.name) ? "" : scene.refused[each.name]));
    byId(`method-${lane}`).replaceChildren(...options);
    byId(`method-${lane}`).value = page.keys[i];
  });
  byId("phase").replaceChildren(...scene.phases.map((pair, i) => option(i, pair.label)));
  byId("phase").value = page.phase;
  byId("sliders").replaceChildren(...scene.sliders.map(sliderFor));
  showNumbers();
}

function sliderFor(slider) {
  return sliderOf(slider, page.values[slider.name], (value) => {
    page.values[slider.name] = value;
    restart();
    wanted();
  });
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
  const { right } = scene.phases[page.phase];
  page.race = new Race(scene, page.keys, page.dt, page.values, trailTime(), right);
  page.ellipses = page.keys.map((key) => conserved(scene, key, page.dt, page.values));
  page.shears = page.keys.map((key) => (scene.linear && scene.phases.length === 1 ? methods.get(key).shears : null));
  byId("error").closest("figure").hidden = page.race.truth.until === 0;
  showFinding();
  page.target = 0;
  page.zooms = [1, 1]; // of the phase planes
  page.zoom = 1; // pictures zoom out while a run goes on, and in again with the next
  page.told = ["", ""];
  showLimits();
  if (byId("code").open) showCode();
  setColours();
  page.dirty = true;
  page.seldom = 0;
}

// The finding of a scene is true with its own methods, step and parameters.
function showFinding() {
  const { scene, keys, dt, values } = page;
  const own = keys.every((key, i) => key === scene.pair[i]) && dt === scene.step && scene.sliders.every(({ name, value }) => values[name] === value);
  say("finding", own ? scene.finding : "");
}

function setColours() {
  const { style } = document.documentElement;
  colours().forEach((colour, i) => {
    style.setProperty(`--${LANES[i]}`, colour);
    style.setProperty(`--on-${LANES[i]}`, inkOn(colour));
  });
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

// The time that trails go back, which is longer at a higher speed.
const trailTime = () => TRAIL * page.scene.rate * 2 ** page.speed;

function show() {
  draw(page, colours(), trailTime());
  tell(page, methods, colours(), announce, LANES);
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
    draw(page, colours(), trailTime());
    if (began - (page.seldom || 0) > SELDOM || page.dirty) {
      page.seldom = began;
      page.turn = 1 - (page.turn ?? 1);
      tell(page, methods, colours(), announce, page.dirty ? LANES : [LANES[page.turn]]);
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
    const [a, b] = page.keys.map((key, i) => (page.chosen[i] ? key : undefined));
    await load(event.target.value, { a, b });
    play(going);
  });
  LANES.forEach((lane, i) =>
    on(`method-${lane}`, "change", (event) => {
      page.keys[i] = event.target.value;
      page.chosen[i] = true;
      restart();
      wanted();
    }),
  );
  on("phase", "change", (event) => {
    page.phase = Number(event.target.value);
    if (!page.scene.energy) restart(); // the curve is then that of another number
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
    page.race.trailBack(trailTime());
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
  systemIsDark.addEventListener("change", showTheme);
  window.addEventListener("message", ({ data }) => {
    const theme = data?.theme;
    if (!["light", "dark", "auto"].includes(theme)) return;
    siteTheme = theme;
    showTheme();
  });
  document.addEventListener("keydown", pressed);
}

function setTheme() {
  const dark = siteTheme === "dark" || (siteTheme === "auto" && systemIsDark.matches);
  document.documentElement.dataset.theme = dark ? "dark" : "light";
}

function showTheme() {
  setTheme();
  if (!page.race) return;
  setColours();
  showLimits();
  page.dirty = true;
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
setTheme();
listen();
page.ready = readLink();
requestAnimationFrame(frame);

// For the console of a browser, and for tests: the scene, both runs, the state of the link.
window.explorer = { page, data, load, play, words, Trajectory, unpack };

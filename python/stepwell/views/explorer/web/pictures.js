// The pictures and texts of the page, from the state of both runs.

import { around, equationOf } from "./conserved.js";
import { drawMotion, widened, zoomFor } from "./motion.js";
import { palette, sheet } from "./palette.js";
import { drawCurves, drawPhase, drawRoots, energyRange, errorRange } from "./plots.js";
import { LANES, byId, fate, gain, large, say, short, tellRoots } from "./texts.js";

// States as pictures show them: while it plays, on the way from the state before a step to that after it.
function displayed(page) {
  const { race } = page;
  const now = [...race.runs, race.truth.go(race.k)];
  const share = page.playing ? Math.min(Math.max(page.target / page.dt - race.k, 0), 1) : 1;
  return now.map((state, i) => {
    const before = race.before[i];
    if (!state || !before || share === 1 || state.lost) return state;
    const between = (name) => Float64Array.from(state[name], (x, j) => before[name][j] + share * (x - before[name][j]));
    return { lost: null, v: between("v"), y: between("y"), k: race.k - 1 + share };
  });
}

// The time that pictures show.
const nowOf = (page) => (page.playing ? Math.min(Math.max(page.target, (page.race.k - 1) * page.dt), page.race.k * page.dt) : page.race.k * page.dt);

// Draw what changes in every frame; own are the colours of both methods, trail is the time that a trail goes back.
export function draw(page, own, trailTime) {
  const { race, scene } = page;
  const look = palette();
  const shown = displayed(page);
  const truth = shown[2];
  const pair = scene.phases[page.phase];
  // The true state that is shown is the end of the grey trail, as each run's is of its own.
  const truthTrail = truth && truth.k !== undefined && race.trailEvery === 1 ? [...race.trails[2].slice(0, -1), truth] : race.trails[2];
  const dots = page.dt * 64 > trailTime; // so few states that each gets a dot
  const seen = race.runs.flatMap((run, i) => (run.lost === null ? [race.trails[i][0], run] : [])).filter(Boolean);
  page.zoom = Math.max(page.zoom, zoomFor(scene.ranges, seen));
  const ranges = widened(scene.ranges, page.zoom);
  // The pictures of the motion have one scale; a phase plane has its own, else what grows would hide the other's ellipse.
  const planes = race.runs.map((run, i) => {
    const states = run.lost === null ? [race.trails[i][0], run].filter(Boolean) : [];
    page.zooms[i] = Math.max(page.zooms[i], zoomFor(scene.ranges, states));
    return widened(scene.ranges, page.zooms[i]);
  });
  race.runs.forEach((run, i) => {
    const lane = LANES[i];
    const ellipse = page.ellipses[i] ? around(page.ellipses[i]) : null;
    const mine = { ...look, colour: own[i], dots, ellipse, shears: page.shears[i], truthTrail, now: nowOf(page), dt: page.dt, back: trailTime };
    const trail = shown[i] === run ? race.trails[i] : [...race.trails[i].slice(0, race.trailEvery === 1 ? -1 : undefined), shown[i]];
    drawMotion(sheet(byId(`motion-${lane}`)), scene, ranges, shown[i], truth, trail, mine);
    drawPhase(sheet(byId(`phase-${lane}`)), planes[i], pair, shown[i], truth, trail, mine);
  });
  const dash = page.keys[0] === page.keys[1] ? [6, 5] : [];
  const lines = (of) => [
    { values: of[0], colour: own[0], dash: [] },
    { values: of[1], colour: own[1], dash },
  ];
  const begin = Math.abs(race.energies[0][0]) || 1;
  const energies = [{ values: race.energies[2], colour: look.truth, thick: 3 }, ...lines(race.energies)];
  // A number of the state may begin at zero: its range is then that of the scene.
  const widest = scene.energy ? 2 * begin : 2 * Math.max(...scene.ranges[pair.right[0]][pair.right[1]].map(Math.abs), begin);
  drawCurves(sheet(byId("energy")), race.t, energies, energyRange(race.energies, widest), look, false);
  if (race.truth.until > 0) drawCurves(sheet(byId("error")), race.t, lines(race.errors), errorRange(race.errors), look, true);
}

// Write and draw what changes seldom: texts, descriptions and roots; announce is called with what has become of a run; lanes are those of which
// roots are found, which takes long.
export function tell(page, methods, own, announce, lanes) {
  const { race, scene } = page;
  const look = palette();
  race.runs.forEach((run, i) => {
    const lane = LANES[i];
    if (!lanes.includes(lane)) return;
    const method = methods.get(page.keys[i]);
    page.roots[i] = run.roots();
    page.trueRoots[i] = race.truth.roots(run);
    drawRoots(sheet(byId(`roots-${lane}`)), page.roots[i], page.trueRoots[i], scene.linear, { ...look, colour: own[i] });
    const kept = page.ellipses[i] ? `: stays on the ellipse ${equationOf(page.ellipses[i])}` : "";
    const shears = page.shears[i] ? `. A step is two shears: first ${page.shears[i] === "vy" ? "v, then y" : "y, then v"}` : "";
    say(`phase-told-${lane}`, `${lane.toUpperCase()}, phase plane${kept}${shears}`);
    say(`roots-told-${lane}`, tellRoots(page, i));
    say(`error-${lane}`, large(race.errors[i].at(-1)));
    say(`gain-${lane}`, scene.energy ? gain(race.energies[i]) : "");
    say(`told-${lane}`, `order ${method.order} · ${method.evaluations} evaluation${method.evaluations > 1 ? "s" : ""} a step`);
    const ends = fate(run);
    if (ends && ends !== page.told[i]) announce(`${method.title}: ${ends}`);
    page.told[i] = ends;
    say(`lost-${lane}`, ends);
    byId(`motion-${lane}`).setAttribute("aria-label", `Motion of ${scene.title} by ${method.title} at t = ${short(run.t)}. ${ends}`);
    byId(`phase-${lane}`).setAttribute("aria-label", `Phase plane, ${scene.phases[page.phase].label}, by ${method.title}`);
    byId(`roots-${lane}`).setAttribute("aria-label", tellRoots(page, i));
  });
  const behind = page.playing && page.slow ? ", slowed" : "";
  say("clock", `t = ${short(race.k * race.dt)}, step ${race.k}${behind}`);
  const watched = scene.energy ? "Energy" : scene.phases[page.phase].right[2];
  say("watched", scene.energy ? "Energy" : `${watched} over time`);
  byId("energy").setAttribute("aria-label", `${watched} over time: A ${short(race.energies[0].at(-1))}, B ${short(race.energies[1].at(-1))}, true ${short(race.energies[2].at(-1))}`);
  byId("error").setAttribute("aria-label", `Error over time: A ${short(race.errors[0].at(-1), 2)}, B ${short(race.errors[1].at(-1), 2)}`);
  const until = race.truth.until;
  const about = until < Infinity && until > 0 ? `, known up to t = ${short(until)}` : "";
  say("truth", race.truth.about + about);
}

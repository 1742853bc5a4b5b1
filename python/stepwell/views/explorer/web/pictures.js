// The pictures and texts of the page, from the state of both runs.

import { drawMotion, widened, zoomFor } from "./motion.js";
import { palette, sheet } from "./palette.js";
import { drawCurves, drawPhase, drawRoots, energyRange, errorRange } from "./plots.js";
import { LANES, byId, fate, say, short, tellRoots } from "./texts.js";

// States as pictures show them: while it plays, on the way from the state before a step to that after it.
function displayed(page) {
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

// Draw what changes in every frame; own are the colours of both methods, trail is the time that a trail goes back.
export function draw(page, own, trailTime) {
  const { race, scene } = page;
  const look = palette();
  const shown = displayed(page);
  const truth = shown[2];
  const pair = scene.phases[page.phase];
  const dots = page.dt * 64 > trailTime; // so few states that each gets a dot
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

// Write and draw what changes seldom: texts, descriptions and roots; announce is called with what has become of a run.
export function tell(page, methods, own, announce) {
  const { race, scene } = page;
  const look = palette();
  race.runs.forEach((run, i) => {
    const lane = LANES[i];
    const method = methods.get(page.keys[i]);
    page.roots[i] = run.roots();
    drawRoots(sheet(byId(`roots-${lane}`)), page.roots[i], { ...look, colour: own[i] });
    say(`roots-told-${lane}`, tellRoots(page, i));
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
    byId(`roots-${lane}`).setAttribute("aria-label", tellRoots(page, i));
  });
  const behind = page.playing && page.slow ? ", slowed" : "";
  say("clock", `t = ${short(race.k * race.dt)}, step ${race.k}${behind}`);
  byId("energy").setAttribute("aria-label", `Energy over time: A ${short(race.energies[0].at(-1))}, B ${short(race.energies[1].at(-1))}, true ${short(race.energies[2].at(-1))}`);
  byId("error").setAttribute("aria-label", `Error over time: A ${short(race.errors[0].at(-1), 2)}, B ${short(race.errors[1].at(-1), 2)}`);
  const until = race.truth.until;
  const about = until < Infinity && until > 0 ? `, known up to t = ${short(until)}` : "";
  say("truth", race.truth.about + about);
}

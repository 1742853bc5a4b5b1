// Exact solutions that have formulas: of a time, and the parameters and start of a scene, a state { v, y }; null if there is none.

export const TRUTHS = {
  oscillator(t, { m, v, y }) {
    const [c, s] = [Math.cos(m.omega * t), Math.sin(m.omega * t)];
    return { v: [v[0] * c - y[0] * s], y: [y[0] * c + v[0] * s] };
  },

  // The steady swing, and the dying one that joins it to the start.
  forced_oscillator(t, { m, v, y }) {
    const [w, d, drive] = [m.omega, m.damping, m.a_omega];
    const stiff = w * w - drive * drive;
    const lag = 2 * d * w * drive;
    const below = stiff * stiff + lag * lag;
    if (!(d < 1) || below < 1e-12) return null;
    // a·sin(drive·t + phase) gives share·(stiff·sin − lag·cos).
    const share = m.a_amplitude / below;
    const steady = (time) => {
      const [s, c] = [Math.sin(drive * time + m.a_phase), Math.cos(drive * time + m.a_phase)];
      return { y: share * (stiff * s - lag * c), v: share * drive * (stiff * c + lag * s) };
    };
    const begin = steady(0);
    const [y0, v0] = [y[0] - begin.y, v[0] - begin.v];
    const free = w * Math.sqrt(1 - d * d);
    const [c, s, decay] = [Math.cos(free * t), Math.sin(free * t), Math.exp(-d * w * t)];
    const along = (v0 + d * w * y0) / free;
    const now = steady(t);
    return {
      y: [now.y + decay * (y0 * c + along * s)],
      v: [now.v + decay * (v0 * c - (d * w * along + free * y0) * s)],
    };
  },

  sliding_block(t, { m, v, y }) {
    const friction = m.friction_limit;
    const moving = Math.min(t, v[0] / friction);
    return { v: [Math.max(v[0] - friction * t, 0)], y: [y[0] + (v[0] - 0.5 * friction * moving) * moving] };
  },

  // From rest at y = 1, with k = m = 1: each half swing is half a cosine about ± the friction.
  sticking_block(t, { m, v, y }) {
    const friction = m.friction_limit;
    if (m.omega !== 1 || v[0] !== 0 || y[0] !== 1) return null;
    const last = Math.max(0, Math.ceil((1 - friction) / (2 * friction)));
    const swing = Math.min(Math.max(Math.floor(t / Math.PI), 0), last);
    const side = swing % 2 ? -1 : 1;
    const amplitude = swing < last ? 1 - (2 * swing + 1) * friction : 0;
    const rest = swing < last ? friction : 1 - 2 * last * friction;
    const angle = t - Math.PI * swing;
    return { v: [-side * amplitude * Math.sin(angle)], y: [side * (rest + amplitude * Math.cos(angle))] };
  },

  // A ball dropped from rest over a floor at height 0, and led on at the same velocity along it.
  bouncing_ball(t, { m, v, y }) {
    const g = -m.gravity[1];
    const e = m.contact_0_restitution;
    if (!(g > 0) || v[1] !== 0 || !(e >= 0 && e <= 1)) return null;
    const fall = Math.sqrt((2 * y[1]) / g);
    const along = { v: v[0], y: y[0] + v[0] * t };
    const state = (velocity, height) => ({ v: [along.v, velocity], y: [along.y, height] });
    if (t < fall) return state(-g * t, y[1] - 0.5 * g * t * t);
    let since = t - fall;
    let up = e * g * fall;
    for (let impacts = 0; impacts < 10000 && up > 1e-17 * g * fall; impacts++) {
      const flight = (2 * up) / g;
      if (since < flight) return state(up - g * since, (up - 0.5 * g * since) * since);
      since -= flight;
      up *= e;
    }
    return state(0, 0);
  },
};

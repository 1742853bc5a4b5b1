// The energy of a state, by the kind of its system. v and y are flat; p holds the parameters.

export const ENERGIES = {
  oscillator: (p, v, y) => 0.5 * (v[0] * v[0] + p.omega * p.omega * y[0] * y[0]),

  pendulum(p, v, y) {
    const half = Math.sin(0.5 * y[0]);
    return 0.5 * v[0] * v[0] + 2 * p.omega * p.omega * half * half;
  },

  chain(p, v, y) {
    const n = p.mass.length;
    let sum = 0;
    for (let i = 0; i < n; i++) sum += p.mass[i] * v[i] * v[i];
    for (let i = 0; i <= n; i++) {
      const stretch = (i < n ? y[i] : 0) - (i > 0 ? y[i - 1] : 0);
      sum += p.stiffness[i] * stretch * stretch;
    }
    return 0.5 * sum;
  },

  bodies(p, v, y) {
    const { masses, Gm, dim } = p;
    let sum = 0;
    for (let i = 0; i < masses.length; i++) {
      for (let c = 0; c < dim; c++) sum += 0.5 * masses[i] * v[dim * i + c] ** 2;
      for (let j = 0; j < i; j++) {
        let square = p.softening * p.softening;
        for (let c = 0; c < dim; c++) square += (y[dim * i + c] - y[dim * j + c]) ** 2;
        sum += masses[i] * Gm[j] * (p.law === "logarithmic" ? 0.5 * Math.log(square) : -1 / Math.sqrt(square));
      }
    }
    return sum;
  },

  // Points, one for each mass, under gravity alone; what rods and floors do is no energy.
  falling(p, v, y) {
    const dim = p.gravity.length;
    let sum = 0;
    for (let i = 0; i < v.length; i++) sum += p.masses[(i - (i % dim)) / dim] * (0.5 * v[i] * v[i] - p.gravity[i % dim] * y[i]);
    return sum;
  },

  restricted({ mu }, v, y) {
    const across = y[1] * y[1];
    const pull = (1 - mu) / Math.sqrt((y[0] + mu) ** 2 + across) + mu / Math.sqrt((y[0] - 1 + mu) ** 2 + across);
    return 0.5 * (v[0] * v[0] + v[1] * v[1]) - 0.5 * (y[0] * y[0] + across) - pull;
  },

  // A fixed particle has no part in kinetic energy and gravity: free is 0 for it, and 1 for others.
  springs(p, v, y) {
    const dim = p.gravity.length;
    const moved = p.masses.map((mass, i) => mass * p.free[i]);
    let sum = ENERGIES.falling({ masses: moved, gravity: p.gravity }, v, y);
    p.pairs.forEach(([i, j], k) => {
      let square = 0;
      for (let c = 0; c < dim; c++) square += (y[dim * j + c] - y[dim * i + c]) ** 2;
      const stretch = Math.sqrt(square) - p.rest[k];
      sum += 0.5 * p.stiffness[k] * stretch * stretch;
    });
    return sum;
  },

  // Of a rigid body: the height of its centre above the fixed point is the third row of the rotation by the quaternion y.
  body(p, v, y) {
    const [a, b, c, d] = y;
    const up = [2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c];
    const height = up.reduce((sum, x, i) => sum + x * p.centre[i], 0) / (a * a + b * b + c * c + d * d);
    return 0.5 * p.inertia.reduce((sum, own, i) => sum + own * v[i] * v[i], 0) + p.weight * height;
  },
};

"""A galaxy that passes by draws a tail out of another one
=======================================================

Toomre and Toomre (1972): rings of stars without mass circle one heavy centre, and a
second one passes. One side of the disc is drawn out into a bridge, the other into a
tail.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

STARS = (80, 120, 160, 200, 240)  # in each ring

radii = np.repeat([0.2, 0.3, 0.4, 0.5, 0.6], STARS)
angle = np.concatenate(
    [np.linspace(0.0, 2.0 * np.pi, n, endpoint=False) for n in STARS]
)
masses = np.r_[1.0, 1.0, np.zeros(len(radii))]
ring = np.stack([radii * np.cos(angle), radii * np.sin(angle)], axis=1)
turn = np.stack([-np.sin(angle), np.cos(angle)], axis=1) / np.sqrt(radii)[:, None]

# Two centres on a parabola, nearest at distance 1 at t = 0, begun when they are 4
# apart; the disc is round the first.
apart = 4.0
# tan of half the angle along the parabola r = 1 + tangent²
tangent = np.sqrt(apart - 1.0)
place = np.array([1.0 - tangent**2, -2.0 * tangent])
along = np.sqrt(2.0 * 2.0) * np.array([tangent, 1.0]) / (1.0 + tangent**2)
# Barker's equation, for a total mass of 2
before = np.sqrt(2.0 / 2.0) * (tangent + tangent**3 / 3.0)
y = np.vstack([[0.0, 0.0], place, ring])
v = np.vstack([[0.0, 0.0], along, turn])
bodies = sw.NBody(masses, force="newton", softening=0.05)
run = sw.integrate(bodies, "leapfrog", v=v, y=y, dt=0.01, steps=750, every=10)
from_first = run.y - run.y[:, :1]
closest = np.linalg.norm(from_first[:, 1], axis=1)
assert abs(closest.min() - 1.0) < 0.05
assert abs(run.t[closest.argmin()] - before) < 0.3
assert np.linalg.norm(from_first[-1, 2:], axis=1).max() > 2.0  # a tail
assert np.linalg.norm(from_first[0, 2:], axis=1).max() < 0.61

figure, shown = plt.subplots(1, 3, figsize=(9.0, 3.8), dpi=120, layout="constrained")
nearest = int(closest.argmin())
for axes, saved in zip(shown, (nearest, nearest + 10, nearest + 20), strict=True):
    places = from_first[saved]
    axes.plot(*places[2:].T, ".", color="#175ca6", markersize=2.5)
    axes.plot(0.0, 0.0, "o", color="#111111", markersize=7)
    axes.plot(*places[1], "o", color="#c75a22", markersize=7)
    axes.set(aspect="equal", xlim=(-2.2, 2.2), ylim=(-2.2, 2.2), xticks=[], yticks=[])
    axes.set_title(f"t = {run.t[saved] - before:+.1f}")

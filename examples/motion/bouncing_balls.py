"""Each ball comes to rest when its series of bounces predicts
===========================================================

Six balls with six restitutions e fall from 1 m in one call. A bounce leaves the speed
e·u, so the times between bounces are a geometric series, and the ball rests at (1 +
e)/(1 − e)·√(2·height/g).
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

G, DT = 9.81, 1 / 240
restitution = np.array([0.2, 0.4, 0.55, 0.65, 0.75, 0.8])
balls = sw.Particles(gravity=G, floor=sw.Floor(restitution=restitution), dim=1)
run = sw.integrate(
    balls, "leapfrog", v=0.0, y=np.ones((1, 1, 6)), dt=DT, steps=1200, every=1
)
height = run.y[:, 0, 0]
rests = np.array([run.t[np.flatnonzero(each > 1e-12)[-1] + 1] for each in height.T])
series = (1 + restitution) / (1 - restitution) * np.sqrt(2 / G)
assert np.abs(rests / series - 1).max() < 0.05

figure, both = plt.subplots(
    2, 3, figsize=(9.0, 4.4), dpi=120, layout="constrained", sharex=True, sharey=True
)
for axes, each, e, when in zip(
    both.ravel(), height.T, restitution, series, strict=True
):
    axes.plot(run.t, each, color="#175ca6", linewidth=1.6)
    axes.axvline(when, color="#c75a22", linewidth=1.6, linestyle="--")
    axes.text(when + 0.1, 0.75, f"series:\n{when:.2f} s", color="#c75a22")
    axes.set_title(f"e = {e:g}")
    axes.spines[["top", "right"]].set_visible(False)
figure.supxlabel("time in s")
figure.supylabel("height in m")

"""What an error costs, by five methods
====================================

Error against function evaluations on the clover leaf (Appendix C): the further to the
lower left, the better. For one digit it hardly matters; for six, DOP853 needs a
hundredth of what leapfrog needs.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

METHODS = {
    "false_euler": "#efb02e",
    "leapfrog": "#25a985",
    "standard_heun": "#c75a22",
    "rk4": "#175ca6",
    "dop853": "#10123a",
}
scene = sw.scenes.clover()
figure, axes = plt.subplots(figsize=(7.2, 5.2), dpi=120, layout="constrained")
needed = {}
for name, colour in METHODS.items():
    method = sw.method(name)
    steps = np.geomspace(40, 30_000 if name != "dop853" else 900, 14).astype(int)
    runs = [scene.run(name, dt=scene.horizon / n, steps=int(n), every=1) for n in steps]
    error = np.array([scene.state_error(run).max() for run in runs])
    cost = method.evaluations * steps / scene.horizon
    usable = error < 1.0
    axes.loglog(
        cost[usable], error[usable], "o-", color=colour, linewidth=2, markersize=4
    )
    axes.text(
        cost[-1] * 1.15,
        error[-1],
        method.title,
        color=colour,
        weight="bold",
        va="center",
    )
    needed[name] = cost[error < 1e-6].min(initial=np.inf)
assert needed["dop853"] < 0.05 * needed["leapfrog"]
axes.set(
    xlabel="function evaluations per unit of time",
    ylabel="largest error of the run",
    xlim=(1, 8e4),
)
axes.spines[["top", "right"]].set_visible(False)

"""Where bodies meet, adaptive steps need a tenth
==============================================

Two bodies on a narrow ellipse. A fixed step must be as short as the closest approach
asks for; adaptive steps are that short only there. Dots are runs; those of DOP853
differ by their tolerance.
"""

import matplotlib.pyplot as plt
import numpy as np
import stepwell as sw

scene = sw.scenes.kepler(e=0.9)
turns = np.linspace(0.0, scene.period, 11)[1:]


def error(run):
    return scene.state_error(run)[-1]


figure, axes = plt.subplots(figsize=(7.2, 5.0), dpi=120, layout="constrained")
cheapest = {}
for name, colour, place in (
    ("leapfrog", "#25a985", (1.2e4, 0.5)),
    ("rk4", "#175ca6", (2.8e4, 2e-4)),
    ("dop853", "#8a8a8a", (2.2e4, 3e-11)),
):
    steps = np.geomspace(2000, 40_000 if name != "dop853" else 8000, 9).astype(int)
    found = [error(scene.run(name, dt=scene.period / n, steps=int(n))) for n in steps]
    cost = steps * sw.method(name).evaluations
    axes.loglog(cost, found, "o-", color=colour, linewidth=2, markersize=4)
    axes.text(
        *place,
        f"{sw.method(name).title}, fixed steps",
        color=colour,
        ha="right" if name == "dop853" else "left",
    )
    cheapest[name] = cost[np.array(found) < 1e-6].min(initial=10**9)
tolerances = 10.0 ** -np.arange(2.0, 12.5)
start = {"v": scene.v, "y": scene.y, "at": turns}
runs = [
    sw.integrate(scene.system, "dop853", tolerance=tolerance, **start)
    for tolerance in tolerances
]
cost, found = (
    np.array([int(run.paces.evaluations) for run in runs]),
    np.array([error(run) for run in runs]),
)
assert cost[found < 1e-6].min() < 0.1 * min(cheapest["leapfrog"], cheapest["rk4"])
axes.loglog(cost, found, "o-", color="#10123a", linewidth=2.5, markersize=5)
axes.text(
    1.1e3,
    1e-5,
    "Dormand-Prince 8(5,3),\nadaptive steps",
    color="#10123a",
    weight="bold",
)
axes.set(
    xlabel="function evaluations in one turn",
    ylabel="error after one turn",
    ylim=(1e-12, 10.0),
    xlim=(1e2, 3e5),
)
axes.spines[["top", "right"]].set_visible(False)

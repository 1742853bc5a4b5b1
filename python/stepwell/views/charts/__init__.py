"""Charts: data objects with ``.plot()``, ``.to_csv()``, ``.to_json()`` and ``.summary()``."""

from ...studies.measuring import peers
from ...studies.measuring.data import Curve, Point, Timing, WorkPrecision
from ...studies.measuring.peers import Peer, Solved
from ...studies.measuring.work_precision import work_precision
from .bode import Bode, MethodResponse, bode
from .control import ControlSweep, control
from .control_runs import Held
from .figures import Figures, Samples, figures
from .maps import Observation, StabilityMap, stability_map
from .norm import NormSweep, Settled, norm
from .panel import Panel, panel
from .runs import RunPicture, run_picture
from .verlet_friction import VerletFriction, verlet_friction
from .zplane import Locus, Stability, stability

__all__ = [
    "Bode", "ControlSweep", "Curve", "Figures", "Held", "Locus", "MethodResponse", "NormSweep", "Observation", "Panel", "Peer",
    "Point", "RunPicture", "Samples", "Settled", "Solved", "Stability", "StabilityMap", "Timing", "VerletFriction",
    "WorkPrecision", "bode", "control", "figures", "norm", "panel", "peers", "run_picture", "stability", "stability_map",
    "verlet_friction", "work_precision",
]  # fmt: skip

"""Charts: data objects with ``.plot()``, ``.to_csv()``, ``.to_json()`` and ``.summary()``."""

from . import peers
from .control import ControlSweep, control
from .control_runs import Held
from .data import Curve, Point, Timing, WorkPrecision
from .figures import Figures, Samples, figures
from .maps import Observation, StabilityMap, stability_map
from .norm import NormSweep, Settled, norm
from .panel import Panel, panel
from .peers import Peer, Solved
from .powers import Powers, powers
from .runs import RunPicture, run_picture
from .verlet_friction import VerletFriction, verlet_friction
from .work_precision import work_precision
from .zplane import Locus, Stability, stability

__all__ = [
    "ControlSweep",
    "Curve",
    "Figures",
    "Held",
    "Locus",
    "NormSweep",
    "Observation",
    "Panel",
    "Peer",
    "Point",
    "Powers",
    "RunPicture",
    "Samples",
    "Settled",
    "Solved",
    "Stability",
    "StabilityMap",
    "Timing",
    "VerletFriction",
    "WorkPrecision",
    "control",
    "figures",
    "norm",
    "panel",
    "peers",
    "powers",
    "run_picture",
    "stability",
    "stability_map",
    "verlet_friction",
    "work_precision",
]

"""Charts: data objects with ``.plot()``, ``.to_csv()``, ``.to_json()`` and ``.summary()``."""

from . import peers
from .control import ControlSweep, control
from .control_runs import Held
from .data import Curve, Point, Timing, WorkPrecision
from .figures import Figures, Samples, figures
from .maps import Observation, StabilityMap, stability_map
from .panel import Panel, panel
from .peers import Peer, Solved
from .powers import Powers, powers
from .runs import RunPicture, run_picture
from .work_precision import work_precision
from .zplane import Locus, Stability, stability

__all__ = [
    "ControlSweep",
    "Curve",
    "Figures",
    "Held",
    "Locus",
    "Observation",
    "Panel",
    "Peer",
    "Point",
    "Powers",
    "RunPicture",
    "Samples",
    "Solved",
    "Stability",
    "StabilityMap",
    "Timing",
    "WorkPrecision",
    "control",
    "figures",
    "panel",
    "peers",
    "powers",
    "run_picture",
    "stability",
    "stability_map",
    "work_precision",
]

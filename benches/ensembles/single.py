"""One sweep by one contestant, in a process of its own: its name, the sweep, two sizes, and a file for the outcomes.

It makes a small sweep first, so that everything is imported and compiled, then the one that is timed. Prints a line of JSON.
"""

from __future__ import annotations

import importlib
import json
import resource
import sys
import time

import numpy as np


def main(contestant: str, name: str, size: str, small: str, path: str) -> None:
    """Measure, and leave the outcomes in a file."""
    begin = time.perf_counter()
    run = importlib.import_module(f"benches.ensembles.{contestant}_{name}").run
    run(int(small))
    ready = time.perf_counter()
    found = run(int(size))
    end = time.perf_counter()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    np.save(path, found)
    print(json.dumps({"ready": ready - begin, "seconds": end - ready, "peak": peak}))


if __name__ == "__main__":
    main(*sys.argv[1:])

"""A cloth over a floor, exported to C and JavaScript, beside ``World``: the time of a step, of the export and of the compiler.

    python -m benches.export                       # cloths of 500, 2000 and 20 000 springs
    python -m benches.export --springs 500 --method rk4

Each turn times all three, one after the other, in processes that stay, so that what else the machine does meets all alike; a row
is the median of the turns, a ratio the median of the ratios of each turn with the range of the middle half. The error is that of
the last state against ``World``: the greatest difference of a coordinate, which is 0 as the bits are the same.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
import stepwell as sw

#: Turns, of which the first are not counted, since JavaScript is compiled meanwhile; and the seconds of a turn by ``World``.
TURNS, BEFORE, SECONDS = 25, 4, 0.02

#: The step of all.
DT = 0.002

FLAGS = ["-O2", "-ffp-contract=off"]

C = r"""#include <stdio.h>
#include <time.h>
#include "cloth.c"

static cloth m;
static cloth_state s;
static double v[NUMBERS], y[NUMBERS];

int main(void) {
    FILE *begin = fopen("begin", "rb");
    if (!begin || fread(y, sizeof y, 1, begin) != 1) return 1;
    cloth_defaults(&m);
    cloth_start(&m, &s, v, y);
    for (int steps; scanf("%d", &steps) == 1;) {
        struct timespec a, b;
        clock_gettime(CLOCK_MONOTONIC, &a);
        for (int k = 0; k < steps; k++) cloth_step(&m, &s);
        clock_gettime(CLOCK_MONOTONIC, &b);
        FILE *end = fopen("end_c", "wb");
        fwrite(s.y, sizeof s.y, 1, end);
        fclose(end);
        printf("%.9g\n", (double)(b.tv_sec - a.tv_sec) + 1e-9 * (double)(b.tv_nsec - a.tv_nsec));
        fflush(stdout);
    }
    return 0;
}
"""

JAVASCRIPT = """import { readFileSync, writeFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { Cloth } from "./cloth.mjs";

const bytes = readFileSync("begin");
const y = new Float64Array(bytes.buffer, bytes.byteOffset, NUMBERS);
const m = new Cloth();
const s = m.start(new Float64Array(NUMBERS), y);
for await (const line of createInterface({ input: process.stdin })) {
  const begin = performance.now();
  for (let k = 0; k < Number(line); k++) m.step(s);
  const seconds = (performance.now() - begin) / 1000;
  writeFileSync("end_javascript", s.y);
  console.log(seconds);
}
"""


def cloth(springs: int, floor: bool) -> tuple[sw.Springs, Any]:
    """A square of about so many springs, along the sides and one diagonal of its meshes, that falls upon a floor."""
    n = max(2, round((1 + math.sqrt(1 + 3 * (springs - 1))) / 3))
    at = 0.1 * np.array([[i, 3.0 + 0.01 * (i % 3), j] for i in range(n) for j in range(n)])
    pairs = [(n * i + j, n * (i + a) + j + b) for a, b in ((1, 0), (0, 1), (1, 1)) for i in range(n - a) for j in range(n - b)]
    options = {"floor": sw.Floor(restitution=0.2, friction=0.3, normal=(0.0, 1.0, 0.0), offset=0.28)} if floor else {}
    return sw.Springs(pairs, stiffness=500.0, damping=0.5, gravity=[0.0, -9.81, 0.0], layout=at, **options), at


class Exported:
    """An exported cloth, or another system of places, in a process of its own, timed by this clock of C."""

    def __init__(
        self, system: sw.System, at: Any, method: str, language: str, folder: Path, clock: str = "CLOCK_MONOTONIC"
    ) -> None:
        begin = time.perf_counter()
        step = sw.export(system, method, cast("Any", language), dt=DT, v=0.0 * at, y=at, name="cloth")
        self.export, self.compile = time.perf_counter() - begin, 0.0
        self.size, self.operations, self._end = len(step.source), step.operations, folder / f"end_{language}"
        at.tofile(folder / "begin")
        command = ["node", "main.mjs"]
        text, ending = (C, ".c") if language == "c" else (JAVASCRIPT, ".mjs")
        (folder / f"cloth{ending}").write_text(step.source, encoding="utf-8")
        text = text.replace("NUMBERS", str(at.size)).replace("CLOCK_MONOTONIC", clock)
        (folder / f"main{ending}").write_text(text, encoding="utf-8")
        if language == "c":
            begin = time.perf_counter()
            subprocess.run(["cc", *FLAGS, "main.c", "-lm", "-o", "main"], cwd=folder, check=True)
            self.compile, command = time.perf_counter() - begin, [str(folder / "main")]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, cwd=folder, stdin=pipe, stdout=pipe, text=True)

    def seconds(self, steps: int) -> float:
        """The seconds of so many steps."""
        to, back = cast("IO[str]", self._process.stdin), cast("IO[str]", self._process.stdout)
        print(steps, file=to, flush=True)
        return float(back.readline())

    def error(self, y: Any) -> float:
        """The greatest difference of a coordinate."""
        return float(np.abs(np.fromfile(self._end) - y.ravel()).max())

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def measured(springs: int, floor: bool, method: str, turns: int = TURNS) -> Iterator[str]:
    """The lines of the table for one cloth."""
    system, at = cloth(springs, floor)
    world = sw.World(system, method, v=0.0 * at, y=at.copy(), dt=DT)
    begin = time.perf_counter()
    world.step(10)
    steps = max(10, round(SECONDS * 10 / (time.perf_counter() - begin)))
    with tempfile.TemporaryDirectory() as name:
        every = {language: Exported(system, at, method, language, Path(name)) for language in ("c", "javascript")}
        for each in every.values():
            each.seconds(10)
        times: dict[str, list[float]] = {"World": [], **{language: [] for language in every}}
        for turn in range(BEFORE + turns):
            begin = time.perf_counter()
            world.step(steps)
            taken = {"World": time.perf_counter() - begin, **{of: each.seconds(steps) for of, each in every.items()}}
            for of, seconds in taken.items():
                times[of] += [1e6 * seconds / steps] * (turn >= BEFORE)
        errors = {of: each.error(np.asarray(world.y)) for of, each in every.items()}
        for each in every.values():
            each.close()
    yield f"{len(system.pairs)} springs{' on a floor' * floor}: World {np.median(times['World']):.1f} µs a step"
    for of, each in every.items():
        low, middle, high = np.quantile(np.divide(times[of], times["World"]), [0.25, 0.5, 0.75])
        yield (
            f"  {of:10} {np.median(times[of]):8.1f} µs, {middle:5.2f} ({low:.2f} to {high:.2f}) of World, error {errors[of]:g}; "
            f"{each.size / 1000:.0f} kB, export {each.export:.1f} s, compiler {each.compile:.1f} s"
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--springs", type=int, nargs="*", default=[500, 2000, 20_000])
    parser.add_argument("--method", default="false_euler")
    parser.add_argument("--turns", type=int, default=TURNS)
    arguments = parser.parse_args()
    for springs in arguments.springs:
        for floor in (False, True):
            for line in measured(springs, floor, arguments.method, arguments.turns):
                print(line, flush=True)


if __name__ == "__main__":
    main()

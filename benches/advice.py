"""Advice beside brute force: ``python -m benches.advice [SCENE …]``.

Prints for each scene and tolerance what is advised, how wrong that is, and what it costs beside the best. Brute force knows
nothing of the search. It makes the runs of all methods over a ladder of numbers of steps, and of all tolerances, in the order of
what they cost, until one is good enough.
"""

from __future__ import annotations

import argparse
import functools
import heapq
import itertools
import math
import sys
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import stepwell as sw
from stepwell.errors import AccuracyWarning, ControlWarning, DivergenceWarning, ToleranceWarning, UnsupportedError
from stepwell.model.methods import Method
from stepwell.scenes import Scene
from stepwell.scenes.table import tabled
from stepwell.scenes.truth import with_truth
from stepwell.studies.advice import Advice, Row, knows_motion

TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)

#: Numbers of steps are this far apart, and tolerances by this power of it, which costs as much with a method of that order. No
#: rung of the search's ladders is meant. Tolerances go down to the last.
RATIO, POWER, LAST = 1.04, 5, 1e-15

#: States of a run that are compared with the truth: a few are enough to refuse it, many to take it.
SOME, ALL = 200, 50_000

#: A run with a tolerance is asked for its state at so many even times, and at so many times as many others, which are even in the
#: path's length.
ASKED, OTHERS = 10, 24

#: The table of the true motion is as close to it as this, in the largest lengths.
CLOSE = 1e-9


#: So many rows of an advice are run in full.
CHECKED = 3


class Try(NamedTuple):
    """A run: by which method, with so many steps, chosen to that tolerance or fixed, what it costs, and how wrong it is."""

    method: str
    steps: int
    tolerance: float | None
    cost: float
    error: float


def _evaluations(method: Method, scene: Scene) -> float:
    """Function evaluations of a step; infinitely many if the method cannot step the scene."""
    try:
        return sw.stability.operations(method, scene.system).rate_evaluations
    except UnsupportedError:
        return math.inf


class Brute:
    """All that can be tried on a scene, with any steps or in frames.

    A step costs its rate evaluations, or what ``prices`` say by the name of a row, ``"merson"`` or ``"merson, tolerance"``.
    """

    def __init__(
        self, scene: Scene, frame: float | None = None, ratio: float = RATIO, prices: Mapping[str, float] | None = None
    ) -> None:
        self.prices: dict[str, float] = {}
        for method in sw.methods():
            self.prices |= {
                method.name: float(_evaluations(method, scene)),
                f"{method.name}, tolerance": float(method.attempt_evaluations),
            }
        self.prices |= prices or {}
        horizon = scene.horizon
        self.frames = None if frame is None else math.ceil(horizon / frame - 1e-9)
        self.end = horizon if frame is None or self.frames is None else frame * self.frames
        known = with_truth(replace(scene, horizon=max(horizon, self.end)))
        assert known.exact is not None
        if known.until < self.end and frame is not None:
            self.frames = math.floor(known.until / frame)
            self.end = frame * self.frames
        else:
            self.end = min(self.end, known.until)
        horizon = min(horizon, self.end)
        # Advice for less may know the motion for longer; it is asked for what is known here.
        self.given = replace(scene, horizon=horizon) if horizon < scene.horizon else scene
        self.frame, self.ratio = frame, ratio
        exact, last = known.exact, min(self.end, known.until)
        scales = replace(known, horizon=horizon).scales_of_numbers
        table = tabled(exact, last, scales, CLOSE)
        self.scene = replace(known, exact=lambda t: table(np.minimum(t, last)), until=math.inf, horizon=horizon)
        times = np.random.default_rng(5).uniform(0.0, last, 500)
        for a, b, scale in zip(table(times), exact(times), scales, strict=True):
            assert (np.abs(a - b) <= 10 * CLOSE * scale).all()
        self._errors: dict[tuple[Any, ...], float] = {}
        self._adaptive: dict[str, list[Try]] = {}
        self._others: dict[tuple[str, float], float] = {}

    # ---- fixed steps

    def error(self, method: str, dt: float, steps: int, samples: int = ALL) -> float:
        """The largest state error of a run with fixed steps, of which so many states are compared."""
        key = (method, dt, steps, samples)
        if key not in self._errors:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DivergenceWarning)
                warnings.simplefilter("ignore", ControlWarning)
                warnings.simplefilter("ignore", AccuracyWarning)
                run = self.scene.run(method, dt, steps=steps, every=max(1, steps // samples))
            self._errors[key] = float(self.scene.state_error(run).max())
        return self._errors[key]

    def counts(self, price: float, most: float) -> Iterator[tuple[float, int]]:
        """Steps and how many, up to that cost."""
        first, span, spans = (4, self.end, 1) if self.frame is None or self.frames is None else (1, self.frame, self.frames)
        last, power = 0, 0
        while (k := round(first * self.ratio**power)) * spans * price <= most:
            if k > last:
                yield span / k, k * spans
            last, power = k, power + 1

    def _ladder(self, i: int, method: Method, most: float) -> Iterator[tuple[float, int, float, int]]:
        price = self.prices[method.name]
        return ((n * price, i, dt, n) for dt, n in self.counts(price, most))

    def fixed(self, tolerance: float, most: float) -> Try | None:
        """The cheapest with fixed steps: runs are made in the order of their cost until one is good enough."""
        able = [each for each in sw.methods() if self._able(each) and not knows_motion(each, self.scene.system)]
        ladders = [self._ladder(i, method, most) for i, method in enumerate(able)]
        for cost, i, dt, n in heapq.merge(*ladders):
            name = able[i].name
            if all(self.error(name, dt, n, samples) <= tolerance for samples in (SOME, ALL)):
                return Try(name, n, None, cost, self.error(name, dt, n))
        return None

    # ---- adaptive steps

    def asked(self) -> Any:
        """When a run with a tolerance is asked for its state: at the frames, or at ten even times."""
        if self.frame is not None and self.frames is not None:
            return self.frame * np.arange(1.0, self.frames + 1)
        return np.linspace(0.0, self.end, ASKED + 1)[1:]

    def adaptive(self, method: str, tolerance: float) -> Try:
        """A run with a tolerance, as wrong as it is anywhere."""
        return self.looked_between(self.judged(method, tolerance))

    def looked_between(self, judged: Try) -> Try:
        """The run with the error of the worst of all times; one that is wrong altogether is left at that."""
        assert judged.tolerance is not None
        if judged.error > 1.0:
            return judged
        return judged._replace(error=max(judged.error, self.between(judged.method, judged.tolerance)))

    def judged(self, method: str, tolerance: float) -> Try:
        """The run itself, as wrong as it is at the times at which it is asked."""
        run = self._integrated(method, tolerance, self.asked())
        assert run.paces is not None
        tried = int(run.paces.evaluations) // sw.method(method).attempt_evaluations - 2 * (len(self.asked()) - 1) * (
            self.frame is None
        )
        error = math.inf if run.status else float(self.scene.state_error(run).max())
        return Try(method, tried, tolerance, tried * self.prices[f"{method}, tolerance"], error)

    def between(self, method: str, tolerance: float) -> float:
        """The largest error of the run at the times between."""
        if (method, tolerance) not in self._others:
            self._others[method, tolerance] = float(
                self.scene.state_error(self._integrated(method, tolerance, self._between)).max()
            )
        return self._others[method, tolerance]

    @functools.cached_property
    def _between(self) -> Any:
        assert self.scene.exact is not None
        t = np.linspace(0.0, self.scene.horizon, 20_001)
        length = np.zeros(20_000)
        for block, scale in zip(self.scene.exact(t), self.scene.scales, strict=True):
            change = np.diff(block.reshape(len(t), -1), axis=0)
            length += np.sqrt((change * change).sum(axis=1)) / (scale or 1.0)
        reached = np.concatenate([[0.0], np.cumsum(length)])
        return np.interp((np.arange(OTHERS * ASKED) + 0.5) / (OTHERS * ASKED) * reached[-1], reached, t)

    def _integrated(self, method: str, tolerance: float, at: Any) -> sw.Run:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ToleranceWarning)
            warnings.simplefilter("ignore", AccuracyWarning)
            return sw.integrate(self.scene.system, method, v=self.scene.v, y=self.scene.y, tolerance=tolerance, at=at)

    def chosen(self, tolerance: float, most: float) -> Try | None:
        """The cheapest with a tolerance, of those that cost no more than ``most``."""
        found: list[Try] = []
        for method in sw.methods():
            if method.error_order is None or method.has_series or self.scene.control is not None:
                continue
            kept = self._adaptive.setdefault(method.name, [])
            while not kept or kept[-1].cost <= most or kept[-1].error == math.inf:
                following = self.ratio ** (-POWER * len(kept))
                if following < LAST:
                    break
                kept.append(self.judged(method.name, following))
            # Only what may be good enough is looked at between as well, the cheapest first.
            maybe = sorted((each for each in kept if each.error <= tolerance and each.cost <= most), key=lambda each: each.cost)
            found += itertools.islice((each for each in map(self.looked_between, maybe) if each.error <= tolerance), 1)
        return min(found, key=lambda each: each.cost, default=None)

    # ---- both

    def best(self, tolerance: float, most: float) -> Try | None:
        """The cheapest of all that costs no more than ``most``, or None."""
        adaptive = self.chosen(tolerance, most)
        return self.fixed(tolerance, most if adaptive is None else adaptive.cost) or adaptive

    def advised(self, row: Row) -> float:
        """The error of a row of advice, run in full."""
        if row.tolerance is None:
            return self.error(row.method.name, row.dt, row.steps)
        return self.adaptive(row.method.name, row.tolerance).error

    def _able(self, method: Method) -> bool:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                self.scene.run(method, 1e-4 * self.scene.dt, steps=1)
            except UnsupportedError:
                return False
        return True

    def cost(self, advice: Advice) -> float:
        """That of the whole run of what is advised; without end if nothing is."""
        return math.inf if advice.best is None else self.prices[advice.best.name] * advice.best.steps


def cell(brute: Brute, tolerance: float) -> str:
    """What is advised, the largest error of the first rows over the tolerance, and the cost over the least there is."""
    begin = time.perf_counter()
    advice = sw.advise(brute.given, frame=brute.frame, tolerance=tolerance, cost="evaluations")
    seconds = time.perf_counter() - begin
    best = advice.best
    if best is None:
        return "nothing fits"
    error = max(brute.advised(row) for row in advice.ranked[:CHECKED])
    cheapest = brute.best(tolerance, brute.cost(advice))
    ratio = brute.cost(advice) / cheapest.cost if cheapest else 1.0
    how = f"{best.substeps or best.steps}" if best.tolerance is None else f"to {best.tolerance:g}"
    said = f"{best.method.name} {how}, error {error / tolerance:.3f}, cost {ratio:.3f}, {seconds:.1f} s"
    print(f"{brute.scene.name} {tolerance:g}: {said}; {cheapest}", file=sys.stderr, flush=True)
    return f"{best.method.name} {how}<br>{error / tolerance:.2f}, {ratio:.2f}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Search, try, show."""
    parser = argparse.ArgumentParser(prog="python -m benches.advice", description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="which scenes (default: all)")
    parser.add_argument("--frame", type=float, help="frame in units of time (default: any step)")
    given = parser.parse_args(arguments)
    scenes = [sw.scenes.scene(name) for name in given.scenes] or sw.scenes.scenes()
    print("| scene | " + " | ".join(f"{tolerance:g}" for tolerance in TOLERANCES) + " |")
    print("|---" * (1 + len(TOLERANCES)) + "|")
    for scene in scenes:
        brute = Brute(scene, given.frame)
        print(f"| {scene.name} | " + " | ".join(cell(brute, tolerance) for tolerance in TOLERANCES) + " |", flush=True)


if __name__ == "__main__":
    main()

"""The power form: the state after n steps of a linear system without the steps between (§4, Appendix B).

A step is s ← P·s + Q·u, so n steps are a power of P, found by squaring. The inputs are carried along as columns that turn into
themselves: 1 for all constants together, and the sine and cosine of each sinusoid's angle. There is no such form in the core: a
run is a few dozen products, whichever backend finds P and Q. Matrices have shape (rows, columns, members).
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Array, Whole
from . import trig
from .product import product, times
from .signal import Constant, Sine

Chosen = np.ndarray[Any, np.dtype[np.bool_]]


class Leap(NamedTuple):
    """``steps`` steps at once from time t: s ← p·s + q·columns(t)."""

    steps: int
    p: Array
    q: Array

    def of(self, members: Chosen) -> "Leap":
        """The leap of some of the members."""
        return Leap(self.steps, self.p[..., members], self.q[..., members])


class Drive:
    """The sinusoids that drive the members, the step, and whether products of matrices are fused."""

    def __init__(self, waves: Sequence[Sine], h: float, *, fused: bool = False) -> None:
        self.waves, self.h, self.fused = waves, h, fused

    def of(self, members: Chosen) -> "Drive":
        """The drive of some of the members."""
        return Drive(
            [Sine(w.amplitude[members], w.omega[members], w.phase[members]) for w in self.waves], self.h, fused=self.fused
        )

    def columns(self, t: Array) -> list[Array]:
        """1, and sine and cosine of each angle at the members' times."""
        angles = [wave.omega * t + wave.phase for wave in self.waves]
        return [np.ones_like(t)] + [f(angle) for angle in angles for f in (trig.sin, trig.cos)]

    def later(self, q: Array, duration: float) -> Array:
        """The q' for which q'·columns(t) = q·columns(t + duration): the sine and cosine of a sum of angles."""
        turned = [q[:, 0]]
        for i, wave in enumerate(self.waves):
            s, c = trig.sin(wave.omega * duration), trig.cos(wave.omega * duration)
            of_sin, of_cos = q[:, 2 * i + 1], q[:, 2 * i + 2]
            turned += [of_sin * c - of_cos * s, of_sin * s + of_cos * c]
        return np.stack(turned, axis=1)

    def after(self, leap: Leap, s: Array, t: Array) -> Array:
        """The state after a leap from s at time t."""
        return times(leap.p, s, fused=self.fused) + times(leap.q, self.columns(t), fused=self.fused)

    def join(self, first: Leap, then: Leap) -> Leap:
        """One leap after the other."""
        q = product(then.p, first.q, fused=self.fused) + self.later(then.q, first.steps * self.h)
        return Leap(first.steps + then.steps, product(then.p, first.p, fused=self.fused), q)

    def power(self, step: Leap, n: int) -> Leap:
        """The leap of n steps, by repeated squaring."""
        square, result = step, step if n & 1 else None
        while n := n >> 1:
            square = self.join(square, square)
            if n & 1:
                result = square if result is None else self.join(result, square)
        assert result is not None
        return result


def one_step(p: Array, q: Array, inputs: Sequence[Constant | Sine], nodes: Sequence[float], drive: Drive) -> Leap:
    """The leap of one step; ``q`` has shape (nodes, inputs, rows, members)."""
    total = np.zeros((len(p), 1 + 2 * len(drive.waves), p.shape[-1]))
    for at_node, node in zip(q, nodes, strict=True):
        columns, wave = np.zeros_like(total), 1
        for effect, signal in zip(at_node, inputs, strict=True):
            if isinstance(signal, Sine):
                columns[:, wave] = effect * signal.amplitude
                wave += 2
            else:
                columns[:, 0] = columns[:, 0] + effect * signal.value
        total = total + drive.later(columns, node * drive.h)
    return Leap(1, p, total)


def run(step: Leap, drive: Drive, s: Array, first_bad: Whole, *, t0: Array, first: int, saves: Iterable[int]) -> Iterator[Array]:
    """The states at ``saves``, steps counted from number ``first``; ``first_bad`` gets the steps at which members diverged."""
    leaps: dict[int, Leap] = {}
    done = 0
    for save in saves:
        if n := save - done:
            leaps[n] = leaps[n] if n in leaps else drive.power(step, n)
            t = np.asarray(t0 + (first + done) * drive.h, dtype=np.float64)
            following = drive.after(leaps[n], s, t)
            bad = (first_bad < 0) & ~np.isfinite(following).all(axis=0)
            if bad.any():
                first_bad[bad] = _first_bad(step.of(bad), drive.of(bad), s[:, bad], t0[bad], first + done, n)
            s, done = following, save
        yield s


def _first_bad(step: Leap, drive: Drive, s: Array, t0: Array, k: int, n: int) -> Whole:
    """The first steps whose states are not finite, of members that are finite at step k and not n steps later.

    The leaps of 1, 2, 4, … steps, the longest first: each is made by the members that are still finite after it.
    """
    leaps = [step]
    while 2 * leaps[-1].steps < n:
        leaps.append(drive.join(leaps[-1], leaps[-1]))
    done = np.zeros(s.shape[1:], dtype=np.int64)
    for leap in reversed(leaps):
        tried = drive.after(leap, s, np.asarray(t0 + (k + done) * drive.h, dtype=np.float64))
        good = np.isfinite(tried).all(axis=0) & (done + leap.steps < n)
        s, done = np.where(good, tried, s), done + np.where(good, leap.steps, 0)
    return np.asarray(k + done + 1, dtype=np.int64)

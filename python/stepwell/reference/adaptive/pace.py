"""The first step of a run with a tolerance, and the decision after an attempt.

The increments of a step h are h times those of a step of 1, so a system is scaled once and stretched to every step.
"""

from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Array
from .. import mass
from ..acceptance import Acceptance
from ..bits import at_most, less, where
from ..tableau import Increments
from .attempts import Attempted, Pair, Tried, tried, within
from .controller import MAX_FACTOR, MIN_FACTOR, MOVES, Outlook, Pace
from .sizes import component, largest, longer, numbers_in, sizes, stacked, total

#: A new step is the old one times SAFETY·r^(−5/32)·p^(1/16), r being the error over the tolerance and p that of the step before
#: (PI control, Gustafsson 1988), limited to MIN_FACTOR and MAX_FACTOR; after a rejected step there is no p and no growth. Where
#: the error is estimated in a higher order than LOW, it is SAFETY·r^(−3/32)·p^(1/32). The powers are dyadic so that square roots
#: make them, which are the same to the last bit everywhere.
SAFETY = 0.9
LOW = 5
#: r below TINY counts as TINY; p's root, the sixteenth or the thirty-second, is that of 1e-4 or more.
TINY, CALM_ROOTS = 1e-10, (0.5623413251903491, 0.7498942093324558)
#: A size counts as no less than this part of the largest that the group has been: 2⁻⁵¹², half of the range of numbers. What
#: decays to nothing is followed until then.
LEAST_PART = 1.0 / (1 << 512)
#: Rates that are differences of larger numbers are wrong by the rounding of these, of which the controller knows nothing, and no
#: step makes the error small beside a size that has become less than that. So the error of a group is rounding
#:
#: - where a shorter step fails, too, with an error that did not fall by the power 3/2 of the length (that of smooth rates falls
#:   by 3 and more), while the group changes by less than SLOW times the fourth root of the tolerance, so that it is no motion; or
#:   by PUSHES times its size and more, for a force that sets in where next to nothing is left looks alike. Where it is no such
#:   push it is at most ROUNDINGS times what is lost in the largest size so far: beside a pole errors do not fall either
#:   (with algebraic equations it may be any, see ``small_of``);
#: - where a group stands, its error being UNLIKE times its change, though that is HOLDS_DOWN of what is tolerated or more (but
#:   no more than is tolerated or known: at the limit of stability a deviation stands, too, and would grow with what is known);
#: - where it is no more than ALIKE times what is known of it.
#:
#: From then on ROUNDED times such an error in the same time is tolerated, up to the tolerance of the largest size so far. That
#: fades by FADES a step.
SLOW, PUSHES, UNLIKE, HOLDS_DOWN, ALIKE, ROUNDED, FADES, ROUNDINGS = 0.75, 1024.0, 8.0, 0.125, 4.0, 4.0, 15.0 / 16.0, 2.0
#: A change of y in a step that is smaller than this, relative to the largest size of y so far, is lost in rounding, with some
#: margin. So an error of v that moves y by less is tolerated, however small v is: near rest, where forces cancel, v is only
#: rounding.
ROUNDING = 1.0 / (1 << 40)
#: As ``ROUNDING``, for states of float32, whose roundings are 2²⁹ times as large.
SINGLE_ROUNDING = 1.0 / (1 << 11)
#: A component that has been zero so far counts as this part of the largest in its block. A cascade or a wave reaches one
#: component after the other, each at first with a power of the time that is beyond the order of the method: relative to itself
#: its first step would always be all wrong, however short.
ONSET = 1.0 / (1 << 40)
#: A jump of a force is met by ever shorter steps until one errs by no more than the tolerance of the length that the push would
#: have made in this part of the time since the start: it must be long beside the roundings of time, and short beside the motion
#: that follows.
PUSHED = 1.0 / 64.0
#: Where nothing moves and all rates are zero, the estimate of zero means nothing. The next step is then no longer than QUIET
#: times the time since the start, or than this one: so it does not step over what begins later, unless that lasts for less.
QUIET = 1.0 / 32.0
#: The most by which a coarse estimate e₃ may exceed a finer one, times √e₃, e₃ relative to the size. Where rates are smooth, that
#: is a constant of the motion and not of the step: 5 to 20 in nine of ten steps of eight motions at tolerances of 1e-3 to 1e-12.
SMOOTH = 32.0
#: Rates that differ within a step by more than WILD of the size, by the coarse estimate, while the finer one is more than CHANCE
#: times less: a pole within the step, of which the method happens to be exact. By Fehlberg's it is 0.96 and 10¹¹ at least; of
#: 55 000 steps of tame and of stiff motions none had more than 330 times where rates differed by a tenth.
WILD, CHANCE = 0.5, 1024.0
#: States within a step take steps of their own where so many times what is tolerated of a group at one end is more than the group
#: is at the other.
CHANGES = 32.0
#: The error over the tolerance that a step counts as which makes a component negative that has to stay positive.
OUTSIDE = 16.0
#: The first step is the fraction FIRST of the time in which the state changes, at the start and at two times ahead: rather too
#: short than too long, since it then grows by MAX_FACTOR a step. After a jump it is MIN_FACTOR times the step
#: before.
FIRST = 0.01


def begin(
    s: Any,
    pace: Pace,
    v: Array,
    y: Array,
    block_axes: tuple[int, int],
    groups: tuple[int, ...] = (),
    *,
    series: bool = False,
    moves: float = MOVES,
) -> Pace:
    """The pace at the start, from the time and the tolerance. A first step that is below zero is chosen here.

    It is a share of the shortest time in which a group changes by its size: |v|/|v̇|, |y|/|ẏ| and, from rest, √(|y|/|v̇|), times
    that do not depend on the units of v and y. As the rates at one time may be small by chance, they are evaluated twice more,
    in the middle and at the end of the step. ``s`` is scaled to a step of 1; ``series`` says whether the method is one; ``moves``
    is ``MOVES`` or that of float32.
    """
    with np.errstate(all="ignore"):
        rates = s.dv(pace.t, v, y), mass.rates(s, s.dy(pace.t, v, y))
        longest = sizes(v, y, block_axes, groups)
        least = moves * longer(pace.t, -pace.t)
        counts = Acceptance(groups).counts(*numbers_in(v, y, block_axes))
        changes = sizes(*rates, block_axes, groups)
        time = shortest(longest, changes, counts)
        # Where no component changes by its size, the times of whole blocks count, whatever the units of their components.
        time = where(less(time, np.inf), time, of_blocks(longest, changes, counts))
        chosen = longer(where(less(time, np.inf), FIRST * time, -pace.h), least)
        h = chosen
        for part in (0.5, 1.0):
            ahead = part * chosen
            t1, v1, y1 = pace.t + ahead, v + ahead * rates[0], y + ahead * rates[1]
            ahead_rates = s.dv(t1, v1, y1), mass.rates(s, s.dy(t1, v1, y1))
            time = shortest(longest, sizes(*ahead_rates, block_axes, groups), counts)
            h = where(less(FIRST * time, h), FIRST * time, h)
        h = where(less(0.0, pace.h), pace.h, longer(h, least))
        h = pace.shortened(h, pace.t)
    return pace._replace(h=h, longest=longest, before=h if series else pace.before)


def shortest(lengths: Any, rates: Any, counts: tuple[int, int]) -> Any:
    """The shortest time in which a group of v or of y changes by its size; infinite if there is none."""
    of_v, of_y = counts
    times = [length / rate for length, rate in zip(lengths, rates, strict=True)]
    if of_v and of_y:
        times += [np.sqrt(length / rate) for length, rate in zip(paired(lengths[of_v:], of_v), rates[:of_v], strict=True)]
    least: Any = np.inf
    for time in times:
        least = where(less(0.0, time) & less(time, least), time, least)
    return least


def of_blocks(lengths: Any, rates: Any, counts: tuple[int, int]) -> Any:
    """The shortest time in which a block that is not zero changes by the sum of its sizes; infinite if there is none."""
    least: Any = np.inf
    for block in (slice(0, counts[0]), slice(counts[0], sum(counts))):
        if len(lengths[block]):
            time = total(lengths[block]) / total(rates[block])
            least = where(less(0.0, time) & less(time, least), time, least)
    return least


def paired(of_y: Any, number: int) -> list[Any]:
    """For each group of v the size of its y; where they are not so many, the largest."""
    return list(of_y) if len(of_y) == number else number * [largest(of_y)]


def attempt(
    pair: Pair,
    system: Attempted,
    order: int,
    block_axes: tuple[int, int],
    acceptance: Acceptance,
    pace: Pace,
    budget: Any,
    v: Array,
    y: Array,
) -> tuple[Pace, Array, Array]:
    """One attempt at a step: the state advances, projected, if the error is tolerated, and if there is a step to try.

    An extra step that is accepted leaves the pace as it is. ``order`` is the one in which the error is estimated.
    """
    outlook = pace.outlook(budget)
    trial = tried(pair, system, pace.t, outlook.step, v, y, block_axes)
    small = small_of(getattr(system.s, "mass_matrix", None))
    return judged(pace, outlook, order, block_axes, acceptance, v, y, trial, small=small)


def small_of(mass_matrix: Any, rounding: float = ROUNDING) -> float:
    """The most of the largest size so far that an error that does not fall may be to be rounding.

    With algebraic equations it may be all of it: what they are off by after a step is an error of the next one, however short.
    """
    return ROUNDINGS * rounding if mass_matrix is None else 1.0


def judged(
    pace: Pace,
    outlook: Outlook,
    order: int,
    block_axes: tuple[int, int],
    acceptance: Acceptance,
    v: Array,
    y: Array,
    trial: Tried,
    *,
    small: float,
    rounding: float = ROUNDING,
) -> tuple[Pace, Array, Array]:
    """The pace after an attempt, and the state: the new one if the error is tolerated, and if there was a step to try.

    ``small`` is that of ``small_of``.
    """
    step, groups, v1, y1 = outlook.step, acceptance.groups, trial.v, trial.y
    old, new = sizes(v, y, block_axes, groups), sizes(v1, y1, block_axes, groups)
    least, bound = tolerated(pace, step, acceptance.counts(*numbers_in(v, y, block_axes)), old, new, rounding)
    error = sizes(*trial.errors[0], block_axes, groups)
    rounding_error = rounded(pace, step)
    is_rounding = less(0.0, rounding_error) & at_most(error, rounding_error)
    r = over(where(is_rounding, 0.0, error), bound)
    # Of a coarse estimate e₃ of third order and one of fifth, the corrected one is e₅²/√(e₅² + 0.01·e₃²). Where rates jump, e₅
    # may be next to nothing by chance, so it is corrected only where the two are as of smooth rates: e₅ falls as e₃^(3/2).
    for coarse in trial.errors[1:]:
        second = where(is_rounding, 0.0, sizes(*coarse, block_axes, groups))
        of_second, share = over(second, bound), over(second, longer(old, new))
        other = of_second / r
        by_chance = less(CHANCE, other) & less(WILD, share)
        if order > LOW:
            smooth = less(other * other * share, SMOOTH * SMOOTH)
            r = where(less(0.0, r) & smooth, r / np.sqrt(1.0 + 0.01 * (other * other)), r)
        r = where(by_chance, of_second, r)
    # Sizes that overflow would tolerate any error, so they count as not finite; and so does a stage that only the estimate sees.
    r = where(less(total(new) + total(error), np.inf), r, np.inf)
    for row in acceptance.positive:
        r = where(less(component(v1, y1, block_axes, row), 0.0), longer(r, OUTSIDE), r)
    moved = sizes(v1 - v, y1 - y, block_axes, groups)
    rests = at_most(total(error) + total(moved), 0.0)
    following, goes_on = decided(pace, order > LOW, r, rests, least, outlook)
    following = heard(pace, following, step, (error, bound), (old, moved), small)
    if trial.work is not None:
        following = following._replace(work=where(goes_on & ~outlook.is_extra, pace.work + trial.work, pace.work))
    return following, *(where(goes_on, new, now) for new, now in zip(trial.projected, (v, y), strict=True))


class Extension(NamedTuple):
    """The continuous extension of a step.

    Attributes:
        terms: the coefficients of the powers of θ in the state at the share θ of the step, of v and y.
        step: how long the step is, the difference of its ends.
        changes: whether a group changes so much in the step that states within it are better made by steps.
    """

    terms: Increments
    step: Any
    changes: Any


def extension(
    pair: Pair, system: Attempted, block_axes: tuple[int, int], acceptance: Acceptance, pace: Pace, v: Array, y: Array
) -> Extension:
    """The continuous extension of the step that comes next.

    What is tolerated of a group is relative to its larger size at the ends of the step, and a polynomial through both errs by as
    much everywhere between. Where that is not small beside the smaller size, and the tolerance is relative to the present one, it
    would be too much.
    """
    step = pace.reach()[0] - pace.t
    terms = pair.extension(system.rates(step), pace.t, step, v, y)
    old, new = (sizes(*blocks, block_axes, acceptance.groups) for blocks in ((v, y), within(terms, v, y, 1.0)))
    larger, smaller = longer(old, new), where(less(new, old), new, old)
    share = where(at_most(larger, 0.0), 0.0, (CHANGES * pace.tolerances()[0]) * larger / smaller)
    return Extension(terms, step, less(0.0, pace.lasts) & ~at_most(largest(share), 1.0))


def over(error: Any, bound: Any) -> Any:
    """The largest error of a group over what is tolerated."""
    # A group that is zero, as it has always been, tolerates no error and has none.
    return largest(where(at_most(error, 0.0), 0.0, error / bound))


def tolerated(pace: Pace, step: Any, counts: tuple[int, int], old: Any, new: Any, rounding: float) -> tuple[Any, Any]:
    """Of each group the size that it has at least after the step, and the error that is tolerated.

    ``counts`` are how many groups v and y have; ``old`` and ``new`` are their sizes before and after the step. ``rounding`` is
    ``ROUNDING``, or that of float32.
    """
    # A state at zero so far on which a force sets in counts as long as that force would have made it in a part of the time since.
    since = longer(1.0, PUSHED * ((pace.t + step - pace.begin) / step))
    rested = at_most(total(pace.longest), 0.0)
    lasting, least = [], []
    of_v = counts[0]
    for block in (slice(0, of_v), slice(of_v, sum(counts))):
        longest, after = pace.longest[block], new[block]
        if len(after) == 1:
            lasting.append(where(rested, after[0] * since, LEAST_PART * longest[0]))
            least.append(after[0])
        elif len(after):
            onset = ONSET * longer(largest(longest), largest(after))
            for size, now in zip(longest, after, strict=True):
                been = less(0.0, size)
                lasting.append(where(been, LEAST_PART * size, where(rested, now * since, onset)))
                least.append(where(been | rested | less(onset, now), now, 0.0))
    if all(counts):
        lost = rounding / step
        lasting[:of_v] = [
            longer(size, of_y * lost) for size, of_y in zip(lasting[:of_v], paired(pace.longest[of_v:], of_v), strict=True)
        ]
    size = longer(longer(where(less(0.0, pace.lasts), stacked(lasting), 0.0), old), new)
    relative, absolute = pace.tolerances()
    return stacked(least), absolute + relative * size


def rounded(pace: Pace, step: Any) -> Any:
    """Of each group the error that is rounding."""
    noise, most = pace.noise * step, pace.tolerances()[0] * pace.longest
    return longer(where(less(most, noise), most, noise), 0.0)


def heard(pace: Pace, following: Pace, step: Any, errors: tuple[Any, Any], sizes: tuple[Any, Any], small: float) -> Pace:
    """The pace after an attempt, with what is known of rounding. ``errors`` are those of groups, and what is tolerated of them.

    ``sizes`` are those before the step, and of the change in it; ``small`` is that of ``small_of``.
    """
    (error, bound), (old, moved) = errors, sizes
    takes, fails = less(pace.accepted, following.accepted), less(pace.rejected, following.rejected)
    per_power, per_time, alike = 1.0 / (step * np.sqrt(step)), ROUNDED / step, ALIKE * step
    relative, _ = pace.tolerances()
    most = relative * pace.longest
    offends = less(bound, error) & at_most(error, most) & less(0.0, pace.lasts)
    share, is_small = error * per_power, at_most(error, small * pace.longest)
    is_slow, is_pushed = at_most(moved, SLOW * np.sqrt(np.sqrt(relative)) * old), less(PUSHES * old, moved)
    falls_slowly = less(0.0, pace.failed) & at_most(pace.failed, share) & ((is_slow & is_small) | is_pushed)
    is_rounding = falls_slowly | (at_most(error, alike * pace.noise) & is_small)
    failed = where(at_most(moved, UNLIKE * error), pace.failed, 0.0)
    noise = where(is_rounding, error * per_time, FADES * pace.noise)
    stands = at_most(UNLIKE * moved, error) & less(HOLDS_DOWN * bound, error) & less(0.0, pace.lasts)
    most_known, seen = longer(pace.noise, bound * per_time), error * per_time
    known = longer(FADES * pace.noise, where(less(most_known, seen), most_known, seen))
    taken = where(stands, known, FADES * pace.noise)
    offends = fails & offends
    noise = where(offends, noise, where(takes, taken, pace.noise))
    return following._replace(noise=noise, failed=where(offends, longer(share, pace.failed), where(takes, failed, pace.failed)))


def decided(pace: Pace, high: bool, r: Any, rests: Any, new: Any, outlook: Outlook) -> tuple[Pace, Any]:
    """The pace after an attempt with this error, and whether the state advances; ``new`` are the sizes that it would have.

    ``rests`` is whether nothing moved.
    """
    step, is_extra, ends, runs = outlook
    good = at_most(r, 1.0)  # NaN is not
    floored = where(less(TINY, r), r, TINY)
    r8 = np.sqrt(np.sqrt(np.sqrt(floored)))  # the eighth root of r
    r16 = np.sqrt(r8)
    r32 = np.sqrt(r16)
    factor = SAFETY / ((r16 if high else r8) * r32)
    factor = where(good, factor * pace.before, factor)
    factor = where(less(MIN_FACTOR, factor), factor, MIN_FACTOR)
    ceiling = where(good, pace.most, 1.0)
    factor = where(less(factor, ceiling), factor, ceiling)
    factor = where(less(r, np.inf), factor, MIN_FACTOR)
    reached = where(ends, pace.wall, pace.t + step)
    passes = less(pace.target, reached)
    takes, holds, fails = runs & good & ~passes, runs & good & passes, (runs | is_extra) & ~good
    decides = takes | fails
    root, calm = (r32, CALM_ROOTS[1]) if high else (r16, CALM_ROOTS[0])
    root = where(less(calm, root), root, calm)
    t = where(takes, reached, pace.t)
    grown = where(takes & ends, pace.h, step * factor)
    quiet = longer(step, QUIET * (reached - pace.begin))
    grown = pace.shortened(where(takes & rests & less(quiet, grown), quiet, grown), t)
    following = pace._replace(
        t=t,
        h=where(decides, grown, pace.h),
        extra=where(is_extra, 0.0, pace.extra),
        held=where(holds, 1.0, where(fails, 0.0, pace.held)),
        longest=where(takes & less(pace.longest, new), new, pace.longest),
        before=where(takes, root, pace.before),
        most=where(decides, where(good, MAX_FACTOR, 1.0), pace.most),
        accepted=pace.accepted + where(takes, 1.0, 0.0),
        rejected=pace.rejected + where(fails, 1.0, 0.0),
        extra_steps=pace.extra_steps + where(holds | (is_extra & good), 1.0, 0.0),
        error=where(decides, r, pace.error),
    )
    return following, takes | (is_extra & good)

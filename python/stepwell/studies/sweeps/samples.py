"""Axes whose values are samples: random ones, and those of Sobol's sequence, which fill a box more evenly."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base import checks
from ...base.arrays import Array
from ...errors import ArgumentError, ShapeError
from .extras import need


def random(dim: str, count: int, *, seed: int, **ranges: Any) -> dict[str, Any]:
    """Axes of independent random samples.

    Args:
        dim: name of the dimension along which all of them vary.
        count: the number of samples.
        seed: the seed of NumPy's PCG64; the same seed gives the same samples.
        ranges: by the name of an argument, the pair (low, high) between which it is uniform, or a distribution of
            ``scipy.stats``, or any object with a method ``ppf``, the inverse of its distribution function.

    Returns:
        Axes for ``stepwell.sweep``, by name. They are a dictionary: ``axes | {"mu": ("mu", values)}`` adds another dimension.

    Example:
        >>> axes = sw.sweeps.random("sample", 1000, seed=7, mu=(0.5, 2.0), y=(-1.0, 1.0))
        >>> axes["mu"][0], axes["mu"][1].shape, axes["mu"][2]["sampling"]
        ('sample', (1000,), 'random, PCG64, seed 7')
    """
    count, seed = checks.count("count", count, 1), checks.count("seed", seed, 0)
    _fits(count, ranges)
    unit = np.random.Generator(np.random.PCG64(seed)).random((count, len(ranges)))
    return _placed(dim, unit, ranges, f"random, PCG64, seed {seed}")


def sobol(dim: str, count: int, *, seed: int, **ranges: Any) -> dict[str, Any]:
    """Axes of samples of Sobol's sequence, scrambled (``scipy.stats.qmc.Sobol``).

    They fill the box of the arguments more evenly than random ones: means over them converge about as 1/count.

    Args:
        dim: name of the dimension along which all of them vary.
        count: the number of samples; a power of two, since other numbers lose the balance of the sequence.
        seed: the seed of the scrambling.
        ranges: as for ``random``.

    Returns:
        Axes for ``stepwell.sweep``, by name.

    Raises:
        ArgumentError: if the count is no power of two.
        UnsupportedError: if SciPy is missing.

    Example:
        >>> axes = sw.sweeps.sobol("sample", 1024, seed=7, mu=(0.5, 2.0), y=(-1.0, 1.0))
        >>> bool(abs(axes["mu"][1].mean() - 1.25) < 1e-3)
        True
    """
    count, seed = checks.count("count", count, 1), checks.count("seed", seed, 0)
    _fits(count, ranges)
    if count & (count - 1):
        raise ArgumentError(f"count: expected a power of two for Sobol's sequence, got {count}; {1 << count.bit_length()} is one")
    qmc = need("scipy.stats.qmc")
    # Older versions of SciPy call the argument seed.
    rng = np.random.Generator(np.random.PCG64(seed))
    try:
        sequence = qmc.Sobol(len(ranges) or 1, scramble=True, rng=rng)
    except TypeError:
        sequence = qmc.Sobol(len(ranges) or 1, scramble=True, seed=rng)
    unit = sequence.random_base2(count.bit_length() - 1)
    return _placed(dim, unit, ranges, f"Sobol, scrambled, seed {seed}")


def _fits(count: int, ranges: dict[str, Any]) -> None:
    """Raise unless memory suffices for the samples as drawn, as values of arguments, and for temporary arrays."""
    checks.fits("count: the samples", 4 * len(ranges), (count,), "take fewer")


def _placed(dim: Any, unit: Array, ranges: dict[str, Any], sampling: str) -> dict[str, Any]:
    """Numbers between 0 and 1 as values of arguments."""
    if not isinstance(dim, str) or not dim:
        raise ArgumentError(f"dim: expected the name of a dimension, got {checks.short(dim)}")
    if not ranges:
        raise ArgumentError("ranges: expected arguments by name, such as mu=(0.5, 2.0), got none")
    axes = {}
    for k, (name, bounds) in enumerate(ranges.items()):
        if hasattr(bounds, "ppf"):
            values = np.asarray(bounds.ppf(unit[:, k]), dtype=np.float64)
        else:
            ends = checks.numbers(name, bounds)
            if ends.shape != (2,):
                raise ShapeError(f"{name}: expected a pair (low, high) or a distribution of scipy.stats, got shape {ends.shape}")
            low, high = ends.tolist()
            if not low < high:
                raise ArgumentError(f"{name}: expected (low, high) with low < high, got ({low:g}, {high:g})")
            values = low + (high - low) * unit[:, k]
        axes[name] = (dim, values, {"sampling": sampling})
    return axes

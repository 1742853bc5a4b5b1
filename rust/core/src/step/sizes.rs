//! Sizes of components, and of groups of them.

use crate::tape::number::Number;

/// |x|
pub(crate) fn absolute<N: Number>(x: N) -> N {
    x.and_bits(u64::MAX >> 1)
}

/// The larger of two sizes.
pub(crate) fn longer<N: Number>(a: N, b: N) -> N {
    N::choose(a.below(b), b, a)
}

/// The largest of some sizes.
pub(crate) fn largest<N: Number>(sizes: &[N]) -> N {
    sizes.iter().copied().reduce(longer).unwrap_or_else(|| N::of(0.0))
}

/// The sum of some sizes.
pub(crate) fn total<N: Number>(sizes: &[N]) -> N {
    sizes.iter().copied().reduce(|total, size| total + size).unwrap_or_else(|| N::of(0.0))
}

//! The two kinds of numbers that steps are computed with: those of 64 bits (binary64), and those of 32 (binary32).

use std::fmt::Debug;

use super::{eval, op::Op};

/// How many bits the numbers of a tape have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// 64 bits: float64.
    #[default]
    Double,
    /// 32 bits: float32.
    Single,
}

impl Precision {
    /// The size of a number in bytes.
    pub(crate) fn bytes(self) -> usize {
        match self {
            Precision::Double => 8,
            Precision::Single => 4,
        }
    }

    /// The bits of a constant, rounded to this precision; those above are zero.
    pub fn bits_of(self, x: f64) -> u64 {
        match self {
            Precision::Double => x.to_bits(),
            Precision::Single => rounded(x),
        }
    }

    /// The constant with these bits, which is exact.
    pub(crate) fn number(self, bits: u64) -> f64 {
        match self {
            Precision::Double => f64::from_bits(bits),
            Precision::Single => widened(bits),
        }
    }

    /// All bits of a number: a comparison that is true.
    pub fn all_bits(self) -> u64 {
        match self {
            Precision::Double => u64::MAX,
            Precision::Single => u32::MAX.into(),
        }
    }

    /// The bit of the sign.
    pub(crate) fn sign_bit(self) -> u64 {
        1 << (8 * self.bytes() - 1)
    }

    /// Converts a pattern of 64 bits: all bits, the bit of the sign and all others become those of a number of this precision.
    /// Any other pattern is the caller's to choose for it.
    pub(crate) fn pattern(self, bits: u64) -> u64 {
        const ALL: u64 = u64::MAX;
        const SIGN: u64 = 1 << 63;
        const NOT_SIGN: u64 = !SIGN;
        match bits {
            ALL => self.all_bits(),
            SIGN => self.sign_bit(),
            NOT_SIGN => self.all_bits() ^ self.sign_bit(),
            other => other & self.all_bits(),
        }
    }

    /// The bits that an operation makes of the bits of its operands.
    pub(crate) fn apply(self, op: Op, a: u64, b: u64, c: u64) -> u64 {
        match self {
            Precision::Double => eval::apply(op, a, b, c),
            Precision::Single => eval::apply_single(op, a as u32, b as u32, c as u32).into(),
        }
    }
}

// Not inlined, else the compiler converts before it asks for the precision: a constant of 64 bits beyond the range of 32 would
// then raise the flag of an overflow, which NumPy reads after it has called symbols.

#[inline(never)]
fn rounded(x: f64) -> u64 {
    (x as f32).to_bits().into()
}

#[inline(never)]
fn widened(bits: u64) -> f64 {
    f32::from_bits(bits as u32).into()
}

/// A number of one of these precisions.
pub trait Real: Copy + Debug + Default + PartialEq + PartialOrd + Send + Sync + 'static {
    /// The precision.
    const PRECISION: Precision;
    /// Where the numbers of a method's carry are larger than this, or than this times the step if that is less than 1, velocities
    /// are checked after every step: see [`crate::run::fixed`].
    const HUGE: Self;
    /// Not a number.
    const NAN: Self;
    /// Beyond all numbers.
    const INFINITY: Self;

    /// Rounds a number to this precision.
    fn of(x: f64) -> Self;
    /// Widens the number to 64 bits, which is exact.
    fn wide(self) -> f64;
    /// The number with the lowest of these bits.
    fn from_pattern(bits: u64) -> Self;
    /// Its bits; those above are zero.
    fn pattern(self) -> u64;
    /// Whether it is smaller than a size; a NaN is not.
    fn is_below(self, size: Self) -> bool;
    /// An operation, by its definition.
    fn apply(op: Op, a: Self, b: Self, c: Self) -> Self;
}

macro_rules! real {
    ($float:ident, $precision:ident, $apply:ident, $huge:expr) => {
        impl Real for $float {
            const PRECISION: Precision = Precision::$precision;
            const HUGE: $float = $huge;
            const NAN: $float = $float::NAN;
            const INFINITY: $float = $float::INFINITY;

            #[inline(always)]
            fn of(x: f64) -> $float {
                x as $float
            }
            #[inline(always)]
            fn wide(self) -> f64 {
                self.into()
            }
            #[inline(always)]
            fn from_pattern(bits: u64) -> $float {
                $float::from_bits(bits as _)
            }
            #[inline(always)]
            fn pattern(self) -> u64 {
                self.to_bits().into()
            }
            #[inline(always)]
            fn is_below(self, size: $float) -> bool {
                self.abs() < size
            }
            #[inline(always)]
            fn apply(op: Op, a: $float, b: $float, c: $float) -> $float {
                $float::from_bits(eval::$apply(op, a.to_bits(), b.to_bits(), c.to_bits()))
            }
        }
    };
}
// The difference of two coordinates divided by the step overflows only beyond 2¹⁰²³ (2¹²⁷) times the step. To miss that between
// two checks, it would have to grow by a factor of 2⁶⁰ and shrink again.
real!(f64, Double, apply, power_of_two(960));
real!(f32, Single, apply_single, f32::from_bits((127 + 64) << 23));

/// 2ⁿ, where that is a normal number.
pub(crate) const fn power_of_two(n: i32) -> f64 {
    f64::from_bits(((1023 + n) as u64) << 52)
}

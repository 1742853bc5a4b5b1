//! The numbers over which a step is written.
//!
//! A step, a system, a control are written once, over any [`Number`]. With `f64` they compute; with the core's symbols they write
//! the tape.

use std::{
    fmt::Debug,
    ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign},
};

/// A function of one number that is made of roundings and operations on bits, which have no derivative: a series must know its
/// name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// sin x
    Sin,
    /// cos x
    Cos,
    /// ln x
    Log,
}

/// The Taylor coefficients of a solution, from the first on, and the functions with several branches that its rates have.
#[derive(Clone, Debug)]
pub struct Series<N> {
    /// For each order as many coefficients as the state has numbers.
    pub terms: Vec<Vec<N>>,
    /// The branches that the rates are on.
    pub branches: Vec<Branch<N>>,
}

/// A function with several branches, such as a root: its start and its coefficients, none where it is known to be zero, and the
/// bounds of the values of its branch.
#[derive(Clone, Debug)]
pub struct Branch<N> {
    /// The value at the start of the step, and the coefficients.
    pub terms: Vec<Option<N>>,
    /// The least value of the branch,
    pub least: f64,
    /// and the largest.
    pub most: f64,
}

/// The derivatives of rates; none where one is known to be zero.
#[derive(Clone, Debug)]
pub struct Derivatives<N> {
    /// Derivatives by each number of the state: one for each rate.
    pub by_state: Vec<Vec<Option<N>>>,
    /// Derivatives by the time.
    pub by_time: Vec<Option<N>>,
}

/// A number, or a symbol for one.
///
/// A step can use only these operations: no `if` on a number, no operation that two machines might round differently.
pub trait Number:
    nalgebra::Scalar
    + Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    /// The result of a comparison.
    type Truth: Copy + BitAnd<Output = Self::Truth> + BitOr<Output = Self::Truth> + Not<Output = Self::Truth>;

    /// Whether it is computed with 32 bits: functions of bits and constants of their own size are other ones then.
    fn is_single() -> bool {
        false
    }
    /// A constant.
    fn of(x: f64) -> Self;
    /// √x
    #[must_use]
    fn sqrt(self) -> Self;
    /// x · y + z, rounded once.
    #[must_use]
    fn mul_add(self, y: Self, z: Self) -> Self;
    /// z − x · y, rounded once.
    #[must_use]
    fn mul_sub_from(self, y: Self, z: Self) -> Self;
    /// The largest whole number not above x.
    #[must_use]
    fn floor(self) -> Self;
    /// x < y
    fn below(self, y: Self) -> Self::Truth;
    /// x ≤ y
    fn at_most(self, y: Self) -> Self::Truth;
    /// x = y
    fn equals(self, y: Self) -> Self::Truth;
    /// One of two numbers.
    fn choose(truth: Self::Truth, yes: Self, no: Self) -> Self;
    /// Bits of the number and of the constant.
    #[must_use]
    fn and_bits(self, bits: u64) -> Self;
    /// Bits of the number or of the constant.
    #[must_use]
    fn or_bits(self, bits: u64) -> Self;
    /// Bits of one number and not of both.
    #[must_use]
    fn xor_bits(self, other: Self) -> Self;
    /// Its bits as a whole number, and another added.
    #[must_use]
    fn add_bits(self, whole: u64) -> Self;
    /// A whole number, and its bits subtracted.
    #[must_use]
    fn sub_bits_from(self, whole: u64) -> Self;
    /// Its bits, moved up.
    #[must_use]
    fn shift_up(self, places: u32) -> Self;
    /// Its bits, moved down.
    #[must_use]
    fn shift_down(self, places: u32) -> Self;

    /// Returns the number itself; a symbol records that it is `function` of `of`.
    #[must_use]
    fn marked(self, _function: Function, _of: Self) -> Self {
        self
    }

    /// The Taylor coefficients 1 to `order` of the solution from `start`, whose rates a function computes from state and time.
    /// `time` has the time, the unit in whose powers the coefficients count, and this unit over that of the rates. Only symbols
    /// record how rates were computed; plain numbers have no series.
    fn series(_order: u32, _start: &[Self], _time: [Self; 3], _rates: &mut dyn FnMut() -> Vec<Self>) -> Option<Series<Self>> {
        None
    }

    /// The derivatives of rates that a function makes of the state, of the time and of the length of the step, which does not
    /// change. Of numbers there are none, as of series.
    fn derivatives(
        _state: &[Self],
        _time: Self,
        _step: Self,
        _rates: &mut dyn FnMut() -> Vec<Self>,
    ) -> Option<Derivatives<Self>> {
        None
    }

    /// The larger of two; the second of a NaN.
    #[must_use]
    fn larger(self, y: Self) -> Self {
        Self::choose(y.below(self), self, y)
    }

    /// Clamped between two constants; a NaN stays one.
    #[must_use]
    fn clamped(self, least: f64, most: f64) -> Self {
        let (least, most) = (Self::of(least), Self::of(most));
        let x = Self::choose(self.below(least), least, self);
        Self::choose(most.below(x), most, x)
    }
}

impl Number for f64 {
    type Truth = bool;

    #[inline(always)]
    fn of(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn mul_add(self, y: f64, z: f64) -> f64 {
        f64::mul_add(self, y, z)
    }
    #[inline(always)]
    fn mul_sub_from(self, y: f64, z: f64) -> f64 {
        f64::mul_add(-self, y, z)
    }
    #[inline(always)]
    fn floor(self) -> f64 {
        f64::floor(self)
    }
    #[inline(always)]
    fn below(self, y: f64) -> bool {
        self < y
    }
    #[inline(always)]
    fn at_most(self, y: f64) -> bool {
        self <= y
    }
    #[inline(always)]
    fn equals(self, y: f64) -> bool {
        self == y
    }
    #[inline(always)]
    fn choose(truth: bool, yes: f64, no: f64) -> f64 {
        if truth { yes } else { no }
    }
    #[inline(always)]
    fn and_bits(self, bits: u64) -> f64 {
        f64::from_bits(self.to_bits() & bits)
    }
    #[inline(always)]
    fn or_bits(self, bits: u64) -> f64 {
        f64::from_bits(self.to_bits() | bits)
    }
    #[inline(always)]
    fn xor_bits(self, other: f64) -> f64 {
        f64::from_bits(self.to_bits() ^ other.to_bits())
    }
    #[inline(always)]
    fn add_bits(self, whole: u64) -> f64 {
        f64::from_bits(self.to_bits().wrapping_add(whole))
    }
    #[inline(always)]
    fn sub_bits_from(self, whole: u64) -> f64 {
        f64::from_bits(whole.wrapping_sub(self.to_bits()))
    }
    #[inline(always)]
    fn shift_up(self, places: u32) -> f64 {
        f64::from_bits(self.to_bits() << places)
    }
    #[inline(always)]
    fn shift_down(self, places: u32) -> f64 {
        f64::from_bits(self.to_bits() >> places)
    }
}

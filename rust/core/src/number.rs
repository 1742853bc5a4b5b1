//! Numbers: what a step is written over.
//!
//! A step, a system, a control are written once, over any [`Number`]. With `f64` they compute; with [`Symbol`] they write the tape.

use std::{
    cell::RefCell,
    fmt::Debug,
    ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign},
};

use crate::tape::{Id, Op, Tape};

/// A number, or what stands for one.
///
/// What is not here is not in a step: no `if` on a number, no operation that two machines might round differently.
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
    /// A truth about numbers.
    type Truth: Copy + BitAnd<Output = Self::Truth> + BitOr<Output = Self::Truth> + Not<Output = Self::Truth>;

    /// A number that is known beforehand.
    fn of(x: f64) -> Self;
    /// √x
    #[must_use]
    fn sqrt(self) -> Self;
    /// The largest whole number not above x.
    #[must_use]
    fn floor(self) -> Self;
    /// x < y
    fn below(self, y: Self) -> Self::Truth;
    /// x ≤ y
    fn at_most(self, y: Self) -> Self::Truth;
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
    /// Its bits, moved up.
    #[must_use]
    fn shift_up(self, places: u32) -> Self;
    /// Its bits, moved down.
    #[must_use]
    fn shift_down(self, places: u32) -> Self;

    /// The larger of two; the second of a NaN.
    #[must_use]
    fn larger(self, y: Self) -> Self {
        Self::choose(y.below(self), self, y)
    }

    /// Held between two constants; a NaN stays one.
    #[must_use]
    fn held(self, least: f64, most: f64) -> Self {
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
    fn shift_up(self, places: u32) -> f64 {
        f64::from_bits(self.to_bits() << places)
    }
    #[inline(always)]
    fn shift_down(self, places: u32) -> f64 {
        f64::from_bits(self.to_bits() >> places)
    }
}

thread_local! {
    /// The tape that symbols of this thread write to.
    static TAPE: RefCell<Tape> = RefCell::new(Tape::default());
}

/// Runs a function whose symbols write to this tape, and gives back the tape with what the function made.
pub fn record<T>(tape: Tape, f: impl FnOnce() -> T) -> (Tape, T) {
    let outer = TAPE.replace(tape);
    let made = f();
    (TAPE.replace(outer), made)
}

/// A number that is not known yet: a value on the tape of this thread.
#[derive(Clone, Copy, Debug)]
pub struct Symbol(pub Id);

/// Whether a comparison of symbols is true: a value on the tape, too.
#[derive(Clone, Copy, Debug)]
pub struct SymbolTruth(Id);

impl Symbol {
    /// The value that an operation makes.
    pub fn new(op: Op) -> Symbol {
        Symbol(write(op))
    }
}

fn write(op: Op) -> Id {
    TAPE.with_borrow_mut(|tape| tape.push(op))
}

// nalgebra asks for it. A symbol is equal to another only when both are numbers, so to ask now is a mistake.
impl PartialEq for Symbol {
    fn eq(&self, _: &Symbol) -> bool {
        panic!("a symbol has no truth value: choose between two numbers with Number::choose")
    }
}

macro_rules! write_operators {
    ($($trait:ident $method:ident $op:ident, $assign:ident $assign_method:ident;)*) => {
        $(impl $trait for Symbol {
            type Output = Symbol;
            fn $method(self, y: Symbol) -> Symbol {
                Symbol::new(Op::$op(self.0, y.0))
            }
        }
        impl $assign for Symbol {
            fn $assign_method(&mut self, y: Symbol) {
                *self = Symbol::new(Op::$op(self.0, y.0));
            }
        })*
    };
}
write_operators! {
    Add add Add, AddAssign add_assign;
    Sub sub Sub, SubAssign sub_assign;
    Mul mul Mul, MulAssign mul_assign;
}

impl Div for Symbol {
    type Output = Symbol;
    fn div(self, y: Symbol) -> Symbol {
        Symbol::new(Op::Div(self.0, y.0))
    }
}

impl Neg for Symbol {
    type Output = Symbol;
    fn neg(self) -> Symbol {
        Symbol::new(Op::Neg(self.0))
    }
}

impl BitAnd for SymbolTruth {
    type Output = SymbolTruth;
    fn bitand(self, other: SymbolTruth) -> SymbolTruth {
        SymbolTruth(write(Op::And(self.0, other.0)))
    }
}

impl BitOr for SymbolTruth {
    type Output = SymbolTruth;
    fn bitor(self, other: SymbolTruth) -> SymbolTruth {
        SymbolTruth(write(Op::Or(self.0, other.0)))
    }
}

impl Not for SymbolTruth {
    type Output = SymbolTruth;
    fn not(self) -> SymbolTruth {
        SymbolTruth(write(Op::Xor(self.0, bits(u64::MAX))))
    }
}

fn bits(bits: u64) -> Id {
    write(Op::Const(bits))
}

impl Number for Symbol {
    type Truth = SymbolTruth;

    fn of(x: f64) -> Symbol {
        Symbol(bits(x.to_bits()))
    }
    fn sqrt(self) -> Symbol {
        Symbol::new(Op::Sqrt(self.0))
    }
    fn floor(self) -> Symbol {
        Symbol::new(Op::Floor(self.0))
    }
    fn below(self, y: Symbol) -> SymbolTruth {
        SymbolTruth(write(Op::Less(self.0, y.0)))
    }
    fn at_most(self, y: Symbol) -> SymbolTruth {
        SymbolTruth(write(Op::LessEqual(self.0, y.0)))
    }
    fn choose(truth: SymbolTruth, yes: Symbol, no: Symbol) -> Symbol {
        Symbol::new(Op::Select(truth.0, yes.0, no.0))
    }
    fn and_bits(self, mask: u64) -> Symbol {
        Symbol::new(Op::And(self.0, bits(mask)))
    }
    fn or_bits(self, mask: u64) -> Symbol {
        Symbol::new(Op::Or(self.0, bits(mask)))
    }
    fn xor_bits(self, other: Symbol) -> Symbol {
        Symbol::new(Op::Xor(self.0, other.0))
    }
    fn add_bits(self, whole: u64) -> Symbol {
        Symbol::new(Op::AddBits(self.0, bits(whole)))
    }
    fn shift_up(self, places: u32) -> Symbol {
        Symbol::new(Op::ShiftUp(self.0, places))
    }
    fn shift_down(self, places: u32) -> Symbol {
        Symbol::new(Op::ShiftDown(self.0, places))
    }
}

//! Numbers that are not known yet: what is done with them is written to the tape.

use std::{
    cell::RefCell,
    ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign},
};

use super::{Id, Op, Tape};

thread_local! {
    /// The tape that symbols of this thread write to.
    static TAPE: RefCell<Tape> = RefCell::new(Tape::default());
}

/// Runs a function whose symbols write to this tape, and returns the tape with the function's result.
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
pub struct SymbolTruth(pub(super) Id);

impl Symbol {
    /// The value that an operation makes.
    pub fn new(op: Op) -> Symbol {
        Symbol(write(op))
    }
}

/// Never inlined: systems and methods are made of thousands of operations, which are written here one at a time.
#[inline(never)]
pub(super) fn write(op: Op) -> Id {
    TAPE.with_borrow_mut(|tape| tape.push(op))
}

// nalgebra requires it. Whether two symbols are equal is not known while tracing, so calling it is a mistake.
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

/// Calls a function with the tape of this thread, and returns its result.
pub(super) fn on_tape<T>(f: impl FnOnce(&mut Tape) -> T) -> T {
    TAPE.with_borrow_mut(f)
}

/// The operation of a value on the tape of this thread.
pub(super) fn operation(id: Id) -> Op {
    TAPE.with_borrow(|tape| tape.op(id))
}

/// A constant.
#[inline(never)]
pub(super) fn constant(x: f64) -> Id {
    TAPE.with_borrow_mut(|tape| tape.constant(x))
}

/// A constant of bits, as [`super::real::Precision::pattern`] has it.
#[inline(never)]
pub(super) fn bits(bits: u64) -> Id {
    TAPE.with_borrow_mut(|tape| tape.bits_of(bits))
}

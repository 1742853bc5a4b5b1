//! The numbers over which a step is written.
//!
//! A step, a system, a control are written once, over any [`Number`]. With `f64` they compute; with [`Symbol`] they write the tape.

use std::{
    cell::RefCell,
    ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign},
};

pub use stepwell_base::number::{Branch, Function, Number, Series};

use crate::{
    real::Precision,
    series,
    tape::{Id, Op, Tape},
};

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

/// What a function makes of the tape of this thread.
pub(crate) fn on_tape<T>(f: impl FnOnce(&mut Tape) -> T) -> T {
    TAPE.with_borrow_mut(f)
}

/// The operation of a value on the tape of this thread.
pub(crate) fn operation(id: Id) -> Op {
    TAPE.with_borrow(|tape| tape.op(id))
}

/// A constant of bits, as [`Precision::pattern`] has it.
fn bits(bits: u64) -> Id {
    TAPE.with_borrow_mut(|tape| tape.bits_of(bits))
}

impl Number for Symbol {
    type Truth = SymbolTruth;

    fn is_single() -> bool {
        TAPE.with_borrow(|tape| tape.precision()) == Precision::Single
    }
    fn of(x: f64) -> Symbol {
        Symbol(TAPE.with_borrow_mut(|tape| tape.constant(x)))
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
    fn marked(self, function: Function, of: Symbol) -> Symbol {
        series::mark(self, series::Mark::Of(function, of));
        self
    }
    fn series(order: u32, start: &[Symbol], time: [Symbol; 3], rates: &mut dyn FnMut() -> Vec<Symbol>) -> Option<Series<Symbol>> {
        Some(series::of_solution(order, start, time, rates))
    }
}

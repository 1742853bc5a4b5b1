//! The numbers over which a step is written.
//!
//! A step, a system, a control are written once, over any [`Number`]. With `f64` they compute; with [`Symbol`] they write the
//! tape.

pub use stepwell_base::number::{Branch, Derivatives, Function, Number, Series};

pub use super::symbol::{Symbol, SymbolTruth, record};
use super::{
    Op,
    real::Precision,
    series,
    symbol::{bits, constant, on_tape, write},
};

impl Number for Symbol {
    type Truth = SymbolTruth;

    fn is_single() -> bool {
        on_tape(|tape| tape.precision()) == Precision::Single
    }
    fn of(x: f64) -> Symbol {
        Symbol(constant(x))
    }
    fn sqrt(self) -> Symbol {
        Symbol::new(Op::Sqrt(self.0))
    }
    fn mul_add(self, y: Symbol, z: Symbol) -> Symbol {
        Symbol::new(Op::MulAdd(self.0, y.0, z.0))
    }
    fn mul_sub_from(self, y: Symbol, z: Symbol) -> Symbol {
        Symbol::new(Op::SubMul(self.0, y.0, z.0))
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
    fn equals(self, y: Symbol) -> SymbolTruth {
        SymbolTruth(write(Op::Equal(self.0, y.0)))
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
    fn sub_bits_from(self, whole: u64) -> Symbol {
        Symbol::new(Op::SubBits(bits(whole), self.0))
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
    fn derivatives(
        state: &[Symbol],
        time: Symbol,
        step: Symbol,
        rates: &mut dyn FnMut() -> Vec<Symbol>,
    ) -> Option<Derivatives<Symbol>> {
        Some(series::derivatives(state, time, step, rates))
    }
}

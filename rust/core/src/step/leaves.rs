//! The leaves of a tape, as symbols: the state, the time, the parameters.

use crate::{
    model::{
        spec::{Parameters, Signature},
        system::Block,
        window,
    },
    tape::{Id, Op, number::Symbol},
};

/// The leaves of a tape: parameters, sampled inputs, the step.
pub(crate) fn parameters(signature: &Signature, h: Symbol) -> Parameters<'_, Symbol> {
    let numbers = (0..signature.parameters() as u32).map(|i| Symbol::new(Op::Param(i))).collect();
    Parameters { signature, h, numbers, sample: window::sample }
}

/// The parameter that is each member's own time of step 0, where they have some: the clock's is then 0.
pub(crate) const BEGINS: &str = "time.begins";

/// The parameter that is each member's own step, where they have some: the clock then counts steps.
pub(crate) const LENGTH: &str = "time.step";

/// Whether members have times of their own.
pub(crate) fn own_times(signature: &Signature) -> bool {
    signature.count(BEGINS) > 0 || signature.count(LENGTH) > 0
}

/// The step.
pub(crate) fn length(signature: &Signature) -> Symbol {
    Symbol::new(signature.place(LENGTH).map_or(Op::Step, |row| Op::Param(row as u32)))
}

/// The time of a step.
pub(crate) fn time(signature: &Signature) -> Symbol {
    let clock = Symbol::new(Op::Time);
    let clock = if signature.count(LENGTH) > 0 { clock * length(signature) } else { clock };
    match signature.place(BEGINS) {
        Some(row) => Symbol::new(Op::Param(row as u32)) + clock,
        None => clock,
    }
}

/// Numbers of the state.
pub(crate) fn block(first: usize, count: usize) -> Block<Symbol> {
    Block::from_fn(count, |i, _| Symbol::new(Op::State((first + i) as u32)))
}

/// The values of blocks.
pub(crate) fn ids<'a>(blocks: impl IntoIterator<Item = &'a Block<Symbol>>) -> Vec<Id> {
    blocks.into_iter().flat_map(|block| block.iter().map(|symbol| symbol.0)).collect()
}

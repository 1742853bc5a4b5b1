//! Attempts at adaptive steps, over symbols.

use super::{
    leaves::{block, ids, parameters},
    pace::{Acceptance, Attempted, Backward, Pace, Scales, Stretched, attempt},
    series_pace,
};
use crate::{
    model::{
        around::{self, controls},
        program::Program,
        spec::Signature,
        system::{Block, Kind, Shape, System},
    },
    tape::{
        Id, Op,
        number::{Number, Symbol},
        reserved::BUDGET,
    },
};

/// What attempts at adaptive steps are traced of.
pub(super) struct AttemptsOf<'a> {
    pub kind: &'a Kind,
    pub signature: &'a Signature,
    pub shape: Shape,
    pub acceptance: &'a Acceptance,
    pub backward: bool,
}

impl AttemptsOf<'_> {
    /// The system, scaled to a step.
    fn scaled(&self, h: Symbol) -> Box<dyn System<Symbol>> {
        if self.backward {
            return Box::new(Backward((self.kind.make)(&parameters(self.signature, -h))));
        }
        (self.kind.make)(&parameters(self.signature, h))
    }

    /// Rates for a step with the forces around the system: h·v̇ + h·f. Where time runs backward, these see the step and the time
    /// of the system.
    fn forced(&self, h: Symbol, rates: Box<dyn System<Symbol>>) -> Box<dyn System<Symbol>> {
        if self.backward && around::has_forces(self.signature) {
            let p = parameters(self.signature, -h);
            return Box::new(Backward(around::wrap_in_forces(&p, Box::new(Backward(rates)))));
        }
        around::wrap_in_forces(&parameters(self.signature, h), rates)
    }

    /// The rates for a step of 1.
    fn of_unit_step(&self) -> Box<dyn System<Symbol>> {
        self.forced(Symbol::of(1.0), self.scaled(Symbol::of(1.0)))
    }

    /// The system scaled to a step of 1, under its projection if there is one.
    fn projected(&self) -> Box<dyn System<Symbol>> {
        let p = parameters(self.signature, Symbol::of(1.0));
        around::wrap_without_forces(&p, self.scaled(Symbol::of(1.0)), Symbol::of(0.0))
    }

    fn state(&self) -> (Block<Symbol>, Block<Symbol>) {
        (block(0, self.shape.v), block(self.shape.v, self.shape.y))
    }

    /// The pace as a part of the state, behind v and y, and the sizes behind it.
    fn pace(&self) -> (Pace<Symbol>, Scales<Symbol>) {
        let first = self.shape.v + self.shape.y;
        let pace = Pace::of(std::array::from_fn(|i| Symbol::new(Op::State((first + i) as u32))));
        let numbers = block(first + Pace::<Symbol>::NUMBERS, self.acceptance.numbers(self.shape.v, self.shape.y));
        (pace, Scales::of(numbers.as_slice(), self.acceptance.own))
    }

    /// The next state: v and y, the pace, and the sizes.
    fn next(&self, pace: &Pace<Symbol>, longest: &[Symbol], v: &Block<Symbol>, y: &Block<Symbol>) -> Vec<Id> {
        let own = self.pace().1.own;
        let mut next = ids([v, y]);
        next.extend(pace.numbers().iter().chain(longest).chain(&own).map(|symbol| symbol.0));
        next
    }

    pub(crate) fn attempts(&self, program: &Program, order: u32) -> Vec<Id> {
        let (signature, (v, y), (pace, scales)) = (self.signature, self.state(), self.pace());
        let rates = |step: Symbol| -> Box<dyn System<Symbol>> {
            if signature.equations.is_some() {
                return self.forced(step, self.scaled(step)); // the push of their control depends on the step
            }
            let stretched = Box::new(Stretched { s: self.scaled(Symbol::of(1.0)), h: step });
            let pushed = match controls::pushes(signature) {
                true => around::wrap_without_forces(&parameters(signature, step), stretched, Symbol::of(0.0)),
                false => stretched,
            };
            self.forced(step, pushed)
        };
        let projected = if controls::pushes(signature) { self.scaled(Symbol::of(1.0)) } else { self.projected() };
        let system = Attempted { rates: &rates, projected: projected.as_ref() };
        let budget = Symbol::new(Op::Param(BUDGET));
        let (pace, longest, v, y) = attempt(program, &system, order, self.acceptance, (pace, &scales), budget, &v, &y);
        self.next(&pace, &longest, &v, &y)
    }

    /// Steps by a series of that order, and its coefficients.
    pub(crate) fn series(&self, order: u32) -> (Vec<Id>, Vec<Id>) {
        let (v, y) = self.state();
        let rates = self.of_unit_step();
        let (terms, branches) = series_pace::terms(order, rates.as_ref(), &self.pace().0, &v, &y);
        let numbers = ids(terms.iter().flat_map(|(v, y)| [v, y]));
        (self.attempt_by((&terms, &branches), Some(rates.as_ref())), numbers)
    }

    /// One attempt by coefficients of a series.
    pub(crate) fn attempt_by(&self, terms: series_pace::Known<Symbol>, rates: Option<&dyn System<Symbol>>) -> Vec<Id> {
        let ((v, y), (pace, scales)) = (self.state(), self.pace());
        let budget = Symbol::new(Op::Param(BUDGET));
        let projected = self.projected();
        let (pace, longest, v, y) =
            series_pace::attempt(terms, rates, projected.as_ref(), self.acceptance, (pace, &scales), budget, &v, &y);
        self.next(&pace, &longest, &v, &y)
    }

    /// Where a member stands at the start, without control.
    pub(crate) fn begin(&self, series: bool) -> Vec<Id> {
        let (v, y) = self.state();
        let (pace, longest) = self.pace().0.begun(self.of_unit_step().as_ref(), self.acceptance, series, &v, &y);
        self.next(&pace, &longest, &v, &y)
    }
}

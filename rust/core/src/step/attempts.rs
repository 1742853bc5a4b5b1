//! Attempts at adaptive steps, over symbols.

use super::{
    leaves::{block, ids, parameters},
    pace::{
        Acceptance, Attempted, Backward, Made, Pace, SINGLE_ROUNDING, Scales, Stretched, attempt, changes_within, judge, taken,
    },
    series_pace,
};
use crate::{
    model::{
        around::{self, controls},
        program::Program,
        spec::Signature,
        system::{Block, Kind, Shape, System},
        window,
    },
    tape::{
        Id, Op,
        number::{Number, Symbol},
        reserved::BUDGET,
    },
};

/// Where the rows of an attempt of float32 stand that is made in two parts: see [`AttemptsOf::tried`] and [`AttemptsOf::judged`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriedRows {
    /// Numbers of v and y, which come first.
    pub state: usize,
    /// Sampled inputs: their values stand behind the state, the time and the step.
    pub tables: usize,
    /// Numbers behind those: what the first part makes, and the second reads.
    pub results: usize,
    /// Numbers of the second part before those: the state, the pace and the sizes.
    pub judged: usize,
}

impl TriedRows {
    /// Of the first part: where its results begin.
    pub(crate) fn first_result(&self) -> usize {
        self.state + 2 + self.tables
    }
}

/// The model and the acceptance for which attempts at adaptive steps are traced.
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
        if self.backward { Box::new(Backward(self.made(-h))) } else { self.made(h) }
    }

    /// The system as it is, scaled to a step that may be below zero.
    fn made(&self, h: Symbol) -> Box<dyn System<Symbol>> {
        let p = parameters(self.signature, h);
        around::wrap_scaled(&p, (self.kind.make)(&p))
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

    /// The system scaled to a step of 1, under its projection if there is one. Where time runs backward, a projection sees
    /// energies and gradients of the system itself, scaled to a step of −1.
    fn projected(&self) -> Box<dyn System<Symbol>> {
        let h = Symbol::of(if self.backward { -1.0 } else { 1.0 });
        let under = around::wrap_without_forces(&parameters(self.signature, h), self.made(h), Symbol::of(0.0));
        if self.backward { Box::new(Backward(under)) } else { under }
    }

    fn state(&self) -> (Block<Symbol>, Block<Symbol>) {
        (block(0, self.shape.v), block(self.shape.v, self.shape.y))
    }

    /// The pace as a part of the state, behind v and y, and the sizes behind it.
    fn pace(&self) -> (Pace<Symbol>, Scales<Symbol>) {
        let first = self.shape.v + self.shape.y;
        let pace = Pace::of(std::array::from_fn(|i| Symbol::new(Op::State((first + i) as u32))));
        let numbers = block(first + Pace::<Symbol>::NUMBERS, self.acceptance.numbers(self.shape.v, self.shape.y));
        (pace, Scales::of(numbers.as_slice(), self.acceptance, first))
    }

    /// The next state: v and y, the pace, and the sizes.
    fn next((pace, scales): (&Pace<Symbol>, &Scales<Symbol>), v: &Block<Symbol>, y: &Block<Symbol>) -> Vec<Id> {
        let mut next = ids([v, y]);
        next.extend(pace.numbers().iter().chain(&scales.numbers()).map(|symbol| symbol.0));
        next
    }

    /// The system under its control and the force, for a step of that length.
    pub(super) fn rates(&self, step: Symbol) -> Box<dyn System<Symbol>> {
        let signature = self.signature;
        if signature.equations.is_some() {
            return self.forced(step, self.scaled(step)); // the push of their control depends on the step
        }
        let stretched = Box::new(Stretched { s: self.scaled(Symbol::of(1.0)), h: step });
        let pushed = match controls::pushes(signature) {
            true => around::wrap_without_forces(&parameters(signature, step), stretched, Symbol::of(0.0)),
            false => stretched,
        };
        self.forced(step, pushed)
    }

    /// The system whose control or projection acts on the state after a step.
    fn after(&self) -> Box<dyn System<Symbol>> {
        if controls::pushes(self.signature) { self.scaled(Symbol::of(1.0)) } else { self.projected() }
    }

    /// Where the rows of both parts of an attempt of float32 stand.
    pub(crate) fn rows(&self, program: &Program) -> TriedRows {
        let state = self.shape.v + self.shape.y;
        TriedRows {
            state,
            tables: self.signature.tables.len(),
            results: state * (program.results.len() / 2 + 1) + 1,
            judged: state + Pace::<Symbol>::NUMBERS + self.acceptance.numbers(self.shape.v, self.shape.y),
        }
    }

    /// The first part of an attempt of float32: from the state, the time, the step and the values of sampled inputs in it to the
    /// state after the step, the estimates of its error, the state that is projected, and what a control did. Nothing is decided.
    pub(crate) fn tried(&self, program: &Program) -> Vec<Id> {
        let ((v, y), rows) = (self.state(), self.rows(program));
        let given = block(rows.state, rows.first_result() - rows.state);
        let (t, step) = (given[0], given[1]);
        let values = given.iter().skip(2).copied().collect();
        let (made, projected, work) = window::held(values, || {
            let (s, after) = (self.rates(step), self.after());
            let made = program.run(s.as_ref(), t, step, &v, &y);
            let (new_v, new_y) = after.project(made[0].clone(), made[1].clone());
            let pushed = s.tally().map(|tally| tally / step);
            (made, [new_v, new_y], pushed.or(after.tally()).unwrap_or(Symbol::of(0.0)))
        });
        let mut next = ids([&v, &y, &given]);
        next.extend(ids(made.iter().chain(&projected)));
        next.push(work.0);
        next
    }

    /// The continuous extension of the next step, behind the state and the pace, which stay: its coefficients, how long the step
    /// is, and whether a group changes too much in it.
    pub(crate) fn extension(&self, program: &Program) -> Vec<Id> {
        let ((v, y), (pace, scales)) = (self.state(), self.pace());
        let step = pace.reach().0 - pace.t;
        let terms = program.run(self.rates(step).as_ref(), pace.t, step, &v, &y);
        let end = |start: &Block<Symbol>, first: usize| {
            let powers = terms.iter().skip(first).step_by(2);
            let change = series_pace::value(&start.map(|_| Symbol::of(0.0)), powers, Symbol::of(1.0));
            start.zip_map(&change, |start, change| start + change)
        };
        let sizes = |v: &Block<Symbol>, y: &Block<Symbol>| self.acceptance.sizes(v.as_slice(), y.as_slice());
        let changes = changes_within(&pace, &scales, &sizes(&v, &y), &sizes(&end(&v, 0), &end(&y, 1)));
        let mut next = Self::next((&pace, &scales), &v, &y);
        next.extend(ids(&terms));
        next.extend([step.0, Symbol::choose(changes, Symbol::of(1.0), Symbol::of(0.0)).0]);
        next
    }

    /// The second part, of float64: the decision, by the sizes of the state and of the errors.
    pub(crate) fn judged(&self, program: &Program, order: u32) -> Vec<Id> {
        let ((v, y), (pace, scales), rows) = (self.state(), self.pace(), self.rows(program));
        let (p, q) = (self.shape.v, self.shape.y);
        let pair = |i: usize| [block(rows.judged + i * rows.state, p), block(rows.judged + i * rows.state + p, q)];
        let pairs: Vec<[Block<Symbol>; 2]> = (0..program.results.len() / 2 + 1).map(pair).collect();
        let (tried, projected) = pairs.split_at(pairs.len() - 1);
        let blocks: Vec<&[Symbol]> = tried.iter().flatten().map(Block::as_slice).collect();
        let sizes = Made::of(self.acceptance, [v.as_slice(), y.as_slice()], &blocks);
        let has_mass = self.signature.equations.as_ref().is_some_and(|equations| equations.mass.is_some());
        let sizes = Made { rounding: SINGLE_ROUNDING, has_mass, ..sizes };
        let outlook = pace.outlook(Symbol::new(Op::Param(BUDGET)));
        let (next, scales, took) = judge(&pace, &scales, order, self.acceptance.counts(p, q), &sizes, outlook);
        let work = Symbol::new(Op::State((rows.judged + rows.results - 1) as u32));
        let next = Pace { work: Symbol::choose(took & !outlook.is_extra, pace.work + work, pace.work), ..next };
        let mut next = Self::next((&next, &scales), &taken(took, &projected[0][0], &v), &taken(took, &projected[0][1], &y));
        next.extend(ids([&block(rows.judged, rows.results)]));
        next
    }

    pub(crate) fn attempts(&self, program: &Program, order: u32) -> Vec<Id> {
        let ((v, y), (pace, scales)) = (self.state(), self.pace());
        let (rates, projected) = (|step: Symbol| self.rates(step), self.after());
        let system = Attempted { rates: &rates, projected: projected.as_ref() };
        let budget = Symbol::new(Op::Param(BUDGET));
        let (pace, scales, v, y) = attempt(program, &system, order, self.acceptance, (pace, &scales), budget, &v, &y);
        Self::next((&pace, &scales), &v, &y)
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
        let (pace, scales, v, y) =
            series_pace::attempt(terms, rates, projected.as_ref(), self.acceptance, (pace, &scales), budget, &v, &y);
        Self::next((&pace, &scales), &v, &y)
    }

    /// Whether a state that a series reaches is projected, so that it is not the sum of the series alone.
    pub(crate) fn projects(&self) -> bool {
        let (v, y) = self.state();
        let (projected_v, projected_y) = self.projected().project(v.clone(), y.clone());
        ids([&projected_v, &projected_y]) != ids([&v, &y])
    }

    /// Where a member stands at the start, without control.
    pub(crate) fn begin(&self, series: bool) -> Vec<Id> {
        let (v, y) = self.state();
        let (pace, scales) = self.pace();
        let (pace, longest) = pace.begun(self.of_unit_step().as_ref(), self.acceptance, series, &v, &y);
        Self::next((&pace, &Scales { longest, ..scales }), &v, &y)
    }
}

//! A sampled controller: every n steps it reads the state and sets parameters of the system, which it holds in between.
//!
//! Its memory follows the state, in this order: the number of steps since it read the state; its own state; its results that are
//! not put out yet, for each sample a number for each row that it sets, the oldest first; and, where it puts something out
//! between samples, the numbers that it holds. `reference/sampled.py` has the same.

use super::part::{Attempts, Part};
use crate::{
    error::Error,
    model::{
        spec::{Parameters, Signature},
        system::{Block, Kind, Shape, System},
        systems::equations::{check as fits, values_of},
    },
    tape::{
        number::{Number, Symbol},
        series,
    },
};

/// The names of the parameters that it sets.
const SETS: &str = "controller.sets";
/// How many samples its results wait.
const WAITING: &str = "controller.waiting";
/// How many steps there are from one sample to the next, less one.
const LAST: &str = "controller.last";
/// Steps from a sample until results are put out; not given where that is at a sample.
const LATER: &str = "controller.later";

/// The part: parameters are replaced before the system is made, so there is nothing to wrap.
pub(crate) fn part<N: Number>() -> Part<N> {
    Part {
        name: "a sampled controller",
        is_given: |signature| signature.controller.is_some(),
        check,
        velocity_term: |_, _| None,
        attempts: Attempts::Other,
        is_for_carry: false,
        is_only_fixed: |_| true,
        has_rows: false,
        wrap: |_, system, _| system,
    }
}

/// An error unless it sets parameters of the model, and reads only those and its own state.
fn check(_: &Kind, signature: &Signature, shape: Shape) -> Result<(), Error> {
    let Some(controller) = &signature.controller else { return Ok(()) };
    signature.expect(LAST, 1)?;
    let (made, set) = (controller.quantities().len(), rows(signature).len());
    if names(signature).any(|name| signature.count(name) == 0) || made < set {
        return Err(signature.unknown(SETS));
    }
    fits(controller, signature, shape.v + shape.y + made - set)
}

fn names(signature: &Signature) -> impl Iterator<Item = &str> {
    signature.word(SETS).split(',')
}

/// The rows of the parameters that it sets.
fn rows(signature: &Signature) -> Vec<usize> {
    let of = |name: &str| signature.place(name).map(|first| first..first + signature.count(name));
    names(signature).filter_map(of).flatten().collect()
}

/// How many numbers it remembers.
pub(crate) fn numbers(signature: &Signature) -> usize {
    let Some(controller) = &signature.controller else { return 0 };
    let (made, set) = (controller.quantities().len(), rows(signature).len());
    let held = if signature.count(LATER) > 0 { set } else { 0 };
    1 + made.saturating_sub(set) + set * (signature.whole(WAITING) + 1) + held
}

/// How many numbers of a parameter it sets; none of another.
pub(crate) fn sets(signature: &Signature, name: &str) -> Option<usize> {
    let is_set = signature.controller.is_some() && names(signature).any(|each| each == name);
    is_set.then(|| signature.count(name))
}

/// Sets the controlled parameters to the numbers that the controller holds between two steps.
pub(crate) fn set(p: &mut Parameters<Symbol>, memory: &Block<Symbol>) {
    if p.signature.controller.is_none() {
        return;
    }
    let rows = rows(p.signature);
    let queue = memory.len().saturating_sub(rows.len() * (p.signature.whole(WAITING) + 1));
    let held = if p.signature.count(LATER) > 0 { memory.len() - rows.len() } else { queue };
    rows.iter().enumerate().for_each(|(i, row)| p.numbers[*row] = memory[held + i]);
}

/// The memory of the controller after a step from a state. It sets the parameters for the step.
pub(crate) fn next(
    p: &mut Parameters<Symbol>,
    t: Symbol,
    v: &Block<Symbol>,
    y: &Block<Symbol>,
    memory: &Block<Symbol>,
) -> Vec<Symbol> {
    let Some(controller) = p.signature.controller.clone() else { return Vec::new() };
    let rows = rows(p.signature);
    let (set, states) = (rows.len(), controller.quantities().len() - rows.len());
    let (zero, one) = (Symbol::of(0.0), Symbol::of(1.0));
    let count = memory[0];
    let own = 1..1 + states;
    let due = count.at_most(zero);
    let seen = Block::from_iterator(y.len() + states, y.iter().chain(memory.rows(1, states).iter()).copied());
    let made = values_of(&controller, p, t, v, &seen);
    let mut next = vec![Symbol::choose(p.number(LAST).at_most(count), zero, count + one)];
    next.extend(own.clone().map(|i| Symbol::choose(due, made[set + i - 1], memory[i])));
    let queue = own.end;
    let waiting = set * p.signature.whole(WAITING);
    for i in 0..waiting + set {
        let shifted = if i < waiting { memory[queue + set + i] } else { made[i - waiting] };
        next.push(Symbol::choose(due, shifted, memory[queue + i]));
    }
    if let Some(later) = p.maybe(LATER) {
        let now = count.at_most(later) & later.at_most(count);
        let held = queue + waiting + set;
        for i in 0..set {
            next.push(Symbol::choose(now, next[queue + i], memory[held + i]));
        }
        rows.iter().enumerate().for_each(|(i, row)| p.numbers[*row] = next[held + i]);
    } else {
        rows.iter().enumerate().for_each(|(i, row)| p.numbers[*row] = next[queue + i]);
    }
    next
}

/// The system with the controlled parameters, which do not change within the step whatever they were computed from.
pub(crate) fn held(p: &Parameters<Symbol>, system: Box<dyn System<Symbol>>) -> Box<dyn System<Symbol>> {
    if p.signature.controller.is_none() {
        return system;
    }
    let set = rows(p.signature).into_iter().map(|row| p.numbers[row]).collect();
    Box::new(Held { system, set })
}

struct Held {
    system: Box<dyn System<Symbol>>,
    set: Vec<Symbol>,
}

impl Held {
    /// Tells a series that is being traced.
    fn mark(&self) {
        self.set.iter().for_each(|symbol| series::mark(*symbol, series::Mark::Factors(Vec::new(), None)));
    }
}

impl System<Symbol> for Held {
    fn inner(&self) -> Option<&dyn System<Symbol>> {
        Some(self.system.as_ref())
    }

    fn dv(&self, t: Symbol, v: &Block<Symbol>, y: &Block<Symbol>) -> Block<Symbol> {
        self.mark();
        self.system.dv(t, v, y)
    }

    fn dy(&self, t: Symbol, v: &Block<Symbol>, y: &Block<Symbol>) -> Block<Symbol> {
        self.mark();
        self.system.dy(t, v, y)
    }
}

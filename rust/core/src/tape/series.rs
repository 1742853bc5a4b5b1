//! Taylor series of the solution of a system, order after order, as operations on the tape.
//!
//! The rates are traced once. From their operations and the coefficients of the state up to order k follow those of the rates,
//! and from these the coefficients k + 1 of the state, by the recurrences of Jorba and Zou (Experimental Mathematics 14 (2005)
//! 99). Sums over products begin with the terms that are known longest, so that a step waits for the newest terms alone.
//! `reference/series.py` has the same recurrences in the same order.

use std::{
    cell::RefCell,
    collections::{BTreeSet, HashMap},
};

use stepwell_base::number::{Branch, Derivatives, Function, Number, Series as SeriesOf};

use super::{
    Id, Op,
    symbol::{Symbol, on_tape, operation},
};
use crate::functions::{cos, sin};

/// How a value depends on others, where its operations do not tell.
#[derive(Clone, Debug)]
pub(crate) enum Mark {
    /// It is a function of another value.
    Of(Function, Symbol),
    /// Its derivatives by other values, pairs of a value and the derivative by it; and its bounds, if it is one branch of
    /// several.
    Factors(Factors, Option<[f64; 2]>),
}

/// Marks that are noted while a series is traced.
#[derive(Default)]
struct Marks {
    values: HashMap<Id, Mark>,
    /// Whether the rates are a user's, which may begin at the ends of domains and far from the middle of what saturates.
    ends: bool,
}

thread_local! {
    /// The marks of the tape of this thread, while a series is traced.
    static MARKS: RefCell<Option<Marks>> = const { RefCell::new(None) };
}

/// Whether marks are noted.
pub(crate) fn is_marking() -> bool {
    MARKS.with_borrow(Option::is_some)
}

/// Notes a mark while a series is traced; the first mark of a value stays.
pub(crate) fn mark(value: Symbol, mark: Mark) {
    MARKS.with_borrow_mut(|marks| {
        if let Some(marks) = marks {
            marks.values.entry(value.0).or_insert(mark);
        }
    });
}

/// Notes that the rates are a user's.
pub(crate) fn mark_ends() {
    MARKS.with_borrow_mut(|marks| {
        if let Some(marks) = marks {
            marks.ends = true;
        }
    });
}

/// Pairs of a value and the derivative by it.
pub(crate) type Factors = Vec<(Symbol, Symbol)>;

/// A coefficient; none if it is known to be zero.
type Term = Option<Symbol>;

/// The Taylor coefficients 1 to `order` of a solution. The time is its value, the unit in whose powers they count, and this unit
/// over that of the rates.
pub(crate) fn of_solution(
    order: u32,
    start: &[Symbol],
    [time, length, unit]: [Symbol; 3],
    rates: &mut dyn FnMut() -> Vec<Symbol>,
) -> SeriesOf<Symbol> {
    let outer = MARKS.replace(Some(Marks::default()));
    let rates = rates();
    let mut series = Series::new(start, time, None, &rates);
    series.divides = !matches!(operation(unit.0), Op::Const(_));
    MARKS.set(outer);
    let mut made = Vec::with_capacity(order as usize);
    let mut own = BTreeSet::from([unit.0]);
    for k in 0..order as usize {
        series.advance(k);
        let next = rates.iter().map(|rate| series.term(rate.0, k).map(|term| series.share(unit, term, k + 1, &mut own)));
        let next: Vec<Term> = next.collect();
        for (symbol, term) in start.iter().zip(&next) {
            series.terms.entry(symbol.0).or_default().push(*term);
        }
        if let Some(terms) = series.terms.get_mut(&time.0) {
            terms.push((k == 0).then_some(length));
        }
        made.push(next.into_iter().map(|term| term.unwrap_or_else(|| Symbol::of(0.0))).collect());
    }
    note_evaluations(order, &rates, &series, &made, own);
    SeriesOf { terms: made, branches: series.branches() }
}

/// The derivatives of rates: of the series along one number of the state, or along the time, the coefficients of order 1.
///
/// The length of the step may have been chosen by the time, but does not change with it.
pub(crate) fn derivatives(
    state: &[Symbol],
    time: Symbol,
    step: Symbol,
    rates: &mut dyn FnMut() -> Vec<Symbol>,
) -> Derivatives<Symbol> {
    let outer = MARKS.replace(Some(Marks::default()));
    let rates = rates();
    let mut series = Series::new(state, time, Some(step), &rates);
    MARKS.set(outer);
    series.advance(0);
    let readers = series.readers();
    let mut along = |seed: Symbol| {
        // Most rates of a large system depend on few numbers of the state.
        let mut changed = BTreeSet::new();
        let mut open = vec![seed.0];
        while let Some(id) = open.pop() {
            let places = readers.get(&id).into_iter().flatten();
            open.extend(places.filter(|place| changed.insert(**place)).map(|place| series.values[*place]));
        }
        series.terms.entry(seed.0).or_default().push(Some(Symbol::of(1.0)));
        for &place in &changed {
            let id = series.values[place];
            let term = series.next(id, 1);
            series.terms.entry(id).or_default().push(term);
        }
        let derivatives = rates.iter().map(|rate| series.term(rate.0, 1)).collect();
        for id in changed.iter().map(|place| series.values[*place]).chain([seed.0]) {
            series.terms.entry(id).or_default().truncate(1);
        }
        derivatives
    };
    Derivatives { by_state: state.iter().map(|seed| along(*seed)).collect(), by_time: along(time) }
}

/// Notes what the coefficients cost in evaluations of the rates. The products by the unit and by 1/k are the method's `own`, as
/// the sums of stages are of other methods.
fn note_evaluations(order: u32, rates: &[Symbol], series: &Series, made: &[Vec<Symbol>], mut own: BTreeSet<Id>) {
    let all = (0..order as usize).flat_map(|k| rates.iter().map(move |rate| (rate.0, k)));
    let terms: Vec<Id> = all.filter_map(|(rate, k)| series.term(rate, k)).map(|term| term.0).collect();
    let is_scaled = |order: usize| order > 0 || own.iter().any(|id| !operation(*id).is_leaf());
    let products = made.iter().enumerate().filter(|(order, _)| is_scaled(*order)).flat_map(|(_, terms)| terms);
    let products: Vec<Id> = products.map(|term| unsigned(*term)).collect();
    own.extend(products);
    own.retain(|id| !operation(*id).is_leaf());
    on_tape(|tape| {
        let one = tape.changing(rates.iter().map(|rate| rate.0), &BTreeSet::new());
        // Rates that are copies take no operation: each order then counts as one evaluation.
        if one == 0 { tape.note_series(1, order as usize) } else { tape.note_series(one, tape.changing(terms, &own)) }
    });
}

struct Series {
    /// The coefficients so far of each value that changes with time.
    terms: HashMap<Id, Vec<Term>>,
    /// The values that change with time and are not the state or the time, each after those that its operation reads.
    values: Vec<Id>,
    /// Derivatives of some of these values by others.
    factors: HashMap<Id, Vec<(Symbol, Symbol)>>,
    /// Bounds of those that are one branch of several.
    bounds: HashMap<Id, [f64; 2]>,
    /// Reciprocals of divisors, and of roots twice over, each computed once.
    reciprocals: HashMap<Id, Symbol>,
    /// Whether a root that is zero, and what has an infinite slope in a divisor or a function, count as constant: there
    /// derivatives are not finite, or nothing depends on them.
    ends: bool,
    /// Whether coefficients of order k are divided by k. The rounding of its reciprocal would be in all of them alike, so that
    /// the energy of a long motion goes to one side. In steps of fixed length, whose unit is 1, they are multiplied by it.
    divides: bool,
}

impl Series {
    /// A series of values that change with the state and the time; `fixed` does not, whatever it was made of.
    fn new(start: &[Symbol], time: Symbol, fixed: Option<Symbol>, rates: &[Symbol]) -> Series {
        let mut terms: HashMap<Id, Vec<Term>> = start.iter().chain([&time]).map(|seed| (seed.0, vec![Some(*seed)])).collect();
        let (mut factors, mut bounds) = (HashMap::new(), HashMap::new());
        let mut needed = BTreeSet::new();
        let mut open: Vec<Id> = rates.iter().map(|rate| rate.0).collect();
        while let Some(id) = open.pop() {
            if terms.contains_key(&id) || fixed.is_some_and(|fixed| fixed.0 == id) || !needed.insert(id) {
                continue;
            }
            if let Some((of, within)) = factors_of(Symbol(id)) {
                bounds.extend(within.map(|within| (id, within)));
                open.extend(of.iter().flat_map(|(argument, factor)| [argument.0, factor.0]));
                factors.insert(id, of);
            } else {
                let (operands, n) = operation(id).operands();
                open.extend(&operands[..n]);
                if matches!(operation(id), Op::Sqrt(_)) {
                    bounds.insert(id, [0.0, f64::INFINITY]);
                }
            }
        }
        let mut values = Vec::new();
        for id in needed {
            let (operands, n) = operation(id).operands();
            let changes = match factors.get(&id) {
                Some(of) => of.iter().any(|(argument, _)| terms.contains_key(&argument.0)),
                None => operands[..n].iter().any(|operand| terms.contains_key(operand)),
            };
            if changes {
                terms.insert(id, Vec::new());
                values.push(id);
            }
        }
        let ends = MARKS.with_borrow(|marks| marks.as_ref().is_some_and(|marks| marks.ends));
        Series { terms, values, factors, bounds, reciprocals: HashMap::new(), ends, divides: false }
    }

    /// The values that are one branch of several, in the order in which they are made.
    fn branches(&self) -> Vec<Branch<Symbol>> {
        let bounded = self.values.iter().filter_map(|id| Some((id, self.bounds.get(id)?)));
        bounded.map(|(id, [least, most])| Branch { terms: self.terms[id].clone(), least: *least, most: *most }).collect()
    }

    /// The places among the values of those that each changes.
    fn readers(&self) -> HashMap<Id, Vec<usize>> {
        let mut readers: HashMap<Id, Vec<usize>> = HashMap::new();
        for (place, id) in self.values.iter().enumerate() {
            let (operands, n) = operation(*id).operands();
            match self.factors.get(id) {
                Some(of) => of.iter().for_each(|(argument, _)| readers.entry(argument.0).or_default().push(place)),
                None => operands[..n].iter().for_each(|operand| readers.entry(*operand).or_default().push(place)),
            }
        }
        readers
    }

    /// A coefficient; none is zero, or not there yet.
    fn term(&self, id: Id, k: usize) -> Term {
        match self.terms.get(&id) {
            Some(terms) => terms.get(k).copied().flatten(),
            None => (k == 0).then_some(Symbol(id)),
        }
    }

    /// The coefficients of order k of all values, from those of lower orders and that of the state.
    fn advance(&mut self, k: usize) {
        for i in 0..self.values.len() {
            let id = self.values[i];
            let term = if k == 0 { Some(Symbol(id)) } else { self.next(id, k) };
            if let Some(terms) = self.terms.get_mut(&id) {
                terms.push(term);
            }
        }
    }

    fn next(&mut self, id: Id, k: usize) -> Term {
        if let Some(factors) = self.factors.get(&id) {
            return self.of_function(factors, k);
        }
        match operation(id) {
            Op::Add(a, b) => sum(self.term(a, k), self.term(b, k)),
            Op::Sub(a, b) => difference(self.term(a, k), self.term(b, k)),
            Op::Neg(a) => self.term(a, k).map(|a| -a),
            Op::Mul(a, b) => self.product(a, b, k),
            Op::Div(a, b) => {
                if !self.terms.contains_key(&b) {
                    return self.term(a, k).map(|a| a / Symbol(b));
                }
                let known = (1..=k).fold(None, |total, j| sum(total, product(self.finite(b, j), self.term(id, k - j))));
                // A reciprocal and its negative are their own factors.
                if let Op::Const(bits) = operation(a) {
                    match f64::from_bits(bits) {
                        1.0 => return known.map(|known| -(known * Symbol(id))),
                        -1.0 => return known.map(|known| known * Symbol(id)),
                        _ => (),
                    }
                }
                let over = *self.reciprocals.entry(id).or_insert_with(|| Symbol::of(1.0) / Symbol(b));
                difference(self.term(a, k), known).map(|rest| rest * over)
            }
            Op::Sqrt(a) => {
                let ends = self.ends;
                let over = *self.reciprocals.entry(id).or_insert_with(|| {
                    let over = Symbol::of(0.5) / Symbol(id);
                    if ends { Symbol::choose(Symbol(id).equals(Symbol::of(0.0)), Symbol::of(0.0), over) } else { over }
                });
                let pairs =
                    (1..k.div_ceil(2)).rev().fold(None, |total, j| sum(total, product(self.term(id, j), self.term(id, k - j))));
                let twice = sum(pairs, pairs);
                let middle = if k.is_multiple_of(2) { product(self.term(id, k / 2), self.term(id, k / 2)) } else { None };
                difference(self.term(a, k), sum(middle, twice)).map(|rest| rest * over)
            }
            Op::Select(truth, a, b) => {
                let (a, b) = (self.term(a, k), self.term(b, k));
                let or_zero = |term: Term| term.unwrap_or_else(|| Symbol::of(0.0));
                (a.is_some() || b.is_some()).then(|| Symbol::new(Op::Select(truth, or_zero(a).0, or_zero(b).0)))
            }
            // Truths, bits and held samples are taken as they are at the start of the step.
            _ => None,
        }
    }

    /// A term of the rates times the unit over the order, and what it takes.
    fn share(&self, unit: Symbol, term: Symbol, order: usize, own: &mut BTreeSet<Id>) -> Symbol {
        if self.divides && !order.is_power_of_two() {
            let whole = unit * term;
            let parts = parts(whole, order as f64);
            own.extend(parts.iter().chain([&whole]).map(|part| unsigned(*part)));
            return total(parts);
        }
        let by = unit * Symbol::of(1.0 / order as f64);
        own.insert(by.0);
        by * term
    }

    /// The coefficient above order 0 of a divisor, or of what a function depends on, where it is finite, else 0.
    fn finite(&self, id: Id, k: usize) -> Term {
        let term = self.term(id, k);
        if !self.ends {
            return term;
        }
        let finite = |term: Symbol| term.and_bits(!(1 << 63)).below(Symbol::of(f64::INFINITY));
        term.map(|term| Symbol::choose(finite(term), term, Symbol::of(0.0)))
    }

    /// Σ aⱼ·bₖ₋ⱼ. Those with the newest coefficients come last: it is these that everything waits for. The others are two sums,
    /// those with the older of a apart from those with the older of b, so that neither waits for the other; of a square both are
    /// equal.
    fn product(&self, a: Id, b: Id, k: usize) -> Term {
        let middle = if k.is_multiple_of(2) { product(self.term(a, k / 2), self.term(b, k / 2)) } else { None };
        if a == b {
            let twice = |j: usize| sum(self.term(a, j), self.term(a, j));
            return (0..k.div_ceil(2)).rev().fold(middle, |total, j| sum(total, product(twice(j), self.term(a, k - j))));
        }
        let of_a = |j: usize| product(self.term(a, j), self.term(b, k - j));
        let of_b = |j: usize| product(self.term(a, k - j), self.term(b, j));
        if k == 0 {
            return middle;
        }
        let older = (1..k.div_ceil(2)).rev();
        let totals = older.fold((None, None), |(by_a, by_b), j| (sum(by_a, of_a(j)), sum(by_b, of_b(j))));
        sum(sum(sum(totals.0, totals.1), middle), sum(of_a(0), of_b(0))) // which does not depend on which of both is a
    }

    /// The k-th coefficient of y = f(a, b, …), from ẏ = f₁·ȧ + f₂·ḃ + …: k·yₖ = Σ j·aⱼ·f₁ₖ₋ⱼ + ….
    fn of_function(&self, factors: &[(Symbol, Symbol)], k: usize) -> Term {
        let mut total = None;
        for (argument, factor) in factors {
            for j in 1..=k {
                let slope = self.finite(argument.0, j).map(|term| Symbol::of(j as f64) * term);
                total = sum(total, product(slope, self.term(factor.0, k - j)));
            }
        }
        let k = k as f64;
        total.map(|total| if self.divides { self::total(parts(total, k)) } else { Symbol::of(1.0 / k) * total })
    }
}

/// The terms of a number divided by k: its product with 1/k, and the error by the rounding of 1/k. This takes a third of the time
/// of a division.
fn parts(number: Symbol, k: f64) -> Vec<Symbol> {
    const WHOLE: i128 = 1 << 90; // times the reciprocal of any order this is a whole number
    let reciprocal = 1.0 / k;
    let rest = WHOLE - k as i128 * (reciprocal * WHOLE as f64) as i128;
    let rest = rest as f64 / (k * WHOLE as f64);
    [reciprocal, rest].into_iter().filter(|part| *part != 0.0).map(|part| Symbol::of(part) * number).collect()
}

/// The sum of one or two.
fn total(parts: Vec<Symbol>) -> Symbol {
    parts.into_iter().reduce(|a, b| a + b).unwrap_or(Symbol::of(0.0))
}

/// The operation that makes a value but for its sign.
fn unsigned(value: Symbol) -> Id {
    match operation(value.0) {
        Op::Neg(of) => of,
        _ => value.0,
    }
}

/// The derivatives of a marked value by those that it is a function of, and its bounds if it is one branch of several.
fn factors_of(value: Symbol) -> Option<(Factors, Option<[f64; 2]>)> {
    let mark = MARKS.with_borrow(|marks| marks.as_ref()?.values.get(&value.0).cloned())?;
    Some(match mark {
        Mark::Of(Function::Sin, x) => (vec![(x, cos(x))], None),
        Mark::Of(Function::Cos, x) => (vec![(x, -sin(x))], None),
        Mark::Of(Function::Log, x) => (vec![(x, Symbol::of(1.0) / x)], None),
        Mark::Factors(factors, bounds) => (factors, bounds),
    })
}

fn sum(a: Term, b: Term) -> Term {
    match (a, b) {
        (Some(a), Some(b)) => Some(a + b),
        _ => a.or(b),
    }
}

fn difference(a: Term, b: Term) -> Term {
    match (a, b) {
        (Some(a), Some(b)) => Some(a - b),
        (None, Some(b)) => Some(-b),
        _ => a,
    }
}

fn product(a: Term, b: Term) -> Term {
    Some(a? * b?)
}

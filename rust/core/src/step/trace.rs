//! Traces a system and a method to tapes.

use super::{
    attempts::{AttemptsOf, TriedRows},
    key::StepKind,
    leaves::{block, ids, length, parameters, time},
    pace::Pace,
    properties::{recorded, shape},
    watch,
};
use crate::{
    error::Error,
    model::{
        around::{
            self,
            contact::{self, Contacts},
            sampled,
        },
        methods::Method,
        methods::method,
        program::{Program, Terms},
        spec::Signature,
        system::{Block, Kind, Shape},
        systems::{equations::next_state, kind, linear::products},
        window,
    },
    tape::{
        Id, Op, Tape,
        number::{Number, Symbol, record},
        real::Precision,
    },
};

/// A traced step, before it is cut: for tests, listings and comparisons.
#[derive(Clone, Debug)]
pub(crate) struct Steps {
    /// The tape.
    pub tape: Tape,
    /// The next state.
    pub next: Vec<Id>,
    /// How large the blocks are.
    pub shape: Shape,
    /// The coefficients of a series, of adaptive steps.
    pub terms: Vec<Id>,
}

/// Traces one step of a scene onto a tape that may hold something already.
pub(crate) fn trace_step(tape: Tape, signature: &Signature, how: &StepKind) -> Result<Steps, Error> {
    let shape = shape(signature, how)?;
    match how {
        StepKind::Matrix { nodes, fused } => {
            let (tape, next) = record(tape, || matrix(signature, shape, nodes, *fused));
            Ok(Steps { tape, next, shape, terms: Vec::new() })
        }
        StepKind::Step(step) => {
            let (tape, next) = record(tape, || {
                let p = parameters(signature, length(signature));
                let (v, y) = (block(0, shape.v), block(shape.v, shape.y));
                ids([&next_state(step, &p, time(signature), &v, &y)])
            });
            Ok(Steps { tape, next, shape, terms: Vec::new() })
        }
        StepKind::Method { name, choice } => {
            let (kind, method) = (kind(signature)?, method(name)?);
            let seen = || window::of_step(time(signature), length(signature), method.carries);
            let (tape, next) = record(tape, || window::over(signature, seen, || step(kind, signature, shape, &method, *choice)));
            Ok(Steps { tape, next, shape, terms: Vec::new() })
        }
        StepKind::Attempts { name, order, acceptance, backward } => {
            let (kind, method) = (kind(signature)?, method(name)?);
            let (Some(program), Some(estimate)) = (method.attempt(), method.error_order) else { return Err(Error::NoEstimate) };
            let attempts = AttemptsOf { kind, signature, shape, acceptance, backward: *backward };
            let single = tape.precision() == Precision::Single;
            let (tape, (next, terms)) = record(tape, || match series_order(program, *order) {
                Some(order) => attempts.series(order),
                None if single => (attempts.tried(program), Vec::new()),
                None => (attempts.attempts(program, estimate), Vec::new()),
            });
            Ok(Steps { tape, next, shape, terms })
        }
    }
}

/// The order of the series of attempts, if the method has one: the one that was asked for, or that of steps of fixed length.
fn series_order(program: &Program, asked: u32) -> Option<u32> {
    match program.series_order() {
        0 => None,
        own if asked == 0 => Some(own),
        _ => Some(asked),
    }
}

fn step(kind: &Kind, signature: &Signature, shape: Shape, method: &Method, choice: usize) -> Vec<Id> {
    let (h, t) = (length(signature), time(signature));
    let (v0, y0) = (block(0, shape.v), block(shape.v, shape.y));
    let mut p = parameters(signature, h);
    let before = kept(method, shape);
    let memory = memory(signature, method, shape);
    let remembered = sampled::next(&mut p, t, &v0, &y0, &memory);
    let behind = shape.v + shape.y + method.kept_numbers(shape) + memory.len();
    let tally = Symbol::new(Op::State(behind as u32));
    let s = sampled::held(&p, around::wrap(&p, (kind.make)(&p), tally));
    let mut made = method.program().run_with(s.as_ref(), t, h, &v0, &y0, &before).into_iter();
    let (new_v, new_y) = (made.next().unwrap_or_else(|| v0.clone()), made.next().unwrap_or_else(|| y0.clone()));
    let (mut v, mut y) = s.project(s.bring_to_rest(t, (&v0, &y0), new_v), new_y);
    let mut kept: Vec<_> = made.collect();
    if let Some(contacts) = Contacts::new(&p) {
        let carry = contact::carry(method, choice);
        [v, y] = contacts.after(carry, s.as_ref(), t, [&v0, &y0], [v, y], &mut kept);
    }
    let mut next = ids([&v, &y]);
    next.extend(ids(&kept));
    next.extend(remembered.into_iter().map(|symbol| symbol.0));
    next.extend(s.tally().map(|tally| tally.0));
    let first = next.len();
    next.extend(watch::next(&p, t, [&v, &y], first));
    next
}

/// The blocks that a method keeps beside the state, which stand behind it.
fn kept(method: &Method, shape: Shape) -> Vec<Block<Symbol>> {
    let mut behind = shape.v + shape.y;
    let numbers = method.kept.iter().map(|of_v| if *of_v { shape.v } else { shape.y });
    numbers
        .map(|numbers| {
            behind += numbers;
            block(behind - numbers, numbers)
        })
        .collect()
}

/// The memory of a sampled controller, which stands behind the blocks that a method keeps.
fn memory(signature: &Signature, method: &Method, shape: Shape) -> Block<Symbol> {
    block(shape.v + shape.y + method.kept_numbers(shape), sampled::numbers(signature))
}

/// Traces the second part of an attempt of float32, onto a tape of float64 that may hold something already; and where its rows
/// are.
pub(super) fn trace_judged(tape: Tape, signature: &Signature, how: &StepKind) -> Result<(Tape, Vec<Id>, TriedRows), Error> {
    let shape = shape(signature, how)?;
    let StepKind::Attempts { name, acceptance, backward, .. } = how else { return Err(Error::NoEstimate) };
    let (kind, method) = (kind(signature)?, method(name)?);
    let (Some(program), Some(order)) = (method.attempt(), method.error_order) else { return Err(Error::NoEstimate) };
    let attempts = AttemptsOf { kind, signature, shape, acceptance, backward: *backward };
    let (tape, next) = record(tape, || attempts.judged(program, order));
    Ok((tape, next, attempts.rows(program)))
}

/// Traces where a member stands at the start, without control, onto a tape that may hold something already.
pub(super) fn trace_begin(tape: Tape, signature: &Signature, how: &StepKind) -> Result<(Tape, Vec<Id>), Error> {
    let StepKind::Attempts { name, acceptance, backward, .. } = how else { return Err(Error::NoEstimate) };
    let kind = kind(signature)?;
    let attempts = AttemptsOf { kind, signature, shape: (kind.shape)(signature)?, acceptance, backward: *backward };
    let series = method(name)?.program().series_order() > 0;
    Ok(record(tape, || attempts.begin(series)))
}

/// Traces the coefficients of the continuous extension of a step, onto a tape that may hold something already.
pub(super) fn trace_extension(tape: Tape, signature: &Signature, how: &StepKind) -> Result<(Tape, Vec<Id>), Error> {
    let StepKind::Attempts { name, acceptance, backward, .. } = how else { return Err(Error::NoEstimate) };
    let (shape, kind, method) = (shape(signature, how)?, kind(signature)?, method(name)?);
    let program = method.extension().ok_or(Error::NoEstimate)?;
    let attempts = AttemptsOf { kind, signature, shape, acceptance, backward: *backward };
    Ok(record(tape, || attempts.extension(program)))
}

/// Traces an attempt by coefficients that stand behind the rest of the state, where they stay; and whether what they sum up to is
/// projected.
pub(super) fn trace_by_terms(
    tape: Tape,
    signature: &Signature,
    how: &StepKind,
    shape: Shape,
    numbers: usize,
) -> Result<(Tape, Vec<Id>, bool), Error> {
    let StepKind::Attempts { acceptance, backward, .. } = how else { return Err(Error::NoEstimate) };
    let attempts = AttemptsOf { kind: kind(signature)?, signature, shape, acceptance, backward: *backward };
    let (_, projects) = record(Tape::default(), || attempts.projects());
    let (tape, next) = record(tape, || {
        let state = shape.v + shape.y;
        let first = state + Pace::<Symbol>::NUMBERS + acceptance.numbers(shape.v, shape.y);
        let of = |k: usize| (block(first + k * state, shape.v), block(first + k * state + shape.v, shape.y));
        let terms: Terms<Symbol> = (0..numbers / state).map(of).collect();
        let mut next = attempts.attempt_by((&terms, &[]), None);
        next.extend(block(first, numbers).iter().map(|symbol| symbol.0));
        next
    });
    Ok((tape, next, projects))
}

/// s ← P·s + Σ Q·u; the sums run over s, then over the nodes and their inputs.
fn matrix(signature: &Signature, shape: Shape, nodes: &[u64], fused: bool) -> Vec<Id> {
    let (h, t) = (length(signature), time(signature));
    let p = parameters(signature, h);
    let n = shape.v + shape.y;
    let mut columns: Vec<Symbol> = block(0, n).iter().copied().collect();
    let inputs: Vec<_> = (0..signature.whole("inputs")).filter_map(|i| p.signal(&format!("inputs[{i}]"))).collect();
    window::over(
        signature,
        || window::of_step(t, h, signature.whole("carries") > 0),
        || {
            for node in nodes {
                let at = t + Symbol::of(f64::from_bits(*node)) * h;
                columns.extend(inputs.iter().map(|input| input.at(at)));
            }
        },
    );
    let (of_state, of_inputs) = (p.numbers("p"), p.numbers("q"));
    // P by rows; Q by columns, nodes and inputs, each with a number for every row.
    let entry = |i: usize, j: usize| if j < n { of_state[i * n + j] } else { of_inputs[(j - n) * n + i] };
    if fused {
        let sum = |i: usize| {
            let first = entry(i, 0) * columns[0];
            columns
                .iter()
                .enumerate()
                .skip(1)
                .fold(first, |sum, (j, column)| Symbol::new(Op::MulAdd(entry(i, j).0, column.0, sum.0)))
        };
        return (0..n).map(|i| sum(i).0).collect();
    }
    let made = products(n, columns.len(), |i, j| entry(i, j) * columns[j]);
    made.into_iter().map(|symbol| symbol.0).collect()
}

/// Traces a program of a method that changes the block v alone, and makes the blocks that are kept, if there are any.
pub(super) fn trace_slot(
    tape: Tape,
    signature: &Signature,
    method: &Method,
    program: &Program,
) -> Result<(Tape, Vec<Id>), Error> {
    let kind = kind(signature)?;
    let shape = (kind.shape)(signature)?;
    Ok(record(tape, || {
        let (h, t) = (length(signature), time(signature));
        let (v, y) = (block(0, shape.v), block(shape.v, shape.y));
        let mut p = parameters(signature, h);
        let memory = memory(signature, method, shape);
        sampled::set(&mut p, &memory);
        let made = || program.run(around::wrap_for_carry(&p, (kind.make)(&p)).as_ref(), t, h, &v, &y);
        let mut made = window::over(signature, || window::of_slot(t, h), made);
        made.insert(1, y);
        made.push(memory);
        ids(&made)
    }))
}

/// Traces the recorded quantities of a state onto a tape: a number for each, behind v, y and what a sampled controller remembers.
pub(crate) fn trace_record(tape: Tape, signature: &Signature, names: &[String]) -> Result<(Tape, Vec<Id>), Error> {
    let kind = kind(signature)?;
    let shape = (kind.shape)(signature)?;
    recorded(signature, names)?;
    Ok(record(tape, || {
        let (v, y) = (block(0, shape.v), block(shape.v, shape.y));
        let memory = block(shape.v + shape.y, sampled::numbers(signature));
        let mut p = parameters(signature, length(signature));
        sampled::set(&mut p, &memory);
        let s = (kind.make)(&p);
        let mut next = ids([&v, &y, &memory]);
        for name in names {
            let numbers = s.record(name, &v, &y).unwrap_or_else(|| p.numbers(name).to_vec());
            next.extend(numbers.into_iter().map(|symbol| symbol.0));
        }
        next
    }))
}

/// Traces a part of a scene by its name, for comparisons: "step", "attempt", its second part "judged", its "extension", "begin",
/// "start" and "finish" with the number of a way to start behind them, or "record" with a quantity behind it.
pub fn trace(tape: Tape, signature: &Signature, how: &StepKind, what: &str) -> Result<(Tape, Vec<Id>), Error> {
    let (what, which) = what.split_once(' ').unwrap_or((what, ""));
    let unknown = || Error::Options { system: signature.system.clone(), options: format!("trace {what} {which}") };
    let name = match how {
        StepKind::Method { name, .. } | StepKind::Attempts { name, .. } => name.as_str(),
        StepKind::Step(_) | StepKind::Matrix { .. } => "",
    };
    let choice = which.parse().unwrap_or(0);
    match what {
        "step" => trace_step(tape, signature, &started(how, choice)).map(|steps| (steps.tape, steps.next)),
        "attempt" if matches!(how, StepKind::Attempts { .. }) => {
            trace_step(tape, signature, how).map(|steps| (steps.tape, steps.next))
        }
        "judged" => trace_judged(tape, signature, how).map(|(tape, next, _)| (tape, next)),
        "extension" => trace_extension(tape, signature, how),
        "begin" => trace_begin(tape, signature, how),
        "start" | "finish" => {
            let method = method(name)?;
            let program = if what == "start" { method.start(choice) } else { method.finish(choice) };
            trace_slot(tape, signature, &method, program.ok_or_else(unknown)?)
        }
        "record" => trace_record(tape, signature, &[which.to_owned()]),
        _ => Err(unknown()),
    }
}

/// The method, started in its `choice`-th way.
fn started(how: &StepKind, choice: usize) -> StepKind {
    match how {
        StepKind::Method { name, choice: before } => StepKind::Method { name: name.clone(), choice: choice.max(*before) },
        other => other.clone(),
    }
}

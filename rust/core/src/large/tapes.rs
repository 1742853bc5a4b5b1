//! Rates as tapes of their own, for several members side by side, or for one where nobody has written a kernel.

use std::sync::Arc;

use super::{Facts, Rates};
use crate::{
    controls,
    error::Error,
    isa::Level,
    number::{Symbol, record},
    run::{
        aligned::Aligned,
        stage::{Clock, Loaded, Stage},
    },
    spec::{Given, Spec},
    system::{Block, Kind, Shape, System},
    tape::{Id, Op, Tape},
    trace::{block, cut, ids, kind, parameters, trace_record},
};

/// The rates of a system, traced. Their state is v, y, a block for what is made, and a number for what the system adds up.
pub struct Rated {
    shape: Shape,
    facts: Facts,
    /// Whether the system adds something up.
    tally: bool,
    dv: Option<Stage>,
    dy: Option<Stage>,
    velocity: Option<Stage>,
    settle: Option<Stage>,
    record: Option<Stage>,
}

/// The numbers of a state before what is made.
fn before(shape: Shape) -> usize {
    shape.v + shape.y
}

/// The numbers of a state before the tally.
fn behind(shape: Shape) -> usize {
    before(shape) + shape.v.max(shape.y)
}

/// Traces what is made of the system, v and y: a block or none, v and y.
fn rate(
    kind: &Kind,
    given: &Given,
    shape: Shape,
    make: impl FnOnce(&dyn System<Symbol>, Block<Symbol>, Block<Symbol>) -> (Option<Block<Symbol>>, Block<Symbol>, Block<Symbol>),
) -> (Tape, Vec<Id>) {
    record(Tape::default(), || {
        let state = |i: usize| Symbol::new(Op::State(i as u32));
        let (v, y) = (block(0, shape.v), block(shape.v, shape.y));
        let p = parameters(given, Symbol::new(Op::Step));
        let s = controls::wrap(&p, (kind.symbols)(&p), state(behind(shape)));
        let (made, v, y) = make(s.as_ref(), v, y);
        let mut next = ids([&v, &y]);
        next.extend(made.iter().flat_map(|made| made.iter().map(|symbol| symbol.0)));
        next.extend((next.len()..behind(shape)).map(|i| state(i).0));
        next.push(s.tally().unwrap_or_else(|| state(behind(shape))).0);
        next
    })
}

/// Whether numbers are those of v times the step.
fn is_v_times_step(tape: &Tape, made: &[Id]) -> bool {
    let is_step = |id: Id| tape.op(id) == Op::Step;
    made.iter().enumerate().all(|(i, id)| match tape.op(*id) {
        Op::Mul(a, b) => {
            let is_v = |id: Id| tape.op(id) == Op::State(i as u32);
            is_v(a) && is_step(b) || is_step(a) && is_v(b)
        }
        _ => false,
    })
}

impl Rated {
    /// Traces the rates of a system, and the quantities to record.
    pub fn new(given: &Given, names: &[String]) -> Result<Rated, Error> {
        let kind = kind(given)?;
        let shape = (kind.shape)(given)?;
        let time = || Symbol::new(Op::Time);
        let stage = |traced: &(Tape, Vec<Id>)| Some(cut(given, traced));
        let dv = rate(kind, given, shape, |s, v, y| (Some(s.dv(time(), &v, &y)), v, y));
        let dy = rate(kind, given, shape, |s, v, y| (Some(s.dy(time(), &v, &y)), v, y));
        let settle = rate(kind, given, shape, |s, v, y| {
            let (v, y) = s.settle(v, y);
            (None, v, y)
        });
        let second_order = shape.v == shape.y && is_v_times_step(&dy.0, &dy.1[before(shape)..][..shape.y]);
        let reads_v =
            dv.0.needed(dv.1[before(shape)..].iter().copied())
                .iter()
                .zip(dv.0.ops())
                .any(|(needed, op)| *needed && matches!(op, Op::State(i) if (*i as usize) < shape.v));
        let velocity =
            (!second_order && shape.v == shape.y).then(|| rate(kind, given, shape, |s, v, y| (Some(s.velocity(&y)), v, y)));
        let settles = (0..behind(shape) + 1).any(|i| settle.0.op(settle.1[i]) != Op::State(i as u32));
        let recorded = if names.is_empty() { None } else { Some(trace_record(Tape::default(), given, names)?) };
        Ok(Rated {
            shape,
            facts: Facts { second_order, reads_v },
            tally: controls::is_given(given),
            dv: if shape.v > 0 { stage(&dv) } else { None },
            dy: if second_order { None } else { stage(&dy) },
            velocity: velocity.as_ref().and_then(stage),
            settle: if settles { stage(&settle) } else { None },
            record: recorded.as_ref().and_then(stage),
        })
    }

    /// Operations of all its bodies.
    pub fn size(&self) -> usize {
        let stages = [&self.dv, &self.dy, &self.velocity, &self.settle, &self.record];
        stages.into_iter().flatten().map(Stage::size).sum::<usize>()
    }
}

/// How many members go side by side: a vector of them.
pub fn lanes(level: Level) -> usize {
    if level == Level::Avx2 { 4 } else { 8 }
}

/// Rates by tapes.
pub struct TapeRates {
    rated: Arc<Rated>,
    lanes: usize,
    dv: Option<Loaded>,
    dy: Option<Loaded>,
    velocity: Option<Loaded>,
    settle: Option<Loaded>,
    record: Option<Loaded>,
    state: Aligned,
    /// The state of what is recorded.
    aside: Vec<f64>,
}

impl TapeRates {
    /// For so many members side by side.
    pub fn new(rated: Arc<Rated>, spec: &Spec, level: Level, lanes: usize, clock: &Clock) -> TapeRates {
        let load = |stage: &Option<Stage>| {
            let stage = stage.as_ref()?;
            Some(Loaded::with(stage, stage.kit_of(level, lanes), spec, clock, f64::INFINITY))
        };
        let aside = rated.record.as_ref().map_or(0, |stage| stage.split.body.next.len());
        TapeRates {
            lanes,
            dv: load(&rated.dv),
            dy: load(&rated.dy),
            velocity: load(&rated.velocity),
            settle: load(&rated.settle),
            record: load(&rated.record),
            state: Aligned::new((behind(rated.shape) + 1) * lanes),
            aside: vec![0.0; aside * lanes],
            rated,
        }
    }

    fn sizes(&self) -> (usize, usize) {
        (self.rated.shape.v * self.lanes, self.rated.shape.y * self.lanes)
    }

    /// Puts a state where tapes find it.
    fn sit(&mut self, v: &[f64], y: &[f64]) {
        let at = self.sizes().0;
        self.state[..v.len()].copy_from_slice(v);
        self.state[at..at + y.len()].copy_from_slice(y);
    }

    /// Gives what was made by the last rate, or more that is nobody's.
    fn give(&self, out: &mut [f64]) {
        let (v, y) = self.sizes();
        let made = &self.state[v + y..behind(self.rated.shape) * self.lanes];
        let numbers = out.len().min(made.len());
        out[..numbers].copy_from_slice(&made[..numbers]);
    }
}

impl Rates for TapeRates {
    fn lanes(&self) -> usize {
        self.lanes
    }

    fn facts(&self) -> Facts {
        self.rated.facts
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        let TapeRates { rated, dv, dy, velocity, settle, record, .. } = self;
        let all =
            [(dv, &rated.dv), (dy, &rated.dy), (velocity, &rated.velocity), (settle, &rated.settle), (record, &rated.record)];
        for (loaded, stage) in all {
            if let (Some(loaded), Some(stage)) = (loaded, stage) {
                loaded.prepare(stage, spec, first, count);
            }
        }
    }

    fn dv(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        self.sit(if self.rated.facts.reads_v { v } else { &[] }, y);
        if let (Some(loaded), Some(stage)) = (&mut self.dv, &self.rated.dv) {
            loaded.advance_at(stage, t, &mut self.state);
        }
        self.give(out);
    }

    fn dy(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        self.sit(v, y);
        if let (Some(loaded), Some(stage)) = (&mut self.dy, &self.rated.dy) {
            loaded.advance_at(stage, t, &mut self.state);
        }
        self.give(out);
    }

    fn velocity(&mut self, d: &[f64], out: &mut [f64]) {
        self.sit(&[], d);
        if let (Some(loaded), Some(stage)) = (&mut self.velocity, &self.rated.velocity) {
            loaded.advance_at(stage, 0.0, &mut self.state);
        }
        self.give(out);
    }

    fn settle(&mut self, v: &mut [f64], y: &mut [f64]) {
        if self.settle.is_none() {
            return;
        }
        self.sit(v, y);
        if let (Some(loaded), Some(stage)) = (&mut self.settle, &self.rated.settle) {
            loaded.advance_at(stage, 0.0, &mut self.state);
        }
        let (new_v, new_y) = self.state.split_at(v.len());
        v.copy_from_slice(new_v);
        y.copy_from_slice(&new_y[..y.len()]);
    }

    fn record(&mut self, v: &[f64], y: &[f64], rows: &mut [f64]) {
        let before = v.len() + y.len();
        self.aside[..v.len()].copy_from_slice(v);
        self.aside[v.len()..before].copy_from_slice(y);
        if let (Some(loaded), Some(stage)) = (&mut self.record, &self.rated.record) {
            loaded.advance_at(stage, 0.0, &mut self.aside);
        }
        rows.copy_from_slice(&self.aside[before..]);
    }

    fn tally(&self) -> &[f64] {
        if self.rated.tally { &self.state[behind(self.rated.shape) * self.lanes..] } else { &[] }
    }

    fn tally_mut(&mut self) -> &mut [f64] {
        if self.rated.tally { &mut self.state[behind(self.rated.shape) * self.lanes..] } else { &mut [] }
    }
}

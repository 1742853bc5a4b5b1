//! Rates as tapes of their own, for several members side by side, or for one member of a system without a hand-written kernel.

use std::sync::{Arc, LazyLock};

use super::rates::{RateTraits, Rates};
use crate::{
    aligned::Aligned,
    error::Error,
    isa::Level,
    model::{
        around::{self, controls},
        spec::{Signature, Spec},
        system::{Block, Kind, Shape, System},
        systems::kind,
        window::{self, Window},
    },
    stage::{Clock, Force, PreparedStage, Stage},
    step::{
        block,
        cache::Cache,
        ids,
        key::{StepKind, TapeKey},
        parameters,
    },
    tape::{
        Id, Op, Tape,
        number::{Symbol, record},
        reserved::WINDOW_ENDS,
    },
};

static CACHE: LazyLock<Cache<CacheKey, RateTapes>> = LazyLock::new(Cache::default);

/// The system, its recorded quantities, and whether the force from outside is left out.
type CacheKey = (Arc<Signature>, Vec<String>, bool);

fn cache_key(key: &TapeKey) -> CacheKey {
    (key.signature.clone(), key.record.clone(), is_unforced(key))
}

/// Whether rates leave out the force from outside: attempts at adaptive steps add h times it to rates that are stretched to h.
fn is_unforced(key: &TapeKey) -> bool {
    matches!(key.how, StepKind::Attempts { .. })
}

/// The rates of a system, traced. Their state is v, y, a block for the result, and a number for the tally.
pub struct RateTapes {
    shape: Shape,
    traits: RateTraits,
    /// Whether the system has a tally, a sum over the steps.
    tally: bool,
    dv: Option<Stage>,
    dy: Option<Stage>,
    velocity: Option<Stage>,
    /// If true, the stage also computes the rate of v at its coordinates.
    project: Option<(Stage, bool)>,
    record: Option<(Stage, bool)>,
}

/// The numbers of a state before the result.
fn before(shape: Shape) -> usize {
    shape.v + shape.y
}

/// The numbers of a state before the tally.
fn behind(shape: Shape) -> usize {
    before(shape) + shape.v.max(shape.y)
}

/// A function of the system, v and y: a block or none, v and y.
type Made<'a> =
    &'a dyn Fn(&dyn System<Symbol>, Block<Symbol>, Block<Symbol>) -> (Option<Block<Symbol>>, Block<Symbol>, Block<Symbol>);

/// Traces a function of the system, v and y. Its results are a block or none, v and y.
fn rate(kind: &Kind, signature: &Signature, shape: Shape, unforced: bool, make: Made) -> (Tape, Vec<Id>) {
    record(Tape::default(), || {
        let state = |i: usize| Symbol::new(Op::State(i as u32));
        let (v, y) = (block(0, shape.v), block(shape.v, shape.y));
        let p = parameters(signature, Symbol::new(Op::Step));
        let (made, tally) = ((kind.make)(&p), state(behind(shape)));
        let s = match unforced {
            true => around::wrap_without_forces(&p, around::wrap_scaled(&p, made), tally),
            false => around::wrap(&p, made, tally),
        };
        let seen = || WINDOW_ENDS.map(|end| Symbol::new(Op::Param(end)));
        let (made, v, y) = window::over(signature, seen, || make(s.as_ref(), v, y));
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

impl RateTapes {
    /// Traces the rates of a system, and the quantities to record.
    fn new(key: &TapeKey) -> Result<RateTapes, Error> {
        let (signature, names) = (key.signature.as_ref(), &key.record);
        let kind = kind(signature)?;
        let shape = (kind.shape)(signature)?;
        let rate = |make: Made| rate(kind, signature, shape, is_unforced(key), make);
        let time = || Symbol::new(Op::Time);
        let stage = |traced: &(Tape, Vec<Id>)| Some(Stage::cut(signature, traced));
        let dv = rate(&|s, v, y| (Some(s.dv(time(), &v, &y)), v, y));
        let dy = rate(&|s, v, y| (Some(s.dy(time(), &v, &y)), v, y));
        let second_order = shape.v == shape.y && is_v_times_step(&dy.0, &dy.1[before(shape)..][..shape.y]);
        let needed = dv.0.needed(dv.1[before(shape)..].iter().copied());
        let reads = |what: &dyn Fn(Op) -> bool| needed.iter().zip(dv.0.ops()).any(|(needed, op)| *needed && what(*op));
        let reads_v = reads(&|op| matches!(op, Op::State(i) if (i as usize) < shape.v));
        let is_of_y = !reads_v && !reads(&|op| matches!(op, Op::Time | Op::Sample(..)));
        let velocity = (!second_order && shape.v == shape.y).then(|| rate(&|s, v, y| (Some(s.velocity(&y)), v, y)));
        // Where a tape that also computes h·v̇ costs hardly more than without, it does so, and the next step uses it.
        let work = |(tape, next): &(Tape, Vec<Id>)| tape.needed(next.iter().copied()).iter().filter(|needed| **needed).count();
        let with_rate = |trace: &dyn Fn(bool) -> (Tape, Vec<Id>)| {
            let (alone, both) = (trace(false), trace(is_of_y));
            let is_cheap = is_of_y && 4 * work(&both) <= 4 * work(&alone) + work(&dv);
            (Stage::cut(signature, if is_cheap { &both } else { &alone }), is_cheap)
        };
        let project = |with_dv: bool| {
            rate(&|s, v, y| {
                let (v, y) = s.project(v, y);
                (with_dv.then(|| s.dv(time(), &v, &y)), v, y)
            })
        };
        let (tape, next) = project(false);
        let projects = next.iter().enumerate().any(|(i, id)| tape.op(*id) != Op::State(i as u32));
        let quantities = |with_dv: bool| {
            record(Tape::default(), || {
                let (v, y) = (block(0, shape.v), block(shape.v, shape.y));
                let p = parameters(signature, Symbol::new(Op::Step));
                let s = around::wrap_for_carry(&p, (kind.make)(&p));
                let mut next = ids([&v, &y]);
                let made = names.iter().filter_map(|name| s.record(name, &v, &y)).flatten();
                next.extend(made.map(|symbol| symbol.0));
                next.extend(with_dv.then(|| ids([&s.dv(time(), &v, &y)])).into_iter().flatten());
                next
            })
        };
        Ok(RateTapes {
            shape,
            traits: RateTraits { second_order, reads_v, stretched: false },
            tally: controls::is_given(signature),
            dv: if shape.v > 0 { stage(&dv) } else { None },
            dy: if second_order { None } else { stage(&dy) },
            velocity: velocity.as_ref().and_then(stage),
            project: projects.then(|| with_rate(&project)),
            record: (!names.is_empty()).then(|| with_rate(&quantities)),
        })
    }

    /// The cached tapes for a key, built on first use and shared by all methods.
    pub fn of(key: &TapeKey) -> Result<Arc<RateTapes>, Error> {
        CACHE.find(&cache_key(key), || {
            let tapes = RateTapes::new(key)?;
            let size = tapes.size();
            Ok((tapes, size))
        })
    }

    /// Whether these tapes are there already.
    pub(crate) fn are_known(key: &TapeKey) -> bool {
        CACHE.has(&cache_key(key))
    }

    /// Operations of all its bodies.
    pub(crate) fn size(&self) -> usize {
        let rates = [&self.dv, &self.dy, &self.velocity].into_iter().flatten();
        let others = [&self.project, &self.record].into_iter().flatten().map(|(stage, _)| stage);
        rates.chain(others).map(Stage::size).sum::<usize>()
    }
}

/// How many members go side by side: a vector of them.
pub(crate) fn lanes(level: Level) -> usize {
    if level == Level::Avx2 { 4 } else { 8 }
}

/// Rates by tapes.
pub struct TapeRates {
    rated: Arc<RateTapes>,
    lanes: usize,
    dv: Option<PreparedStage>,
    dy: Option<PreparedStage>,
    velocity: Option<PreparedStage>,
    project: Option<PreparedStage>,
    record: Option<PreparedStage>,
    state: Aligned,
    /// The state of what is recorded.
    record_state: Vec<f64>,
    /// Whether `known` is the rate of v at the coordinates `y`.
    is_known: bool,
    y: Vec<f64>,
    known: Vec<f64>,
    window: Option<Window<f64>>,
}

fn keep(to: &mut Vec<f64>, numbers: &[f64]) {
    to.clear();
    to.extend_from_slice(numbers);
}

impl TapeRates {
    /// The rates of `lanes` members side by side.
    pub fn new(rated: Arc<RateTapes>, spec: &Spec, level: Level, lanes: usize, clock: &Clock) -> TapeRates {
        let load = |stage: &Stage| {
            let compiled = stage.compiled_for_lanes(level, lanes);
            compiled.runner.write(); // rates that are traced are going to be evaluated often
            PreparedStage::with(stage, compiled, spec, clock, f64::INFINITY)
        };
        let record_state = rated.record.as_ref().map_or(0, |(stage, _)| stage.split.body.next.len());
        TapeRates {
            lanes,
            dv: rated.dv.as_ref().map(load),
            dy: rated.dy.as_ref().map(load),
            velocity: rated.velocity.as_ref().map(load),
            project: rated.project.as_ref().map(|(stage, _)| load(stage)),
            record: rated.record.as_ref().map(|(stage, _)| load(stage)),
            state: Aligned::new((behind(rated.shape) + 1) * lanes),
            record_state: vec![0.0; record_state * lanes],
            is_known: false,
            y: Vec::new(),
            known: Vec::new(),
            window: None,
            rated,
        }
    }

    fn sizes(&self) -> (usize, usize) {
        (self.rated.shape.v * self.lanes, self.rated.shape.y * self.lanes)
    }

    /// Does something with all stages that changes the rates.
    fn stages(&mut self, action: impl Fn(&mut PreparedStage, &Stage)) {
        let TapeRates { rated, dv, dy, velocity, project, record, .. } = self;
        let all = [
            (dv, rated.dv.as_ref()),
            (dy, rated.dy.as_ref()),
            (velocity, rated.velocity.as_ref()),
            (project, rated.project.as_ref().map(|(stage, _)| stage)),
            (record, rated.record.as_ref().map(|(stage, _)| stage)),
        ];
        for (prepared, stage) in all {
            if let (Some(prepared), Some(stage)) = (prepared, stage) {
                action(prepared, stage);
            }
        }
        self.is_known = false;
    }

    /// Copies a state to where the tapes read it.
    fn set_state(&mut self, v: &[f64], y: &[f64]) {
        let at = self.sizes().0;
        self.state[..v.len()].copy_from_slice(v);
        self.state[at..at + y.len()].copy_from_slice(y);
    }

    /// Copies the result of the last rate; what fills the last vectors beyond it is arbitrary.
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

    fn traits(&self) -> RateTraits {
        self.rated.traits
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        self.stages(|prepared, stage| prepared.prepare(stage, spec, first, count));
    }

    fn set_force(&mut self, force: &Force, first: usize, count: usize) {
        self.stages(|prepared, stage| prepared.set_force(stage, force, first, count));
    }

    fn set_window(&mut self, window: Option<Window<f64>>) {
        self.window = window;
    }

    fn dv(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        if self.is_known && y.iter().zip(&self.y).all(|(a, b)| a.to_bits() == b.to_bits()) {
            out[..self.known.len()].copy_from_slice(&self.known);
            return;
        }
        self.is_known = false;
        self.set_state(if self.rated.traits.reads_v { v } else { &[] }, y);
        let window = self.window.unwrap_or([t, t, 1.0]);
        if let (Some(prepared), Some(stage)) = (&mut self.dv, &self.rated.dv) {
            prepared.advance_over(stage, t, window, &mut self.state);
        }
        self.give(out);
    }

    fn dy(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        self.set_state(v, y);
        let window = self.window.unwrap_or([t, t, 1.0]);
        if let (Some(prepared), Some(stage)) = (&mut self.dy, &self.rated.dy) {
            prepared.advance_over(stage, t, window, &mut self.state);
        }
        self.give(out);
    }

    fn velocity(&mut self, d: &[f64], out: &mut [f64]) {
        self.set_state(&[], d);
        if let (Some(prepared), Some(stage)) = (&mut self.velocity, &self.rated.velocity) {
            prepared.advance_at(stage, 0.0, &mut self.state);
        }
        self.give(out);
    }

    fn project(&mut self, v: &mut [f64], y: &mut [f64]) {
        if self.project.is_none() {
            return;
        }
        self.set_state(v, y);
        let (sizes, mut gives) = (self.sizes(), false);
        if let (Some(prepared), Some((stage, with_dv))) = (&mut self.project, &self.rated.project) {
            prepared.advance_at(stage, 0.0, &mut self.state);
            gives = *with_dv;
        }
        let (new_v, rest) = self.state.split_at(sizes.0);
        let (new_y, made) = rest.split_at(sizes.1);
        v.copy_from_slice(new_v);
        y.copy_from_slice(new_y);
        if gives {
            keep(&mut self.y, new_y);
            keep(&mut self.known, &made[..sizes.0]);
        }
        self.is_known = gives;
    }

    fn record(&mut self, v: &[f64], y: &[f64], rows: &mut [f64]) {
        let Some((stage, gives)) = &self.rated.record else { return };
        let before = v.len() + y.len();
        self.record_state[..v.len()].copy_from_slice(v);
        self.record_state[v.len()..before].copy_from_slice(y);
        if let Some(prepared) = &mut self.record {
            prepared.advance_at(stage, 0.0, &mut self.record_state);
        }
        let (quantities, dv) = self.record_state[before..].split_at(rows.len());
        rows.copy_from_slice(quantities);
        if *gives {
            keep(&mut self.y, y);
            keep(&mut self.known, dv);
            self.is_known = true;
        }
    }

    fn tally(&self) -> &[f64] {
        if self.rated.tally { &self.state[behind(self.rated.shape) * self.lanes..] } else { &[] }
    }

    fn tally_mut(&mut self) -> &mut [f64] {
        if self.rated.tally { &mut self.state[behind(self.rated.shape) * self.lanes..] } else { &mut [] }
    }
}

//! Values of a tape for many members, each from numbers of its own: the quantities that are checked between steps.

use std::sync::{Arc, LazyLock};

use smallvec::SmallVec;

use crate::{
    aligned::Aligned,
    error::Error,
    isa::Level,
    kernel::{Tile, runner::KernelKind},
    model::spec::{Row, Table},
    stage::{CompiledStage, Stage},
    step::cache::Cache,
    tape::{
        Id, Op, Tape,
        real::{Precision, Real},
        split::{Body, Split},
    },
};

/// A type of number in which values are computed, and the cache of its stages.
pub trait Cached: Real {
    /// The stage of a tape that is not cut.
    fn stage(body: Body) -> Result<Arc<Stage<Self>>, Error>;
}

macro_rules! cached {
    ($float:ident) => {
        impl Cached for $float {
            fn stage(body: Body) -> Result<Arc<Stage<$float>>, Error> {
                static CACHE: LazyLock<Cache<Body, Stage<$float>>> = LazyLock::new(Cache::default);
                let make = || Ok((Stage::new(Split { body: body.clone(), ..Split::default() }), body.ops.len()));
                CACHE.find(&body, make)
            }
        }
    };
}
cached!(f64);
cached!(f32);

/// Values with their kernels, which all that have the same operations share.
pub struct Evaluation<T: Real = f64> {
    stage: Arc<Stage<T>>,
    states: usize,
    /// How many parameters there are; behind their rows stand those of samples.
    parameters: usize,
    samples: Option<Arc<Samples>>,
}

/// The samples that values depend on.
struct Samples {
    /// The times at which they are looked up, as values of the same numbers.
    times: Evaluation,
    /// The number of the table of each.
    tables: Vec<u32>,
}

impl<T: Real> Clone for Evaluation<T> {
    fn clone(&self) -> Self {
        let Evaluation { stage, states, parameters, samples } = self;
        Evaluation { stage: Arc::clone(stage), states: *states, parameters: *parameters, samples: samples.clone() }
    }
}

impl<T: Cached> Evaluation<T> {
    /// Compiles values that depend on `states` numbers of the state, on parameters and on samples; none if they depend on a step
    /// or a time, which of 32 bits are the first numbers of the state, or, of 32 bits, on samples.
    pub fn new(tape: &Tape, values: &[Id], states: usize) -> Result<Option<Evaluation<T>>, Error> {
        let number = |op: &Op| if let Op::Param(i) = op { *i as usize + 1 } else { 0 };
        let parameters = tape.ops().iter().map(number).max().unwrap_or(0);
        let (body, looked_up) = Body::of_values(tape, values, states as u32, parameters as u32);
        if body.ops.iter().any(|op| matches!(op, Op::Step | Op::Time)) {
            return Ok(None);
        }
        let samples = if looked_up.is_empty() {
            None
        } else if T::PRECISION == Precision::Single {
            return Ok(None);
        } else {
            let (tables, times): (Vec<_>, Vec<_>) = looked_up.into_iter().unzip();
            let Some(times) = Evaluation::new(tape, &times, states)? else { return Ok(None) };
            Some(Arc::new(Samples { times, tables }))
        };
        Ok(Some(Evaluation { stage: T::stage(body)?, states, parameters, samples }))
    }

    /// Whether they depend on samples: then an `Evaluator` alone computes them.
    pub fn has_samples(&self) -> bool {
        self.samples.is_some()
    }

    /// How many values there are.
    pub fn values(&self) -> usize {
        self.stage.split.body.next.len()
    }
}

impl Evaluation {
    /// Computes the values of `members` members, by rows, from rows of the state and of the parameters.
    pub fn run(&self, level: Level, (state, parameters): (&[Row], &[Row]), members: usize, values: &mut [f64]) {
        // A power of two, since kernels for fewer members than that are kept.
        let compiled = self.stage.compiled(level, members.next_power_of_two());
        let mut tile = Filled::new(self, compiled);
        let missing = Row(&[f64::NAN]);
        let row = |i: usize| match i.checked_sub(self.states) {
            None => state.get(i),
            Some(parameter) => parameters.get(parameter),
        };
        let inputs: Vec<&Row> = (0..self.stage.split.body.rows).map(|i| row(i).unwrap_or(&missing)).collect();
        for first in (0..members).step_by(tile.lanes) {
            let count = tile.lanes.min(members - first);
            for (i, input) in inputs.iter().enumerate() {
                input.fill(first, count, tile.row(i));
            }
            tile.run();
            for (value, row) in values.chunks_exact_mut(members).zip(tile.values.chunks_exact(tile.lanes)) {
                value[first..first + count].copy_from_slice(&row[..count]);
            }
        }
    }
}

/// The rows of a tile, to fill and to run.
pub(crate) struct Filled<T: Real = f64> {
    compiled: Arc<CompiledStage<T>>,
    pub lanes: usize,
    states: usize,
    rows: Aligned<T>,
    /// A row for each value.
    pub values: Aligned<T>,
    pool: Option<(KernelKind, Vec<T>)>,
    scratch: Vec<T>,
}

impl<T: Real> Filled<T> {
    fn new(evaluation: &Evaluation<T>, compiled: Arc<CompiledStage<T>>) -> Filled<T> {
        let lanes = compiled.runner.lanes();
        let body = &evaluation.stage.split.body;
        let (rows, values) = (Aligned::new(body.rows * lanes), Aligned::new(body.next.len() * lanes));
        Filled { compiled, lanes, states: evaluation.states, rows, values, pool: None, scratch: Vec::new() }
    }

    /// A tile of `lanes` lanes.
    pub(crate) fn of_lanes(evaluation: &Evaluation<T>, level: Level, lanes: usize) -> Filled<T> {
        Filled::new(evaluation, evaluation.stage.compiled_for_lanes(level, lanes))
    }

    /// A row of the state or, after these, of the parameters; empty where no value depends on them.
    pub(crate) fn row(&mut self, i: usize) -> &mut [T] {
        self.rows.chunks_exact_mut(self.lanes).nth(i).unwrap_or_default()
    }

    /// Takes the parameters of the `count` members from `first` on.
    pub(crate) fn prepare(&mut self, parameters: &[Row], first: usize, count: usize) {
        for (i, parameter) in parameters.iter().enumerate() {
            let row = self.row(self.states + i);
            if !row.is_empty() {
                parameter.fill(first, count, row);
            }
        }
    }

    /// Takes the parameters of a member into a lane.
    pub(crate) fn prepare_lane(&mut self, parameters: &[Row], lane: usize, member: usize) {
        for (i, parameter) in parameters.iter().enumerate() {
            if let Some(number) = self.row(self.states + i).get_mut(lane) {
                *number = T::of(parameter.at(member));
            }
        }
    }

    /// Computes the values.
    pub(crate) fn run(&mut self) {
        let (kernel, kind) = self.compiled.runner.kernel(1);
        if self.pool.as_ref().is_none_or(|(known, _)| *known != kind) {
            self.pool = Some((kind, kernel.pool(&[])));
        }
        let pool = self.pool.as_ref().map_or(&[][..], |(_, pool)| pool);
        let tile = &mut Tile { state: &mut self.values, rows: &self.rows, pool, steps: 1, per_step: &[], held: &[] };
        kernel.run(tile, &mut self.scratch);
    }
}

/// Values for any members, asked for again and again, some at a time.
pub(crate) struct Evaluator<'a, T: Real = f64> {
    evaluation: &'a Evaluation<T>,
    parameters: &'a [Row<'a>],
    tables: &'a [Table<'a>],
    level: Level,
    /// Tiles for one or two members, and for many.
    tiles: [Option<Filled<T>>; 2],
    /// The values of one member.
    values: Vec<f64>,
    /// The times of samples.
    times: Option<Box<Evaluator<'a>>>,
}

/// Fewer members are computed one by one.
pub(super) const FEW: usize = 3;
/// From this many members on, the widest tile pays.
const MANY: usize = 64;

/// A tile for about `members` members, with the parameters that all have in common.
fn tile_of<'t, T: Real>(
    tile: &'t mut Option<Filled<T>>,
    evaluation: &Evaluation<T>,
    parameters: &[Row],
    level: Level,
    members: usize,
) -> &'t mut Filled<T> {
    tile.get_or_insert_with(|| {
        let mut tile = Filled::new(evaluation, evaluation.stage.compiled(level, members));
        for (i, parameter) in parameters.iter().enumerate().filter(|(_, parameter)| parameter.is_common()) {
            tile.row(evaluation.states + i).fill(T::of(parameter.at(0)));
        }
        tile
    })
}

impl<'a, T: Cached> Evaluator<'a, T> {
    pub(crate) fn new(evaluation: &'a Evaluation<T>, parameters: &'a [Row<'a>], tables: &'a [Table<'a>], level: Level) -> Self {
        let parameters = &parameters[..evaluation.parameters.min(parameters.len())];
        let times =
            evaluation.samples.as_ref().map(|samples| Box::new(Evaluator::new(&samples.times, parameters, tables, level)));
        Evaluator { evaluation, parameters, tables, level, tiles: [None, None], values: Vec::new(), times }
    }

    /// The samples of a member that hold at these times.
    fn samples(&self, member: usize, times: &[f64]) -> impl Iterator<Item = f64> {
        let numbers = self.evaluation.samples.iter().flat_map(|samples| &samples.tables);
        numbers.zip(times).map(move |(table, t)| self.tables.get(*table as usize).map_or(f64::NAN, |table| table.at(*t, member)))
    }

    /// The values of one member from its numbers of the state, those of some blocks one after the other.
    pub(crate) fn one(&mut self, member: usize, state: &[&[f64]]) -> &[f64] {
        let (n, results, read) = (self.evaluation.states, self.evaluation.values(), self.evaluation.stage.split.body.rows);
        let times: SmallVec<[f64; 4]> = self.times.as_mut().map(|times| times.one(member, state).into()).unwrap_or_default();
        let samples: SmallVec<[f64; 4]> = self.samples(member, &times).collect();
        let tile = tile_of(&mut self.tiles[0], self.evaluation, self.parameters, self.level, 1);
        let lanes = tile.lanes;
        for (row, number) in state.iter().copied().flatten().take(read.min(n)).enumerate() {
            tile.rows[row * lanes] = T::of(*number);
        }
        for (row, parameter) in self.parameters.iter().enumerate().take(read.saturating_sub(n)) {
            if !parameter.is_common() {
                tile.rows[(n + row) * lanes] = T::of(parameter.0[member]);
            }
        }
        let first = n + self.evaluation.parameters;
        samples.iter().enumerate().for_each(|(i, sample)| tile.rows[(first + i) * lanes] = T::of(*sample));
        tile.run();
        self.values.clear();
        self.values.extend(tile.values.iter().step_by(lanes).take(results).map(|x| x.wide()));
        &self.values
    }

    /// The values of each of these members, one after the other, from its numbers of the state, which follow each other likewise.
    pub(crate) fn run(&mut self, members: &[usize], states: &[f64]) -> Vec<f64> {
        let is_many = members.len() >= FEW;
        let (n, results, read) = (self.evaluation.states, self.evaluation.values(), self.evaluation.stage.split.body.rows);
        let (evaluation, parameters) = (self.evaluation, self.parameters);
        let many = if is_many { MANY } else { 1 };
        let times = self.times.as_mut().map(|times| times.run(members, states)).unwrap_or_default();
        let looked_up = times.len() / members.len().max(1);
        let samples: Vec<f64> = (0..members.len())
            .flat_map(|i| self.samples(members[i], &times[i * looked_up..(i + 1) * looked_up]).collect::<SmallVec<[f64; 4]>>())
            .collect();
        let tile = tile_of(&mut self.tiles[usize::from(is_many)], evaluation, parameters, self.level, many);
        let lanes = tile.lanes;
        let mut values = vec![0.0; members.len() * results];
        let own = self.parameters.iter().enumerate().filter(|(i, parameter)| n + i < read && !parameter.is_common());
        for (i, some) in members.chunks(lanes).enumerate() {
            let first = i * lanes;
            let given = &states[first * n..(first + some.len()) * n];
            for (row, numbers) in tile.rows.chunks_exact_mut(lanes).take(read.min(n)).enumerate() {
                let last = given[(some.len() - 1) * n + row];
                numbers.iter_mut().zip(given.chunks_exact(n)).for_each(|(to, state)| *to = T::of(state[row]));
                numbers[some.len()..].fill(T::of(last));
            }
            for (row, parameter) in own.clone() {
                let numbers = tile.row(n + row);
                numbers.iter_mut().zip(some).for_each(|(to, member)| *to = T::of(parameter.0[*member]));
                numbers[some.len()..].fill(T::of(parameter.0[some[some.len() - 1]]));
            }
            for row in 0..looked_up {
                let of_row = samples.iter().skip(first * looked_up + row).step_by(looked_up);
                tile.row(n + evaluation.parameters + row).iter_mut().zip(of_row).for_each(|(to, sample)| *to = T::of(*sample));
            }
            tile.run();
            let to = &mut values[first * results..(first + some.len()) * results];
            for (result, row) in tile.values.chunks_exact(lanes).enumerate() {
                to.chunks_exact_mut(results).zip(row).for_each(|(to, number)| to[result] = number.wide());
            }
        }
        values
    }
}

//! The equations of implicit steps of large systems: their numbers by a tape, and their solution over rows.
//!
//! `model/pivoting.rs` has the same operations in the same order, over symbols.

use std::{
    ops::Range,
    sync::{Arc, LazyLock},
};

use super::rates::{RateTraits, Rates};
use crate::{
    aligned::Aligned,
    error::Error,
    isa::Level,
    model::{
        methods::method,
        ordering::{Columns, Ordering},
        spec::{Signature, Spec},
        system::Shape,
        window::Window,
    },
    stage::{Clock, Force, PreparedStage, Stage, Stop},
    step::{
        cache::Cache,
        key::{StepKind, TapeKey},
        solving::{EquationPlaces, trace_equations},
    },
};

/// The equations of a step, traced: their numbers, and how they are solved.
pub(crate) struct Equations {
    shape: Shape,
    stage: Stage,
    places: EquationPlaces,
    elimination: Elimination,
}

/// The system, γ by its bits, and whether steps are attempts.
type EquationsKey = (Arc<Signature>, u64, bool);

impl Equations {
    /// The cached solver for this γ, built on first use.
    pub(crate) fn of(key: &TapeKey, shape: Shape, gamma: f64) -> Result<Arc<Equations>, Error> {
        static CACHE: LazyLock<Cache<EquationsKey, Equations>> = LazyLock::new(Cache::default);
        let attempts = matches!(key.how, StepKind::Attempts { .. });
        CACHE.find(&(key.signature.clone(), gamma.to_bits(), attempts), || {
            let (traced, places) = trace_equations(&key.signature, &key.how, shape, gamma)?;
            let stage = Stage::cut(&key.signature, &traced);
            let size = stage.size();
            let elimination = Elimination::new(places.rows.clone());
            Ok((Equations { shape, stage, places, elimination }, size))
        })
    }
}

/// Rates with the equations of the method, if it is implicit.
pub fn with_equations(
    rates: Box<dyn Rates>,
    key: &TapeKey,
    spec: &Spec,
    shape: Shape,
    level: Level,
    clock: &Clock,
) -> Result<Box<dyn Rates>, Error> {
    let (StepKind::Method { name, .. } | StepKind::Attempts { name, .. }) = &key.how else { return Ok(rates) };
    let Some(gamma) = method(name)?.program().gamma() else { return Ok(rates) };
    Ok(Box::new(SolvingRates::new(rates, Equations::of(key, shape, gamma)?, spec, level, clock)))
}

/// The elimination of unknowns, one after the other. Rows and columns are counted by the turn of their unknown.
struct Elimination {
    /// The unknowns in the order of their elimination, and of each its turn.
    order: Vec<usize>,
    turns: Vec<usize>,
    steps: Vec<Turn>,
    /// How many exchanges there are.
    exchanges: usize,
}

/// The elimination of one unknown: the effect of its row on later ones.
struct Turn {
    /// The later columns in which its row has a number.
    columns: Vec<Range<usize>>,
    others: Vec<Other>,
}

/// A later row.
struct Other {
    row: usize,
    /// Whether both rows are exchanged in any case, since the unknown's own has no number in its column.
    always: bool,
    /// The columns in which the later row has a number, and those in which it has one from now on; none if it loses no multiple.
    loses: Option<[Vec<Range<usize>>; 2]>,
}

impl Elimination {
    fn new(mut rows: Vec<Columns>) -> Elimination {
        let order = Ordering::new(rows.clone()).order;
        let mut turns = vec![0; order.len()];
        order.iter().enumerate().for_each(|(turn, unknown)| turns[*unknown] = turn);
        let mut left: Vec<usize> = (0..order.len()).collect();
        let mut steps = Vec::with_capacity(order.len());
        let mut exchanges = 0;
        let runs = |columns: &Columns| runs(columns.iter().map(|column| turns[column]).collect());
        for &k in &order {
            left.retain(|i| *i != k);
            let mut exchanged: Vec<(usize, bool)> = Vec::new();
            for &i in &left {
                if !rows[i].has(k) {
                    continue;
                }
                let always = !rows[k].has(k);
                exchanged.push((i, always));
                if always {
                    rows.swap(k, i);
                } else {
                    let mut both = rows[k].clone();
                    both.join(&rows[i]);
                    (rows[k], rows[i]) = (both.clone(), both);
                }
            }
            let mut of_pivot = rows[k].clone();
            of_pivot.remove(k);
            let other = |(i, always): (usize, bool)| {
                let has = rows[i].has(k);
                rows[i].remove(k);
                let loses = has.then(|| {
                    let (known, new): (Columns, Columns) = {
                        let (known, new): (Vec<usize>, Vec<usize>) = of_pivot.iter().partition(|column| rows[i].has(*column));
                        (known.into_iter().collect(), new.into_iter().collect())
                    };
                    rows[i].join(&of_pivot);
                    [runs(&known), runs(&new)]
                });
                Other { row: turns[i], always, loses }
            };
            exchanges += exchanged.len();
            let others = exchanged.into_iter().map(other).collect();
            steps.push(Turn { columns: runs(&of_pivot), others });
        }
        Elimination { order, turns, steps, exchanges }
    }
}

/// Ranges of neighbours among numbers.
fn runs(mut numbers: Vec<usize>) -> Vec<Range<usize>> {
    numbers.sort_unstable();
    let mut runs: Vec<Range<usize>> = Vec::new();
    for number in numbers {
        match runs.last_mut() {
            Some(run) if run.end == number => run.end += 1,
            _ => runs.push(number..number + 1),
        }
    }
    runs
}

/// The numbers of equations, for some members side by side.
struct Matrix {
    lanes: usize,
    unknowns: usize,
    /// The entries, by rows; of each a number for each member.
    entries: Aligned,
    /// The reciprocals of those on the diagonal.
    over: Vec<f64>,
    /// For each exchange whether it was made, and the multiple of the row that the other lost.
    exchanged: Vec<bool>,
    factors: Vec<f64>,
}

impl Matrix {
    fn new(unknowns: usize, lanes: usize, exchanges: usize) -> Matrix {
        Matrix {
            lanes,
            unknowns,
            entries: Aligned::new(unknowns * unknowns * lanes),
            over: vec![0.0; unknowns * lanes],
            exchanged: vec![false; exchanges * lanes],
            factors: vec![0.0; exchanges * lanes],
        }
    }

    /// Takes the entries, by rows of the unknowns.
    fn set(&mut self, elimination: &Elimination, rows: &[Columns], numbers: &[f64]) {
        let (lanes, n) = (self.lanes, self.unknowns);
        self.entries.fill(0.0);
        let places = rows.iter().enumerate().flat_map(|(i, row)| row.iter().map(move |j| (i, j)));
        for ((i, j), entry) in places.zip(numbers.chunks_exact(lanes)) {
            let at = (elimination.turns[i] * n + elimination.turns[j]) * lanes;
            self.entries[at..at + lanes].copy_from_slice(entry);
        }
    }

    fn factor(&mut self, elimination: &Elimination) {
        let (lanes, n) = (self.lanes, self.unknowns);
        let width = n * lanes;
        let mut exchange = 0;
        for (k, turn) in elimination.steps.iter().enumerate() {
            let first = exchange;
            for other in &turn.others {
                let (above, below) = self.entries.split_at_mut(other.row * width);
                let (pivot, row) = (&mut above[k * width..][..width], &mut below[..width]);
                let made = &mut self.exchanged[exchange * lanes..][..lanes];
                for (lane, made) in made.iter_mut().enumerate() {
                    let at = k * lanes + lane;
                    *made = other.always || pivot[at].abs() < row[at].abs();
                }
                if made.contains(&true) {
                    let own = k..k + 1;
                    for columns in std::iter::once(&own).chain(&turn.columns) {
                        let numbers = columns.start * lanes..columns.end * lanes;
                        let pairs = pivot[numbers.clone()].iter_mut().zip(&mut row[numbers]);
                        pairs.enumerate().filter(|(i, _)| made[i % lanes]).for_each(|(_, (a, b))| std::mem::swap(a, b));
                    }
                }
                exchange += 1;
            }
            let over = &mut self.over[k * lanes..][..lanes];
            over.iter_mut().zip(&self.entries[k * width + k * lanes..]).for_each(|(over, entry)| *over = 1.0 / entry);
            for (place, other) in turn.others.iter().enumerate() {
                let Some([known, new]) = &other.loses else { continue };
                let (above, below) = self.entries.split_at_mut(other.row * width);
                let (pivot, row) = (&above[k * width..][..width], &mut below[..width]);
                let factors = &mut self.factors[(first + place) * lanes..][..lanes];
                let own = &row[k * lanes..][..lanes];
                factors.iter_mut().zip(own).zip(over.iter()).for_each(|((factor, entry), over)| *factor = entry * over);
                for columns in known {
                    let numbers = columns.start * lanes..columns.end * lanes;
                    lose(&mut row[numbers.clone()], &pivot[numbers], factors, |entry, term| entry - term);
                }
                for columns in new {
                    let numbers = columns.start * lanes..columns.end * lanes;
                    lose(&mut row[numbers.clone()], &pivot[numbers], factors, |_, term| -term);
                }
            }
        }
    }

    /// The unknowns in place of the right-hand sides, by their turns.
    fn solve(&self, elimination: &Elimination, x: &mut [f64]) {
        let (lanes, width) = (self.lanes, self.unknowns * self.lanes);
        let mut exchange = 0;
        for (k, turn) in elimination.steps.iter().enumerate() {
            let (above, below) = x.split_at_mut((k + 1) * lanes);
            let own = &mut above[k * lanes..];
            let later = |other: &Other| (other.row - k - 1) * lanes;
            for (place, other) in turn.others.iter().enumerate() {
                let made = &self.exchanged[(exchange + place) * lanes..][..lanes];
                let pairs = own.iter_mut().zip(&mut below[later(other)..][..lanes]).zip(made);
                pairs.filter(|(_, made)| **made).for_each(|((a, b), _)| std::mem::swap(a, b));
            }
            for (place, other) in turn.others.iter().enumerate().filter(|(_, other)| other.loses.is_some()) {
                let factors = &self.factors[(exchange + place) * lanes..][..lanes];
                lose(&mut below[later(other)..][..lanes], own, factors, |x, term| x - term);
            }
            exchange += turn.others.len();
        }
        for (k, turn) in elimination.steps.iter().enumerate().rev() {
            let (above, below) = x.split_at_mut((k + 1) * lanes);
            let own = &mut above[k * lanes..];
            for column in turn.columns.iter().rev().flat_map(|columns| columns.clone().rev()) {
                let entries = &self.entries[k * width + column * lanes..][..lanes];
                lose(own, &below[(column - k - 1) * lanes..][..lanes], entries, |x, term| x - term);
            }
            own.iter_mut().zip(&self.over[k * lanes..]).for_each(|(x, over)| *x *= over);
        }
    }
}

/// Takes products of numbers and a factor for each lane from numbers.
fn lose(from: &mut [f64], numbers: &[f64], factors: &[f64], less: impl Fn(f64, f64) -> f64) {
    if let [factor] = factors {
        from.iter_mut().zip(numbers).for_each(|(to, number)| *to = less(*to, factor * number));
        return;
    }
    for (to, numbers) in from.chunks_exact_mut(factors.len()).zip(numbers.chunks_exact(factors.len())) {
        to.iter_mut().zip(numbers).zip(factors).for_each(|((to, number), factor)| *to = less(*to, factor * number));
    }
}

/// Rates of some members, and the solutions of their equations.
pub(crate) struct SolvingRates {
    rates: Box<dyn Rates>,
    equations: Arc<Equations>,
    prepared: PreparedStage,
    /// v, y, the step, and the numbers of the equations.
    state: Aligned,
    matrix: Matrix,
    /// Right-hand sides, then unknowns, by their turns; and the last solution, of v and y.
    unknowns: Vec<f64>,
    solution: Vec<f64>,
    window: Option<Window<f64>>,
}

impl SolvingRates {
    /// Rates with the equations of a step.
    pub(crate) fn new(
        rates: Box<dyn Rates>,
        equations: Arc<Equations>,
        spec: &Spec,
        level: Level,
        clock: &Clock,
    ) -> SolvingRates {
        let lanes = rates.lanes();
        let compiled = equations.stage.compiled_for_lanes(level, lanes);
        compiled.runner.write();
        let prepared = PreparedStage::with(&equations.stage, compiled, spec, clock, f64::INFINITY);
        let numbers = equations.shape.v + equations.shape.y + 1 + equations.places.numbers(equations.shape);
        let unknowns = equations.places.rows.len();
        SolvingRates {
            prepared,
            state: Aligned::new(numbers * lanes),
            matrix: Matrix::new(unknowns, lanes, equations.elimination.exchanges),
            unknowns: vec![0.0; unknowns * lanes],
            solution: vec![0.0; (equations.shape.v + equations.shape.y) * lanes],
            window: None,
            equations,
            rates,
        }
    }

    /// The numbers of the equations: entries of the matrix, by y, by v, by the time.
    fn numbers(&self) -> [&[f64]; 4] {
        let (shape, places, lanes) = (self.equations.shape, &self.equations.places, self.matrix.lanes);
        let entries = places.rows.iter().map(Columns::len).sum::<usize>();
        let (_, numbers) = self.state.split_at((shape.v + shape.y + 1) * lanes);
        let (entries, rest) = numbers.split_at(entries * lanes);
        let (by_y, rest) = rest.split_at(places.by_y.len() * lanes);
        let (by_v, by_time) = rest.split_at(places.by_v.len() * lanes);
        [entries, by_y, by_v, by_time]
    }
}

/// Adds products of entries and numbers to numbers, by the places of both.
fn add(to: &mut [f64], places: &[(usize, usize)], entries: &[f64], numbers: &[f64], lanes: usize) {
    for ((i, j), entries) in places.iter().zip(entries.chunks_exact(lanes)) {
        let pairs = to[i * lanes..][..lanes].iter_mut().zip(&numbers[j * lanes..][..lanes]);
        pairs.zip(entries).for_each(|((to, number), entry)| *to += entry * number);
    }
}

impl Rates for SolvingRates {
    fn inner(&self) -> Option<&dyn Rates> {
        Some(self.rates.as_ref())
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Rates> {
        Some(self.rates.as_mut())
    }

    fn lanes(&self) -> usize {
        self.rates.lanes()
    }

    fn traits(&self) -> RateTraits {
        self.rates.traits()
    }

    fn set_window(&mut self, window: Option<Window<f64>>) {
        self.window = window;
        self.rates.set_window(window);
    }

    fn prepare(&mut self, spec: &Spec, first: usize, count: usize) {
        self.rates.prepare(spec, first, count);
        self.prepared.prepare(&self.equations.stage, spec, first, count);
    }

    fn set_force(&mut self, force: &Force, first: usize, count: usize) {
        self.rates.set_force(force, first, count);
        self.prepared.set_force(&self.equations.stage, force, first, count);
    }

    fn set_stop_flag(&mut self, stop: &Stop) {
        self.rates.set_stop_flag(stop);
    }

    fn dv(&mut self, t: f64, v: &[f64], y: &[f64], out: &mut [f64]) {
        self.rates.dv(t, v, y, out);
    }

    fn both(&mut self, t: f64, v: &[f64], y: &[f64], out: [&mut [f64]; 2]) {
        self.rates.both(t, v, y, out);
    }

    fn derive(&mut self, t: f64, h: f64, v: &[f64], y: &[f64]) {
        let equations = Arc::clone(&self.equations);
        let lanes = self.matrix.lanes;
        let state = v.len() + y.len();
        self.state[..v.len()].copy_from_slice(v);
        self.state[v.len()..state].copy_from_slice(y);
        self.state[state..state + lanes].fill(h);
        let window = self.window.unwrap_or([t, t, 1.0]);
        self.prepared.advance_over(&equations.stage, t, window, &mut self.state);
        let entries = equations.places.rows.iter().map(Columns::len).sum::<usize>();
        let numbers = &self.state[state + lanes..][..entries * lanes];
        self.matrix.set(&equations.elimination, &equations.places.rows, numbers);
        self.matrix.factor(&equations.elimination);
    }

    fn solve(&mut self, [right_v, right_y]: [&[f64]; 2]) {
        let equations = Arc::clone(&self.equations);
        let (lanes, Equations { shape, places, elimination, .. }) = (self.matrix.lanes, &*equations);
        let of_v = shape.v * lanes;
        let (mut solution, mut unknowns) = (std::mem::take(&mut self.solution), std::mem::take(&mut self.unknowns));
        solution[..of_v].copy_from_slice(right_v);
        solution[of_v..].copy_from_slice(right_y);
        let follows = places.rows.len() < shape.v + shape.y;
        if follows {
            let (v, y) = solution.split_at_mut(of_v);
            add(v, &places.by_y, self.numbers()[1], y, lanes);
        }
        for (unknown, x) in elimination.order.iter().zip(unknowns.chunks_exact_mut(lanes)) {
            x.copy_from_slice(&solution[unknown * lanes..][..lanes]);
        }
        self.matrix.solve(elimination, &mut unknowns);
        for (unknown, x) in elimination.order.iter().zip(unknowns.chunks_exact(lanes)) {
            solution[unknown * lanes..][..lanes].copy_from_slice(x);
        }
        if follows {
            let (v, y) = solution.split_at_mut(of_v);
            add(y, &places.by_v, self.numbers()[2], v, lanes);
        }
        (self.solution, self.unknowns) = (solution, unknowns);
    }

    fn solution(&self) -> [&[f64]; 2] {
        self.solution.split_at(self.equations.shape.v * self.matrix.lanes).into()
    }

    fn by_time(&self) -> [&[f64]; 2] {
        self.numbers()[3].split_at(self.equations.shape.v * self.matrix.lanes).into()
    }
}

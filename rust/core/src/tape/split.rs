//! Splits a tape by how often its values change: once for a run, once for a member, once for a step, or for every member at every
//! step.
//!
//! Many values do not change from step to step (Φ = ω₀·h), or not from member to member (the sine of a drive that all
//! share). So the tape is cut into four [`Body`]s, each a list of operations over rows of lanes. Only the
//! last of them is in the hot loop.

use super::{
    Id, Op, Tape,
    fast_hash::{FastHashMap, Places},
    real::Precision,
    reserved::WINDOW_ENDS,
};

/// Operations over lanes: the input of the interpreter and of a kernel writer.
///
/// Leaves are `State`, `Row`, `Uniform`, `PerStep`, `Held` and `Const` only. Every operation comes after its operands, and every
/// operation is needed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Body {
    /// The operations.
    pub ops: Vec<Op>,
    /// The next value of each number of the state. It is `State(s)` itself if s stays as it is; otherwise it is not a leaf, and
    /// not the next value of another number of the state as well (where it would be, there is a `Copy`).
    pub next: Vec<Id>,
    /// How many rows of the member it may read.
    pub rows: usize,
    /// How many numbers it may read that are the same for all.
    pub uniforms: usize,
    /// How many entries a step has in the table of the steps: the bits of a number for `PerStep`, for `Held` the place of a row.
    pub per_step: usize,
    /// The numbers that it computes with.
    pub precision: Precision,
}

impl Body {
    /// Whether a number of the state stays as it is.
    pub(crate) fn keeps(&self, s: usize) -> bool {
        self.ops[self.next[s] as usize] == Op::State(s as u32)
    }

    /// Number of operations that are not leaves.
    pub fn work(&self) -> usize {
        self.ops.iter().filter(|op| !op.is_leaf()).count()
    }

    /// The values of the tape named `roots`, over leaves as `leaf` names them; `None` leaves an operation as it is.
    fn of(tape: &Tape, roots: &[Id], leaf: &mut dyn FnMut(Id) -> Option<Op>) -> Body {
        // From the back: what is a leaf here needs nothing.
        let mut leaves: Vec<Option<Op>> = vec![None; tape.ops().len()];
        let mut needed = vec![false; tape.ops().len()];
        for &root in roots {
            needed[root as usize] = true;
        }
        for id in (0..tape.ops().len()).rev() {
            if !needed[id] {
                continue;
            }
            leaves[id] = leaf(id as Id);
            if leaves[id].is_none() {
                let (operands, n) = tape.ops()[id].operands();
                operands[..n].iter().for_each(|operand| needed[*operand as usize] = true);
            }
        }
        let mut place = vec![0; tape.ops().len()];
        let mut known: FastHashMap<Op, Id> = FastHashMap::default();
        let mut body = Body { precision: tape.precision(), ..Body::default() };
        for id in (0..tape.ops().len()).filter(|id| needed[*id]) {
            let op = leaves[id].unwrap_or_else(|| tape.ops()[id].with(|operand| place[operand as usize]));
            place[id] = *known.entry(op).or_insert_with(|| {
                body.ops.push(op);
                body.ops.len() as Id - 1
            });
        }
        body.next = roots.iter().map(|root| place[*root as usize]).collect();
        body
    }

    /// A body that computes values, all of whose leaves are rows: first `states` of the state, then `parameters` parameters, then
    /// samples; with the table and the time of each sample. In float32 the time and the step come before the state.
    pub(crate) fn of_values(tape: &Tape, values: &[Id], states: u32, parameters: u32) -> (Body, Vec<(u32, Id)>) {
        let (mut samples, is_single) = (Vec::new(), tape.precision() == Precision::Single);
        let mut body = Body::of(tape, values, &mut |id| match tape.op(id) {
            Op::Time if is_single => Some(Op::Row(0)),
            Op::Step if is_single => Some(Op::Row(1)),
            Op::State(i) => Some(Op::Row(if is_single { i + 2 } else { i })),
            Op::Param(i) => Some(Op::Row(states + i)),
            Op::Sample(table, t) => {
                samples.push((table, t));
                Some(Op::Row(states + parameters + samples.len() as u32 - 1))
            }
            _ => None,
        });
        body.copy_what_is_shared();
        body.count_leaves();
        (body, samples)
    }

    /// Numbers the leaves of a kind in the order in which they are read, for sequential access to memory. `list` has their
    /// meaning.
    fn sort_leaves(&mut self, list: &mut Vec<Id>, is: impl Fn(Op) -> bool, leaf: impl Fn(u32) -> Op) {
        let mut order: Vec<Id> = Vec::with_capacity(list.len());
        let mut seen = vec![false; self.ops.len()];
        for op in &self.ops {
            let (operands, n) = op.operands();
            for id in &operands[..n] {
                if is(self.ops[*id as usize]) && !std::mem::replace(&mut seen[*id as usize], true) {
                    order.push(*id);
                }
            }
        }
        // Those that are not read are next values themselves.
        order.extend((0..self.ops.len() as Id).filter(|id| is(self.ops[*id as usize]) && !seen[*id as usize]));
        let old = std::mem::take(list);
        for id in order {
            if let Op::Row(i) | Op::Uniform(i) = self.ops[id as usize] {
                self.ops[id as usize] = leaf(list.len() as u32);
                list.push(old[i as usize]);
            }
        }
    }

    /// Replaces a next value by a copy where it is a leaf or the next value of another number of the state too.
    fn copy_what_is_shared(&mut self) {
        let mut taken = vec![false; self.ops.len()];
        for s in 0..self.next.len() {
            let id = self.next[s];
            if self.ops[id as usize] == Op::State(s as u32) {
                continue;
            }
            if self.ops[id as usize].is_leaf() || taken[id as usize] {
                self.ops.push(Op::Copy(id));
                self.next[s] = self.ops.len() as Id - 1;
            } else {
                taken[id as usize] = true;
            }
        }
    }

    /// Counts what the leaves name.
    fn count_leaves(&mut self) {
        for op in &self.ops {
            let (count, i) = match *op {
                Op::Row(i) => (&mut self.rows, i),
                Op::Uniform(i) => (&mut self.uniforms, i),
                Op::PerStep(i) | Op::Held(i) => (&mut self.per_step, i),
                _ => continue,
            };
            *count = (*count).max(i as usize + 1);
        }
    }

    /// The body of several steps, one after the other, which also returns the states between: after the numbers of the last state
    /// come the velocities before each step, and then the coordinates before each step; `sizes` has the lengths of both. A state
    /// has `state` numbers. If the body of a step has further results, these are the velocities before the step, and the v slot
    /// holds the carry.
    #[must_use]
    pub fn unrolled(&self, steps: usize, state: usize, sizes: [usize; 2]) -> Body {
        let mut unrolled = Body { precision: self.precision, ..Body::default() };
        let mut leaves: FastHashMap<Op, Id> = FastHashMap::default();
        let mut leaf = |unrolled: &mut Body, op: Op| {
            *leaves.entry(op).or_insert_with(|| {
                unrolled.ops.push(op);
                unrolled.ops.len() as Id - 1
            })
        };
        let mut now: Vec<Id> = (0..state as u32).map(|s| leaf(&mut unrolled, Op::State(s))).collect();
        let mut shown = sizes.map(|size| Vec::with_capacity(steps * size));
        let mut place = vec![0; self.ops.len()];
        for step in 0..steps {
            let before = (step * self.per_step) as u32;
            for (id, op) in self.ops.iter().enumerate() {
                let op = match *op {
                    Op::PerStep(i) => Op::PerStep(before + i),
                    Op::Held(i) => Op::Held(before + i),
                    other => other,
                };
                place[id] = match op {
                    Op::State(s) => now[s as usize],
                    Op::Copy(of) => place[of as usize],
                    op if op.is_leaf() => leaf(&mut unrolled, op),
                    op => {
                        unrolled.ops.push(op.with(|operand| place[operand as usize]));
                        unrolled.ops.len() as Id - 1
                    }
                };
            }
            let made: Vec<Id> = self.next.iter().map(|id| place[*id as usize]).collect();
            let (next, velocities) = made.split_at(state);
            shown[0].extend_from_slice(if velocities.is_empty() { &now[..sizes[0]] } else { velocities });
            shown[1].extend_from_slice(&now[sizes[0]..][..sizes[1]]);
            now.copy_from_slice(next);
        }
        unrolled.next = now.into_iter().chain(shown.into_iter().flatten()).collect();
        unrolled.finished()
    }

    /// The operations, on numbers of 64 bits.
    fn widened(mut self) -> Body {
        for op in &mut self.ops {
            if let Op::Const(bits) = *op {
                *op = Op::Const(self.precision.number(bits).to_bits());
            }
        }
        self.precision = Precision::Double;
        self
    }

    fn finished(mut self) -> Body {
        self.copy_what_is_shared();
        self.count_leaves();
        self
    }
}

/// How often a value changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Rank {
    /// It is known beforehand.
    Constant,
    /// Once a run, the same for all members.
    Run,
    /// Once a run, each member has its own.
    Member,
    /// Every step, the same for all members.
    Step,
    /// Every step, each member has its own.
    Lane,
}

/// The meaning of a number that is the same for all members.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum UniformSource {
    /// The step h.
    Step,
    /// A parameter.
    Param(u32),
    /// The time of the first sample of an input.
    Start(u32),
    /// The time between two samples of an input.
    Interval(u32),
    /// The number of the last sample of an input.
    Last(u32),
    /// The place of the first sample of an input among the samples of all.
    First(u32),
    /// How long a row of samples is.
    Lanes,
    /// [`HOLD_SLACK`], which float32 has no number for.
    Slack,
}

/// The meaning of an entry of the table of the steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Entry {
    /// The value itself.
    Value,
    /// The number of a sample; the entry is the sample, which all members have in common.
    Sample(u32),
    /// The number of a sample; the entry is the place of its row.
    Row(u32),
}

/// A tape, cut by how often its values change.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Split {
    /// The meaning of the uniforms of the first three bodies.
    pub sources: Vec<UniformSource>,
    /// Which parameters are the rows of `member`.
    pub params: Vec<u32>,
    /// Its state are the uniforms of `body`; computed once, in one lane.
    pub run: Body,
    /// Its state are the rows of `body`; computed once for each member.
    pub member: Body,
    /// Its state are the first entries of the table of the steps, a lane for each step; row 0 is the time.
    pub step: Body,
    /// Its state are the other entries of a step of float32: the samples that hold, and results from the times of samples. It
    /// computes in float64, for a time divided by an interval takes more digits than float32 has.
    pub clock: Body,
    /// The meaning of the entries.
    pub entries: Vec<Entry>,
    /// The hot loop.
    pub body: Body,
}

/// By this factor the number of intervals since the first sample is taken longer: rounding may put it just before a whole number.
pub const HOLD_SLACK: f64 = 1.0 + 1.0 / (1u64 << 44) as f64;

/// Whether all members share a parameter, or an input, of that number.
type IsShared<'a> = &'a dyn Fn(u32) -> bool;

/// Cuts a tape. `uniform` says which parameters all members share, `common` which inputs.
pub fn split(tape: &Tape, next: &[Id], uniform: IsShared, common: IsShared) -> Split {
    split_with_times(tape, next, uniform, common, &|_| false)
}

/// Cuts a tape. `of_times` says which inputs are the times at which samples begin: these follow from the numbers of the samples.
pub(crate) fn split_with_times(tape: &Tape, next: &[Id], uniform: IsShared, common: IsShared, of_times: IsShared) -> Split {
    let mut tape = tape.clone();
    let next = look_up_samples(&mut tape, next, uniform, of_times);
    let next = hoist_signs(&mut tape, &next, uniform);
    let ranks = ranks(&tape, uniform);
    let rank = |id: Id| ranks[id as usize];
    let mut split = Split::default();

    // The hot loop. Values of a lower rank are its leaves.
    let (mut rows, mut uniforms, mut entries) = (Vec::new(), Vec::new(), Vec::new());
    // Each value is asked for once, the last of the tape first.
    let number = |list: &mut Vec<Id>, id: Id| {
        list.push(id);
        list.len() as u32 - 1
    };
    let mut samples: Vec<(u32, Id)> = Vec::new();
    split.body = Body::of(&tape, &next, &mut |id| match rank(id) {
        Rank::Constant => None,
        Rank::Run => Some(Op::Uniform(number(&mut uniforms, id))),
        Rank::Member => Some(Op::Row(number(&mut rows, id))),
        Rank::Step => Some(Op::PerStep(number(&mut entries, id))),
        Rank::Lane => match tape.op(id) {
            Op::Sample(input, t) => {
                let sample = samples.iter().position(|s| *s == (input, t)).unwrap_or_else(|| {
                    samples.push((input, t));
                    samples.len() - 1
                });
                // Behind all values; they are numbered anew below, when it is known how many there are.
                let place = u32::MAX - sample as u32;
                Some(if common(input) { Op::PerStep(place) } else { Op::Held(place) })
            }
            _ => None,
        },
    });
    // Entries of the clock stand behind the others.
    let single = tape.precision() == Precision::Single;
    let of_clock = if single { made_of_intervals(&tape) } else { Vec::new() };
    let is_of_clock = |id: &Id| single && of_clock[*id as usize];
    let mut order: Vec<usize> = (0..entries.len()).collect();
    order.sort_by_key(|i| is_of_clock(&entries[*i])); // stable
    let mut place = vec![0; entries.len()];
    order.iter().enumerate().for_each(|(new, old)| place[*old] = new as u32);
    let mut entries: Vec<Id> = order.iter().map(|i| entries[*i]).collect();
    let behind = |i: u32| if i > u32::MAX / 2 { entries.len() as u32 + (u32::MAX - i) } else { place[i as usize] };
    for op in &mut split.body.ops {
        *op = match *op {
            Op::PerStep(i) => Op::PerStep(behind(i)),
            Op::Held(i) => Op::Held(behind(i)),
            other => other,
        };
    }
    split.body.sort_leaves(&mut rows, |op| matches!(op, Op::Row(_)), Op::Row);
    split.body.sort_leaves(&mut uniforms, |op| matches!(op, Op::Uniform(_)), Op::Uniform);
    split.body = std::mem::take(&mut split.body).finished();

    // Numbers of samples are found like other values.
    split.entries = vec![Entry::Value; entries.len()];
    let of_step = if single { entries.iter().filter(|id| !is_of_clock(id)).count() } else { usize::MAX };
    for (input, t) in samples {
        split.entries.push(if common(input) { Entry::Sample(input) } else { Entry::Row(input) });
        entries.push(sample_number(&mut tape, input, t));
    }

    let (mut sources, mut params) = (Places::default(), Places::default());
    let mut leaf = |id: Id| match tape.op(id) {
        Op::Step => Some(Op::Uniform(sources.of(UniformSource::Step))),
        Op::Param(i) if WINDOW_ENDS.contains(&i) => Some(Op::Row(WINDOW_ENDS[0] - i + 1)),
        Op::Param(i) if uniform(i) => Some(Op::Uniform(sources.of(UniformSource::Param(i)))),
        Op::Param(i) => Some(Op::Row(params.of(i))),
        Op::Uniform(fact) => Some(Op::Uniform(sources.of(fact_of(fact)))),
        Op::Time => Some(Op::Row(0)),
        _ => None,
    };
    split.run = Body::of(&tape, &uniforms, &mut leaf).finished();
    split.member = Body::of(&tape, &rows, &mut leaf).finished();
    let (of_step, of_clock) = entries.split_at(of_step.min(entries.len()));
    split.step = Body::of(&tape, of_step, &mut leaf).finished();
    split.clock = Body::of(&tape, of_clock, &mut leaf).widened().finished();
    split.sources = sources.list;
    split.params = params.list;
    split
}

/// A property of an input that is known for a run but not when a step is traced, as a leaf of a tape that is being cut.
fn fact(source: UniformSource) -> Op {
    Op::Uniform(match source {
        UniformSource::Start(input) => FACTS * input,
        UniformSource::Interval(input) => FACTS * input + 1,
        UniformSource::Last(input) => FACTS * input + 2,
        UniformSource::First(input) => FACTS * input + 3,
        UniformSource::Slack => 4,
        UniformSource::Lanes | UniformSource::Step | UniformSource::Param(_) => 5,
    })
}

/// How many facts of an input there are; two are the same for all.
const FACTS: u32 = 6;

/// The inverse of `fact`.
fn fact_of(fact: u32) -> UniformSource {
    let input = fact / FACTS;
    [
        UniformSource::Start(input),
        UniformSource::Interval(input),
        UniformSource::Last(input),
        UniformSource::First(input),
        UniformSource::Slack,
        UniformSource::Lanes,
    ][(fact % FACTS) as usize]
}

/// For each value whether it depends on the time between two samples, as their times do.
fn made_of_intervals(tape: &Tape) -> Vec<bool> {
    let mut depends: Vec<bool> = Vec::with_capacity(tape.ops().len());
    for op in tape.ops() {
        let (operands, n) = op.operands();
        let is_interval = matches!(*op, Op::Uniform(fact) if matches!(fact_of(fact), UniformSource::Interval(_)));
        depends.push(is_interval || operands[..n].iter().any(|id| depends[*id as usize]));
    }
    depends
}

/// The number of the sample that holds at a time: the last one not after it, or the first or last one outside; 0 if the time is a
/// NaN.
fn sample_number(tape: &mut Tape, input: u32, t: Id) -> Id {
    let [start, interval, last] =
        [UniformSource::Start(input), UniformSource::Interval(input), UniformSource::Last(input)].map(|g| tape.keep(fact(g)));
    let since = tape.keep(Op::Sub(t, start));
    let intervals = tape.keep(Op::Div(since, interval));
    let slack = match tape.precision() {
        Precision::Double => tape.constant(HOLD_SLACK),
        Precision::Single => tape.keep(fact(UniformSource::Slack)),
    };
    let late = tape.keep(Op::Mul(intervals, slack));
    let at = tape.keep(Op::Floor(late));
    let zero = tape.keep(Op::Const(0));
    let above = tape.keep(Op::Less(zero, at));
    let at = tape.keep(Op::Select(above, at, zero));
    let below = tape.keep(Op::Less(at, last));
    tape.keep(Op::Select(below, at, last))
}

/// Looks up samples for each member by itself, where members have times of their own, and computes when samples begin.
fn look_up_samples(tape: &mut Tape, next: &[Id], uniform: IsShared, of_times: IsShared) -> Vec<Id> {
    let ranks = ranks(tape, uniform);
    let old = std::mem::replace(tape, Tape::new(tape.precision()));
    let mut place: Vec<Id> = Vec::with_capacity(old.ops().len());
    for op in old.ops() {
        let moved = op.with(|operand| place[operand as usize]);
        place.push(match (*op, moved) {
            (_, Op::Sample(input, now)) if of_times(input) => {
                let samples = input - 1; // the table before it, which has the same grid
                let number = sample_number(tape, samples, now);
                let [start, interval] =
                    [UniformSource::Start(samples), UniformSource::Interval(samples)].map(|g| tape.keep(fact(g)));
                let since = tape.keep(Op::Mul(interval, number));
                tape.keep(Op::Add(start, since))
            }
            (Op::Sample(_, t), Op::Sample(input, now)) if matches!(ranks[t as usize], Rank::Member | Rank::Lane) => {
                let number = sample_number(tape, input, now);
                let (lanes, first) = (tape.keep(fact(UniformSource::Lanes)), tape.keep(fact(UniformSource::First(input))));
                let row = tape.keep(Op::Mul(number, lanes));
                let at = tape.keep(Op::Add(row, first));
                tape.keep(Op::Gather(at))
            }
            _ => tape.keep(moved),
        });
    }
    next.iter().map(|id| place[*id as usize]).collect()
}

fn ranks(tape: &Tape, uniform: IsShared) -> Vec<Rank> {
    let mut ranks: Vec<Rank> = Vec::with_capacity(tape.ops().len());
    for op in tape.ops() {
        let rank = match *op {
            Op::Const(_) => Rank::Constant,
            Op::Step | Op::Uniform(_) => Rank::Run,
            Op::Param(i) if WINDOW_ENDS.contains(&i) => Rank::Step,
            Op::Param(i) if uniform(i) => Rank::Run,
            Op::Param(_) => Rank::Member,
            Op::Time => Rank::Step,
            Op::State(_) | Op::Sample(..) | Op::Gather(_) => Rank::Lane,
            _ => {
                let (operands, n) = op.operands();
                let of = operands[..n].iter().map(|id| ranks[*id as usize]);
                let most = of.clone().max().unwrap_or(Rank::Constant);
                if most == Rank::Step && of.clone().any(|rank| rank == Rank::Member) { Rank::Lane } else { most }
            }
        };
        ranks.push(rank);
    }
    ranks
}

/// Moves a change of sign from a product that is computed in every step to its factor that is computed once.
fn hoist_signs(tape: &mut Tape, next: &[Id], uniform: IsShared) -> Vec<Id> {
    let ranks = ranks(tape, uniform);
    let needed = tape.needed(next.iter().copied());
    let mut uses = vec![0u32; tape.ops().len()];
    for (op, _) in tape.ops().iter().zip(&needed).filter(|(_, needed)| **needed) {
        let (operands, n) = op.operands();
        operands[..n].iter().for_each(|id| uses[*id as usize] += 1);
    }
    next.iter().for_each(|id| uses[*id as usize] += 1);
    let old = std::mem::replace(tape, Tape::new(tape.precision()));
    let mut place: Vec<Id> = Vec::with_capacity(old.ops().len());
    for (id, op) in old.ops().iter().enumerate() {
        let moved = match *op {
            Op::Neg(product) if needed[id] && uses[product as usize] == 1 => match old.op(product) {
                Op::Mul(a, b) if ranks[a as usize] != ranks[b as usize] => {
                    let (once, often) = if ranks[a as usize] < ranks[b as usize] { (a, b) } else { (b, a) };
                    let sign = tape.keep_or_fold(Op::Neg(place[once as usize]));
                    Some(tape.keep(Op::Mul(sign.min(place[often as usize]), sign.max(place[often as usize]))))
                }
                _ => None,
            },
            _ => None,
        };
        place.push(moved.unwrap_or_else(|| tape.keep(op.with(|operand| place[operand as usize]))));
    }
    next.iter().map(|id| place[*id as usize]).collect()
}

impl Tape {
    /// Adds the operations of another tape of the same precision, and returns the place of each of its values. Decisions that
    /// were made there, such as which products are fused, remain.
    pub(crate) fn take_over(&mut self, other: &Tape) -> Vec<Id> {
        let mut place: Vec<Id> = Vec::with_capacity(other.ops().len());
        for op in other.ops() {
            place.push(self.keep(op.with(|operand| place[operand as usize])));
        }
        place
    }

    /// As `push`, but it does not count as written.
    fn keep_or_fold(&mut self, op: Op) -> Id {
        match self.fold(op) {
            Some(bits) => self.keep(Op::Const(bits)),
            None => self.keep(op),
        }
    }
}

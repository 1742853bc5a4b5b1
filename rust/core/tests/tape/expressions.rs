//! Random expressions: their tape has the bits of what was asked for, and so has the tape that is cut by how often values change.

use stepwell_core::{
    isa::Level,
    model::spec::{Row, Spec, Table},
    stage::{Clock, PreparedStage, Stage},
    tape::{
        Id, Op, Tape, eval,
        fuse::fuse,
        split::{HOLD_SLACK, split},
    },
};

use crate::random::Random;

/// The numbers that expressions are of: those of one member at one step.
#[derive(Clone, Copy, Default)]
pub(crate) struct Given<'a> {
    pub state: &'a [f64],
    pub params: &'a [f64],
    pub h: f64,
    pub t: f64,
    /// The samples of each input, from time [`START`] on, [`INTERVAL`] apart.
    pub samples: &'a [&'a [f64]],
}

const START: f64 = 0.5;
const INTERVAL: f64 = 0.75;

/// The sample that holds at a time; that of a NaN is the first.
fn sample(samples: &[f64], t: f64) -> f64 {
    let at = ((t - START) / INTERVAL * HOLD_SLACK).floor();
    samples[if at > 0.0 { (at as usize).min(samples.len() - 1) } else { 0 }]
}

/// Operation after operation.
pub(crate) fn evaluate(ops: &[Op], given: &Given) -> Vec<u64> {
    let mut values: Vec<u64> = Vec::with_capacity(ops.len());
    for op in ops {
        let ([a, b, c], n) = op.operands();
        let of = |id: Id, is: bool| if is { values[id as usize] } else { 0 };
        let (a, b, c) = (of(a, n > 0), of(b, n > 1), of(c, n > 2));
        values.push(match *op {
            Op::State(i) => given.state[i as usize].to_bits(),
            Op::Param(i) => given.params[i as usize].to_bits(),
            Op::Step => given.h.to_bits(),
            Op::Time => given.t.to_bits(),
            Op::Sample(input, _) => sample(given.samples[input as usize], f64::from_bits(a)).to_bits(),
            op => eval::apply(op, a, b, c),
        });
    }
    values
}

/// Whether two numbers have the same bits, or both are NaN: its sign and payload are not promised.
pub(crate) fn same(a: u64, b: u64) -> bool {
    a == b || (f64::from_bits(a).is_nan() && f64::from_bits(b).is_nan())
}

const STATES: u32 = 3;
const PARAMS: u32 = 4;
/// Parameters that all members have in common come first.
const COMMON: u32 = 2;
/// Inputs: the first is common to all members, the second is not.
const INPUTS: u32 = 2;

/// Numbers that rules ask for, and all that is rare.
const SPECIAL: [f64; 16] =
    [0.0, 0.0, -0.0, -0.0, 1.0, 1.0, -1.0, -1.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 5e-324, -5e-324, f64::MAX, 0.5, 2.0];

fn number(random: &mut Random) -> f64 {
    if random.once_in(3) { random.one_of(&SPECIAL) } else { random.number() }
}

/// An expression as it is asked for: nothing is shortened.
struct Asked {
    ops: Vec<Op>,
    /// For each value whether its bits are promised, because it cannot be a NaN that arithmetic made.
    sure: Vec<bool>,
}

impl Asked {
    fn push(&mut self, op: Op, sure: bool) -> Id {
        self.ops.push(op);
        self.sure.push(sure);
        self.ops.len() as Id - 1
    }

    fn any(&self, random: &mut Random) -> Id {
        let n = self.ops.len();
        let back = if random.once_in(2) { n } else { n.min(5) };
        (n - 1 - random.below(back)) as Id
    }

    fn sure(&self, random: &mut Random) -> Id {
        (0..20).map(|_| self.any(random)).find(|id| self.sure[*id as usize]).unwrap_or(0)
    }

    fn leaf(&mut self, random: &mut Random) {
        match random.below(10) {
            0..3 => self.push(Op::State(random.below(STATES as usize) as u32), false),
            3..5 => self.push(Op::Param(random.below(PARAMS as usize) as u32), true),
            5 => self.push(Op::Step, true),
            6 => self.push(Op::Time, true),
            _ => self.push(Op::Const(number(random).to_bits()), true),
        };
    }

    fn operation(&mut self, random: &mut Random) {
        let (a, b) = (self.any(random), self.any(random));
        let (one, two, places) = (self.sure(random), self.sure(random), random.below(3) as u32 * 31);
        match random.below(26) {
            0..5 => self.push(Op::Add(a, b), false),
            5..8 => self.push(Op::Sub(a, b), false),
            8..12 => self.push(Op::Mul(a, b), false),
            12 => self.push(Op::Div(a, b), false),
            13 => self.push(Op::Sqrt(a), false),
            14..17 => self.push(Op::Neg(a), self.sure[a as usize]),
            17 => self.push(Op::Floor(a), false),
            18 => self.push(random.one_of(&[Op::Less(a, b), Op::LessEqual(a, b), Op::Equal(a, b)]), true),
            19..21 => {
                let mask = self.push(random.one_of(&[Op::Less(one, b), Op::LessEqual(a, two), Op::Equal(a, b)]), true);
                self.push(Op::Select(mask, a, b), self.sure[a as usize] && self.sure[b as usize])
            }
            21 => self.push(random.one_of(&[Op::And(one, two), Op::Or(one, two), Op::Xor(one, two)]), true),
            22 => self.push(Op::AddBits(one, two), true),
            23 => self.push(random.one_of(&[Op::ShiftUp(one, places), Op::ShiftDown(one, places)]), true),
            24 => self.push(Op::Copy(a), self.sure[a as usize]),
            _ => self.push(Op::Sample(random.below(INPUTS as usize) as u32, a), true),
        };
    }

    fn random(random: &mut Random) -> Asked {
        let mut asked = Asked { ops: Vec::new(), sure: Vec::new() };
        asked.push(Op::Const(0), true); // the one that is surely sure
        asked.leaf(random);
        for _ in 0..4 + random.below(24) {
            if random.once_in(3) { asked.leaf(random) } else { asked.operation(random) }
        }
        asked
    }

    /// Pushes it to a tape: the value of each operation.
    fn pushed(&self, tape: &mut Tape) -> Vec<Id> {
        let mut place: Vec<Id> = Vec::with_capacity(self.ops.len());
        for op in &self.ops {
            place.push(tape.push(op.with(|id| place[id as usize])));
        }
        place
    }
}

fn numbers(random: &mut Random, count: u32) -> Vec<f64> {
    (0..count).map(|_| number(random)).collect()
}

#[test]
fn a_tape_has_the_bits_of_what_was_asked_for() {
    let (mut asked_for, mut kept) = (0, 0);
    for seed in 0..40_000 {
        let random = &mut Random(seed);
        let asked = Asked::random(random);
        let mut tape = Tape::default();
        let place = asked.pushed(&mut tape);
        (asked_for, kept) = (asked_for + asked.ops.len(), kept + tape.ops().len());
        for _ in 0..3 {
            let (state, params, samples) = (numbers(random, STATES), numbers(random, PARAMS), numbers(random, 5));
            let (h, t) = (number(random), number(random));
            let given = Given { state: &state, params: &params, h, t, samples: &[&samples, &samples[1..]] };
            let (want, got) = (evaluate(&asked.ops, &given), evaluate(tape.ops(), &given));
            for (id, op) in asked.ops.iter().enumerate() {
                let (want, got) = (want[id], got[place[id] as usize]);
                assert!(same(want, got), "seed {seed}: value {id}, {op:?}, is {got:#x}, not {want:#x}");
            }
        }
    }
    println!("{asked_for} operations became {kept}");
    assert!(kept < asked_for * 9 / 10);
}

/// Fewer than a tile has lanes.
const MEMBERS: usize = 3;

/// The state of each member after some steps of a tape that was cut.
fn stepped(stage: &Stage, spec: &Spec, clock: &Clock, first: i64, steps: usize, state: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut prepared = PreparedStage::new(stage, spec, Level::Baseline, 8, clock, f64::INFINITY);
    prepared.prepare(stage, spec, 0, MEMBERS);
    let lanes = prepared.lanes();
    let mut rows = vec![0.0; STATES as usize * lanes];
    for (member, state) in state.iter().enumerate() {
        state.iter().enumerate().for_each(|(s, number)| rows[s * lanes + member] = *number);
    }
    prepared.advance(stage, clock, first, steps, &mut rows);
    (0..MEMBERS).map(|member| rows.iter().skip(member).step_by(lanes).copied().collect()).collect()
}

#[test]
fn a_tape_that_was_cut_has_them_as_well() {
    let (mut ranks, mut fused) = ([0usize; 6], 0usize);
    for seed in 0..30_000 {
        let random = &mut Random(seed ^ 0x5EED_0000);
        let asked = Asked::random(random);
        let mut tape = Tape::default();
        let place = asked.pushed(&mut tape);
        let roots: Vec<Id> = (0..STATES).map(|_| asked.any(random)).collect();
        let next: Vec<Id> = roots.iter().map(|root| place[*root as usize]).collect();
        // As it was asked for, or with fused multiply-adds, which are what the tape says.
        let (tape, asked, roots, next) = if seed % 2 == 0 {
            (tape, asked.ops, roots, next)
        } else {
            let (tape, next) = fuse(&tape, &next);
            fused += tape.ops().iter().filter(|op| matches!(op, Op::MulAdd(..) | Op::MulSub(..) | Op::SubMul(..))).count();
            let ops = tape.ops().to_vec();
            (tape, ops, next.clone(), next)
        };
        let stage = Stage::new(split(&tape, &next, &|i| i < COMMON, &|input| input == 0));
        let bodies = [&stage.split.run, &stage.split.member, &stage.split.step, &stage.split.body];
        ranks.iter_mut().zip(bodies).for_each(|(count, body)| *count += body.work());
        ranks[4] += stage.split.body.per_step;
        ranks[5] += stage.split.body.ops.iter().filter(|op| matches!(op, Op::Gather(_))).count();

        let clock = Clock { t0: number(random), h: number(random) };
        let params: Vec<Vec<f64>> = (0..PARAMS).map(|i| numbers(random, if i < COMMON { 1 } else { MEMBERS as u32 })).collect();
        let samples: Vec<Vec<Vec<f64>>> =
            [1, MEMBERS].map(|width| (0..4).map(|_| numbers(random, width as u32)).collect()).to_vec();
        let tables = samples
            .iter()
            .map(|rows| Table { samples: rows.iter().map(|row| Row(row)).collect(), start: START, interval: INTERVAL })
            .collect();
        let spec = Spec { rows: params.iter().map(|row| Row(row)).collect(), tables, ..Spec::default() };
        let state: Vec<Vec<f64>> = (0..MEMBERS).map(|_| numbers(random, STATES)).collect();
        // Both sides of the end of a table of steps.
        let first = random.one_of(&[0, 5, 254, 255, -1]);
        let got = stepped(&stage, &spec, &clock, first, 3, &state);
        for (member, (got, state)) in got.iter().zip(state).enumerate() {
            let params: Vec<f64> = spec.rows.iter().map(|row| row.at(member)).collect();
            let samples: Vec<Vec<f64>> =
                spec.tables.iter().map(|table| table.samples.iter().map(|row| row.at(member)).collect()).collect();
            let samples: Vec<&[f64]> = samples.iter().map(Vec::as_slice).collect();
            let mut state = state;
            for k in first..first + 3 {
                let given = Given { state: &state, params: &params, h: clock.h, t: clock.at(k), samples: &samples };
                let values = evaluate(&asked, &given);
                state = roots.iter().map(|root| f64::from_bits(values[*root as usize])).collect();
            }
            let equal = state.iter().zip(got).all(|(want, got)| same(want.to_bits(), got.to_bits()));
            assert!(equal, "seed {seed}, member {member}: {got:?}, not {state:?}, of {asked:?} and {roots:?}");
        }
    }
    println!(
        "operations once a run, a member, a step, a lane; entries of tables of steps; samples looked up by lanes: {ranks:?}"
    );
    assert!(ranks.iter().all(|count| *count > 1000) && fused > 300, "{ranks:?}, {fused} fused");
}

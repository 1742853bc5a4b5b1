//! Random systems through the whole core: own rates made of random operations, stepped by every method, in every way that
//! promises the same bits. `STEPWELL_FUZZ` says how many runs are compared.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that fails may panic")]

use std::sync::Arc;

use stepwell_core::{
    error::Error,
    isa::Level,
    model::{
        method::{Needs, Record},
        spec::{Row, Signature, Spec},
        steppers::RECORDS,
    },
    run::{
        Model,
        fixed::{Arrays, FixedRun, kept, run, save},
        world::World,
    },
    stage::{Clock, Machine},
    step::key::{StepKind, TapeKey},
    tape::{Id, Op, equations::Equations, real::Precision},
};

/// SplitMix64.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ x >> 31
    }

    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// Between −2 and 2.
    fn number(&mut self) -> f64 {
        4.0 * (self.bits() >> 11) as f64 / (1u64 << 53) as f64 - 2.0
    }

    fn numbers(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.number()).collect()
    }
}

/// Random rates, with what they are run with.
struct Case {
    equations: Arc<Equations>,
    watched: Option<Arc<Equations>>,
    /// For each parameter one number, or one for each member.
    parameters: Vec<Vec<f64>>,
    v: Vec<f64>,
    y: Vec<f64>,
    sizes: [usize; 2],
    is_second_order: bool,
    members: usize,
    steps: i64,
    dt: f64,
    fused: bool,
}

/// Operations over these leaves; about one in eight of them takes the time.
fn operations(random: &mut Random, ops: &mut Vec<Op>, leaves: usize, count: usize) {
    for _ in 0..count {
        let n = ops.len();
        let any = |random: &mut Random| if random.below(3) == 0 { random.below(leaves) } else { random.below(n) } as Id;
        let (a, b) = (any(random), any(random));
        let made = match random.below(11) {
            0..3 => Op::Add(a, b),
            3..5 => Op::Sub(a, b),
            5..8 => Op::Mul(a, b),
            8 => Op::Div(a, b),
            9 => Op::Sqrt(a),
            _ => {
                // The larger of two, or the smaller one.
                ops.push(Op::Less(a, b));
                let (c, d) = (any(random), any(random));
                Op::Select(n as Id, c, d)
            }
        };
        ops.push(made);
    }
}

/// x/(1 + x²): at most a half, so that most runs stay finite.
fn tamed(ops: &mut Vec<Op>, x: Id) -> Id {
    let one = ops.len() as Id;
    ops.extend([Op::Const(1.0_f64.to_bits()), Op::Mul(x, x), Op::Add(one, one + 1), Op::Div(x, one + 2)]);
    one + 3
}

fn case(seed: u64) -> Case {
    let random = &mut Random(seed.wrapping_mul(0xD134_2543_DE82_EF95) ^ 0x5EED);
    let v = 1 + random.below(4);
    let is_second_order = random.below(2) == 0;
    let y = if is_second_order { v } else { 1 + random.below(4) };
    let parameters = random.below(4);
    // Methods that need an acceleration work with rates that do not read v.
    let reads_v = random.below(2) == 0;
    let mut ops: Vec<Op> = (0..parameters).map(|i| Op::Param(i as u32)).collect();
    ops.extend((if reads_v { 0 } else { v }..v + y).map(|i| Op::State(i as u32)));
    if random.below(3) == 0 {
        ops.push(Op::Time);
    }
    let leaves = ops.len();
    let count = 2 + random.below(30);
    operations(random, &mut ops, leaves, count);
    let is_tame = random.below(4) > 0;
    let rates = |random: &mut Random, n: usize, ops: &mut Vec<Op>| -> Vec<Id> {
        let made: Vec<Id> = (0..n).map(|_| (ops.len() - 1 - random.below(ops.len().min(12))) as Id).collect();
        made.into_iter().map(|x| if is_tame { tamed(ops, x) } else { x }).collect()
    };
    let dv = rates(random, v, &mut ops);
    let dy = (!is_second_order).then(|| rates(random, y, &mut ops));
    // A quantity of the state alone, for it has no time.
    let mut of_state: Vec<Op> = (0..v + y).map(|i| Op::State(i as u32)).collect();
    operations(random, &mut of_state, v + y, 6);
    let last = of_state.len() as Id - 1;
    let watched = (random.below(2) == 0)
        .then(|| Arc::new(Equations::new(of_state.clone(), Vec::new(), None, vec![("watched".to_owned(), last)], None)));
    // The same quantity, to be recorded.
    let shift = ops.len() as Id;
    ops.extend(of_state.iter().map(|op| op.with(|id| id + shift)));
    let equations = Arc::new(Equations::new(ops, dv, dy, vec![("quantity".to_owned(), last + shift)], None));
    let members = [1, 1, 2, 3, 8, 9, 33, 130][random.below(8)];
    let widths: Vec<usize> = (0..parameters).map(|_| if random.below(2) == 0 { 1 } else { members }).collect();
    Case {
        equations,
        watched,
        parameters: widths.into_iter().map(|width| random.numbers(width)).collect(),
        v: random.numbers(v * members),
        y: random.numbers(y * members),
        sizes: [v, y],
        is_second_order,
        members,
        steps: [1, 5, 64, 70, 150, 700][random.below(6)],
        dt: [0.01, 0.1, 0.5][random.below(3)],
        fused: random.below(3) == 0,
    }
}

/// Everything that a run fills, as bits: NaN are all alike.
#[derive(Clone, Debug, Default, PartialEq)]
struct Filled {
    v: Vec<u64>,
    y: Vec<u64>,
    recorded: Vec<u64>,
    tally: Vec<u64>,
    carry: Vec<u64>,
    first_bad: Vec<i64>,
}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|x| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() }).collect()
}

/// How a run is made.
#[derive(Clone, Debug)]
struct StepStrategy {
    level: Level,
    threads: usize,
    every: Option<i64>,
    first: i64,
    steps: i64,
}

impl Case {
    /// The model of the members in a range.
    fn model(&self, method: &str, of: &std::ops::Range<usize>) -> Model<'_> {
        let rows = self.parameters.iter().map(|row| if row.len() == 1 { Row(&row[..]) } else { Row(&row[of.clone()]) });
        let rows: Vec<Row> = rows.collect();
        let signature = Signature {
            system: "equations".to_owned(),
            rows: vec![("p".to_owned(), rows.iter().map(Row::is_common).collect())],
            equations: Some(Arc::clone(&self.equations)),
            watched: self.watched.clone(),
            ..Signature::default()
        };
        let how = StepKind::Method { name: method.to_owned(), choice: 0 };
        let key = TapeKey {
            signature: signature.clone().into(),
            how,
            record: vec!["quantity".to_owned()],
            fused: self.fused,
            precision: Precision::Double,
        };
        Model { key, spec: Spec { signature: signature.into(), rows, tables: Vec::new() } }
    }

    /// Rows of the members of a range.
    fn part<'a>(&self, array: &'a [f64], of: &std::ops::Range<usize>) -> Vec<Row<'a>> {
        array.chunks_exact(self.members).map(|row| Row(&row[of.clone()])).collect()
    }

    /// A run of the members of a range, from the state at the start or from a carry.
    fn run(
        &self,
        method: &Record,
        of: std::ops::Range<usize>,
        way: &StepStrategy,
        from: Option<(&[f64], &[f64], &[i64])>,
    ) -> Result<(Filled, Vec<f64>, Vec<f64>), Error> {
        let model = self.model(method.name, &of);
        let traced = model.traced()?;
        let (b, saved, [p, q]) = (of.len(), kept(way.steps, way.every), self.sizes);
        let (mut v, mut y) = (vec![0.0; saved * p * b], vec![0.0; saved * q * b]);
        let (mut recorded, mut tally) = (vec![0.0; saved * traced.recorded * b], vec![0.0; traced.tally * b]);
        let mut carry = vec![0.0; p * b];
        let mut first_bad = from.map_or(vec![-1; b], |(_, _, bad)| bad.to_vec());
        let plan = FixedRun {
            model,
            clock: Clock { t0: 0.25, h: self.dt },
            machine: Machine { level: way.level, threads: way.threads },
            first: way.first,
            steps: way.steps,
            every: way.every,
            v: from.map_or_else(|| self.part(&self.v, &of), |(carry, _, _)| self.part(carry, &of)),
            y: from.map_or_else(|| self.part(&self.y, &of), |(_, y, _)| self.part(y, &of)),
            members: b,
            own: b,
            events: None,
            carried: from.is_some(),
        };
        let arrays = Arrays {
            saved_v: &mut v,
            saved_y: &mut y,
            recorded: &mut recorded,
            tally: &mut tally,
            carry: &mut carry,
            first_bad: &mut first_bad,
        };
        run(&plan, arrays, &mut |_| true)?;
        let filled =
            Filled { v: bits(&v), y: bits(&y), recorded: bits(&recorded), tally: bits(&tally), carry: bits(&carry), first_bad };
        let last = y[(saved - 1) * q * b..].to_vec();
        Ok((filled, carry, last))
    }
}

/// Of the numbers of all saved states those that a run with `every` saves.
fn thinned(all: &[u64], width: usize, steps: i64, every: Option<i64>) -> Vec<u64> {
    let kept = kept(steps, every);
    (0..kept).flat_map(|i| all[save(steps, every, i) as usize * width..][..width].to_vec()).collect()
}

/// Whether the quantity may have changed its sign, as the states that were kept say; before the first it is 0.
fn may_change(recorded: &[f64], members: usize, member: usize) -> f64 {
    let values = recorded.chunks_exact(members).map(|row| row[member]).skip(1);
    let values: Vec<f64> = [0.0, 0.0].into_iter().chain(values).collect();
    let may = values.windows(3).any(|of| {
        let change = of[2] - of[1];
        let bend = 4.0 * (change - (of[1] - of[0]));
        let far = bend * bend + change * change;
        !(far < of[2] * of[2] && far < of[1] * of[1])
    });
    f64::from(u8::from(may))
}

/// Compares all ways of making a run of a random system with the interpreter, one member after the other, that keeps every state;
/// returns how many were compared, or what refuses the system.
fn one_case(seed: u64, method: &Record) -> Result<usize, Error> {
    let case = case(seed);
    if method.needs == Needs::Acceleration && !case.is_second_order {
        return Ok(0); // Python refuses it: the core is asked for what it can
    }
    let about = || format!("seed {seed}, {}, {} members, {} steps, fused: {}", method.name, case.members, case.steps, case.fused);
    let [p, q] = case.sizes;
    let (b, steps) = (case.members, case.steps);
    let slow = StepStrategy { level: Level::Baseline, threads: 1, every: Some(1), first: 3, steps };
    // The members one by one, put together.
    let alone: Vec<Filled> = (0..b).map(|i| Ok(case.run(method, i..i + 1, &slow, None)?.0)).collect::<Result<_, Error>>()?;
    let together = |part: fn(&Filled) -> &Vec<u64>| -> Vec<u64> {
        let rows = part(&alone[0]).len();
        (0..rows).flat_map(|row| alone.iter().map(move |each| part(each)[row])).collect()
    };
    let want = Filled {
        v: together(|each| &each.v),
        y: together(|each| &each.y),
        recorded: together(|each| &each.recorded),
        tally: together(|each| &each.tally),
        carry: together(|each| &each.carry),
        first_bad: alone.iter().map(|each| each.first_bad[0]).collect(),
    };
    if case.watched.is_some() && method.carry.is_none() {
        let recorded: Vec<f64> = want.recorded.iter().map(|bits| f64::from_bits(*bits)).collect();
        for member in (0..b).filter(|i| want.first_bad[*i] < 0) {
            let told = f64::from_bits(want.tally[want.tally.len() - b + member]);
            assert_eq!(told, may_change(&recorded, b, member), "{}: member {member}", about());
        }
    }
    let mut seen = 0;
    let level = *Level::available().last().expect("a level");
    for (every, threads) in [(None, 1), (Some(1), 1), (Some(1), 3), (Some(7), 2), (Some(64), 1)] {
        let way = StepStrategy { level, threads, every, ..slow.clone() };
        let (got, ..) = case.run(method, 0..b, &way, None)?;
        let expected = Filled {
            v: thinned(&want.v, p * b, steps, every),
            y: thinned(&want.y, q * b, steps, every),
            recorded: thinned(&want.recorded, b, steps, every),
            ..want.clone()
        };
        // What a member adds up after it diverged is no promise.
        assert_eq!(got.first_bad, expected.first_bad, "{}: {way:?}", about());
        assert!(got.v == expected.v && got.y == expected.y, "{}: {way:?}: other states", about());
        if want.first_bad.iter().all(|bad| *bad < 0) {
            assert!(got == expected, "{}: {way:?}: another carry, tally or quantity", about());
        }
        seen += b;
    }
    // In two pieces, the second from the carry of the first.
    if steps > 1 {
        let half = StepStrategy { level, threads: 1, every: None, first: 3, steps: steps / 2 };
        let (first, carry, y) = case.run(method, 0..b, &half, None)?;
        let rest = StepStrategy { first: 3 + steps / 2, steps: steps - steps / 2, ..half };
        let (got, ..) = case.run(method, 0..b, &rest, Some((&carry, &y, &first.first_bad)))?;
        let expected = thinned(&want.y, q * b, steps, None);
        assert_eq!(got.first_bad, want.first_bad, "{}: in pieces", about());
        assert!(got.y == expected, "{}: in pieces: other states", about());
        seen += b;
    }
    // And by a world, whose single member has packed code from the start.
    if want.first_bad.iter().all(|bad| *bad < 0) {
        let model = case.model(method.name, &(0..b));
        let clock = Clock { t0: 0.25, h: case.dt };
        let (mut v, mut y) = (case.v.clone(), case.y.clone());
        let mut world = World::new(&model, clock, Machine { level, threads: 1 }, b, 3)?;
        world.step(steps / 3, &mut v, &mut y);
        world.step(steps - steps / 3, &mut v, &mut y);
        let expected = [thinned(&want.v, p * b, steps, None), thinned(&want.y, q * b, steps, None)];
        assert!([bits(&v), bits(&y)] == expected, "{}: a world: other states", about());
        seen += b;
    }
    Ok(seen)
}

#[test]
fn random_systems_have_the_same_bits_in_every_way() {
    let wanted = std::env::var("STEPWELL_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000);
    let (mut seen, mut cases, mut refused, mut seed) = (0, 0, 0, 0);
    while seen < wanted {
        for record in RECORDS {
            match one_case(seed, record) {
                Ok(compared) => {
                    seen += compared;
                    cases += 1;
                }
                // Verlet and its like need forces that do not depend on v; a series has no derivative of some operations.
                Err(Error::VelocityDependent { .. } | Error::TooLongForSeries { .. } | Error::TooLongToSolve { .. }) => {
                    refused += 1
                }
                Err(error) => panic!("seed {seed}, {}: {error}", record.name),
            }
        }
        seed += 1;
    }
    println!("{seed} systems, {cases} with a method, {refused} refused, {seen} runs of a member compared");
    assert!(cases > 2 * refused, "{cases} and {refused}");
}

/// The comparison is not blind: a single bit of one number that is wrong is noticed.
#[test]
fn another_number_is_noticed() {
    let mut case = case(1);
    let rk4 = RECORDS.iter().find(|record| record.name == "rk4").expect("a method");
    let way = StepStrategy { level: Level::Baseline, threads: 1, every: Some(1), first: 3, steps: case.steps };
    let (want, ..) = case.run(rk4, 0..case.members, &way, None).expect("a run");
    case.y[0] = f64::from_bits(case.y[0].to_bits() + 1);
    let (got, ..) = case.run(rk4, 0..case.members, &way, None).expect("a run");
    assert_ne!(want, got);
}

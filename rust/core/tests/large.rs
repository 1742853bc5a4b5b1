//! Large systems: a method's program over long rows makes the bits that its tape makes, with rates of both kinds.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use stepwell_core::{
    error::Error,
    group::{AdaptiveBatch, Group, adaptive_lanes::AdaptiveLanes, lanes::Lanes},
    isa::Level,
    large::{
        adaptive::LargeAdaptive,
        blocks::Schedules,
        group::LargeGroup,
        hand_written::{kernel_of, single},
        matrix::Matrix,
        rates::{RateTraits, Rates, RatesRequest},
        schedule::{Action, BlockSchedule, Goal},
        solving::with_equations,
        tapes::{RateTapes, TapeRates},
    },
    model::{
        around::controls,
        spec::{Row, Signature, Spec, Table},
        system::Shape,
        systems::kind,
        {methods::method, steppers::RECORDS},
    },
    stage::{Clock, Machine},
    step::{
        key::{StepKind, TapeKey},
        pace::{Acceptance, Pace},
    },
    tape::real::Precision,
};

/// The most numbers of a state whose implicit steps are compared with tapes.
const MOST_UNKNOWNS: usize = 40;

const CLOCK: Clock = Clock { t0: 0.3, h: 0.0123 };

fn signature(
    system: &str,
    words: &[(&str, &str)],
    wholes: &[(&str, usize)],
    rows: &[(&str, usize)],
    tables: &[&str],
) -> Signature {
    Signature {
        system: system.to_owned(),
        words: words.iter().map(|(name, word)| (name.to_string(), word.to_string())).collect(),
        wholes: wholes.iter().map(|(name, whole)| (name.to_string(), *whole)).collect(),
        lists: Vec::new(),
        rows: rows.iter().map(|(name, count)| (name.to_string(), vec![false; *count])).collect(),
        tables: tables.iter().map(|name| (name.to_string(), false)).collect(),
        equations: None,
        watched: None,
        controller: None,
    }
}

const CONTROLS: [&[(&str, &str)]; 5] = [
    &[],
    &[("control", "energy"), ("control.form", "limited")],
    &[("control", "energy"), ("control.form", "printed")],
    &[("control", "projection"), ("control.way", "scaling")],
    &[("control", "projection"), ("control.way", "nacozy")],
];

fn bodies(n: usize, dim: usize, force: &str, control: &[(&str, &str)]) -> Signature {
    let mut rows = vec![("masses", n), ("strength", n), ("softening", 1)];
    match control.first() {
        Some((_, "energy")) => rows.extend([("control.gain", 1), ("control.target", 1)]),
        Some(_) => rows.push(("control.target", 1)),
        None => {}
    }
    signature("nbody", &[&[("force", force)], control].concat(), &[("dim", dim)], &rows, &[])
}

/// Bodies; only every `every`-th has mass.
fn with_massless(n: usize, every: usize, dim: usize, force: &str, control: &[(&str, &str)]) -> Signature {
    let massless = (0..n as u32).filter(|i| *i as usize % every != 1).collect();
    Signature { lists: vec![("massless".to_owned(), massless)], ..bodies(n, dim, force, control) }
}

/// A net in `dim` dimensions: a lattice of rows of particles side by side, whose springs lie in runs, and some springs across,
/// which do not. The first particle is fixed if there is more than one row.
fn net(rows: usize, columns: usize, dim: usize, numbers: &[(&str, usize)], control: &[(&str, &str)]) -> Signature {
    let n = rows * columns;
    let mut pairs: Vec<[usize; 2]> = (0..n).filter(|i| i % columns + 1 < columns).map(|i| [i, i + 1]).collect();
    pairs.extend((columns..n).map(|i| [i, i - columns]));
    pairs.extend((2..n / 2).step_by(3).map(|i| [n - i, i / 2]));
    let fixed = if rows > 1 { vec![0] } else { Vec::new() };
    let mut parameters = vec![("masses", 1), ("stiffness", 1), ("rest", 1)];
    for (name, count) in numbers {
        parameters.retain(|(known, _)| known != name);
        parameters.push((name, if *count == 0 { pairs.len() } else { *count }));
    }
    match control.first() {
        Some((_, "energy")) => parameters.extend([("control.gain", 1), ("control.target", 1)]),
        Some(_) => parameters.push(("control.target", 1)),
        None => {}
    }
    let list = |numbers: Vec<usize>| numbers.into_iter().map(|number| number as u32).collect();
    let lists = vec![("pairs".to_owned(), list(pairs.concat())), ("fixed".to_owned(), list(fixed))];
    Signature { lists, ..signature("springs", control, &[("n", n), ("dim", dim)], &parameters, &[]) }
}

/// Nets of springs: a pair, and those of every kind; 0 stands for as many numbers as there are springs.
fn nets() -> Vec<Signature> {
    let damped = [("masses", 12), ("stiffness", 0), ("rest", 0), ("damping", 0), ("gravity", 3), ("drag", 12)];
    vec![
        net(1, 2, 1, &[], &[]),
        net(1, 4, 2, &[("damping", 1)], &[]),
        net(3, 4, 3, &damped, &[]),
        net(2, 6, 3, &damped[..3], &[]),
        net(3, 4, 2, &[("masses", 12), ("gravity", 2)], &[]),
        net(2, 11, 2, &[("drag", 1), ("rest", 0)], &[]),
    ]
}

fn systems() -> Vec<Signature> {
    let sine = [("x.amplitude", 1), ("x.omega", 1), ("x.phase", 1)];
    let mut all = vec![
        signature("oscillator", &[("form", "physical")], &[], &[&[("omega", 1), ("damping", 1)], &sine[..]].concat(), &["a"]),
        signature("pendulum", &[], &[], &[("omega", 1)], &[]),
        signature("restricted_three_body", &[], &[], &[("mu", 1)], &[]),
        signature("linear", &[("kind", "acceleration")], &[("n_v", 3)], &[("rows", 36)], &[]),
        signature("linear", &[], &[("n_v", 0)], &[("rows", 25)], &[]),
        signature("linear", &[], &[("n_v", 4)], &[("rows", 16)], &[]),
        signature("linear", &[], &[("n_v", 7), ("inputs", 2)], &[("rows", 19 * 21), ("inputs[0]", 1)], &["inputs[1]"]),
    ];
    all.extend([1, 2, 19].map(|n| signature("chain", &[], &[], &[("stiffness", n + 1), ("mass", n)], &[])));
    for force in ["logarithmic", "newton", "printed"] {
        for (n, dim) in [(1, 2), (2, 3), (9, 2), (17, 3)] {
            all.extend(CONTROLS.map(|control| bodies(n, dim, force, control)));
        }
    }
    for (n, every, dim, force) in [(9, 2, 2, "newton"), (23, 7, 3, "logarithmic"), (20, 30, 3, "printed")] {
        all.extend(CONTROLS.map(|control| with_massless(n, every, dim, force, control)));
    }
    all.push(with_massless(11, usize::MAX, 2, "newton", &[]));
    all.extend(nets());
    all.extend(CONTROLS.map(|control| net(2, 5, 3, &[("masses", 10), ("gravity", 3)], control)));
    all.extend([bodies(35, 2, "newton", &[]), bodies(35, 3, "newton", CONTROLS[4]), bodies(66, 2, "logarithmic", CONTROLS[1])]);
    all
}

/// Numbers between ½ and 2, always the same.
fn numbers(count: usize, seed: u64) -> Vec<f64> {
    let mut x = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut next = || {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        0.5 + 1.5 * (x >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..count).map(|_| next()).collect()
}

/// Rows of parameters and samples of `members` members.
fn spec<'a>(signature: &Signature, numbers: &'a [f64], members: usize) -> Spec<'a> {
    let rows: Vec<Row> = numbers.chunks(members).map(Row).collect();
    let tables = signature.tables.iter().map(|_| Table { samples: rows[..9].to_vec(), start: 0.29, interval: 0.011 }).collect();
    Spec { signature: signature.clone().into(), rows: rows[..signature.parameters()].to_vec(), tables }
}

/// The results of a group for members: states, quantities and sums after some steps, by bits, its lane's first for each row.
fn made(group: &mut dyn Group, spec: &Spec, member: usize, count: usize, state: &[f64]) -> Vec<Vec<u64>> {
    let lanes = group.lanes();
    group.prepare(spec, member, count);
    let (v, y) = group.slots_mut();
    for (slot, numbers) in v.chunks_exact_mut(lanes).chain(y.chunks_exact_mut(lanes)).zip(state.chunks(13)) {
        Row(numbers).fill(member, count, slot);
    }
    let mut seen = Vec::new();
    let mut look = |group: &mut dyn Group| {
        let (v, y) = group.slots();
        let mut rows = vec![0.0; group.recorded() * lanes];
        let all = [v, y, group.tally()].concat();
        group.record(&mut rows);
        for row in all.chunks_exact(lanes).chain(rows.chunks_exact(lanes)) {
            seen.push(row[..count].iter().map(|number| number.to_bits()).collect());
        }
    };
    group.start(5);
    group.advance(5, 3);
    look(group);
    group.advance(8, 1);
    group.finish(9);
    look(group);
    seen
}

fn key(signature: &Signature, how: StepKind) -> TapeKey {
    let kind = kind(signature).unwrap();
    let record = if matches!(how, StepKind::Method { .. }) { (kind.quantities)(signature) } else { Vec::new() };
    TapeKey {
        signature: signature.clone().into(),
        how,
        record: record.into_iter().map(|(name, _)| name.to_owned()).collect(),
        fused: false,
        precision: Precision::Double,
    }
}

/// Panics unless the rows of several members are those of their own runs.
fn same(of_all: &[Vec<u64>], of_each: &[Vec<Vec<u64>>], what: &str) {
    for (i, of_one) in of_each.iter().enumerate() {
        let mine: Vec<Vec<u64>> = of_all.iter().map(|row| vec![row[i]]).collect();
        assert_eq!(&mine, of_one, "{what}, member {i}");
    }
}

#[test]
fn a_program_over_rows_is_its_tape() {
    let mut tried = 0;
    for (seed, signature) in systems().into_iter().enumerate() {
        let parameters = numbers(13 * (signature.parameters() + 9), seed as u64 + 1);
        let spec = spec(&signature, &parameters, 13);
        for record in RECORDS.iter().filter(|record| record.program().series_order() == 0) {
            let ways = record.carry.as_ref().map_or(1, |carry| carry.starts.len().max(1));
            // Of what is long to trace some methods are enough.
            if signature.count("masses") > 17 && !["rk4", "verlet", "false_euler"].contains(&record.name) {
                continue;
            }
            for choice in 0..ways {
                let key = key(&signature, StepKind::Method { name: record.name.to_owned(), choice });
                let traced = match key.traced() {
                    Err(Error::VelocityDependent { .. }) => continue,
                    traced => traced.unwrap(),
                };
                let Shape { v, y } = traced.shape;
                // Kepler motions are of one tape: over rows a drift is free flight.
                if record.program().splits() && signature.words.contains(&("force".to_owned(), "newton".to_owned())) {
                    continue;
                }
                // Full matrices take long to trace.
                if record.program().is_implicit() && v + y > MOST_UNKNOWNS {
                    continue;
                }
                let state = numbers(13 * (v + y), 99);
                let what = format!("{} {choice} on {signature:?}", record.name);
                let level = Level::choose().unwrap();
                let mut tape = Lanes::new(&traced, &spec, level, 1, &CLOCK).unwrap();
                let of_each: Vec<_> = (2..7).map(|member| made(&mut tape, &spec, member, 1, &state)).collect();
                let large = |rates: Box<dyn Rates>| {
                    let rates = with_equations(rates, &key, &spec, traced.shape, level, &CLOCK).unwrap();
                    let schedules = Schedules::of(&key.how, rates.traits(), traced.shape).unwrap();
                    LargeGroup::new(schedules, rates, traced.shape, traced.recorded, level, &CLOCK)
                };
                for lanes in [8, 1] {
                    let rates = Box::new(TapeRates::new(RateTapes::of(&key).unwrap(), &spec, level, lanes, &CLOCK));
                    let mut group = large(rates);
                    for (at, of_each) in of_each.chunks(lanes.min(5)).enumerate() {
                        let of_all = made(&mut group, &spec, 2 + lanes * at, of_each.len(), &state);
                        same(&of_all, of_each, &format!("tapes of {lanes} lanes, {what}"));
                    }
                }
                if let Some(long) = kernel_of(&signature.system) {
                    for threads in [1, 2] {
                        let machine = Machine { level, threads };
                        let asked = RatesRequest {
                            signature: &signature,
                            shape: traced.shape,
                            record: &key.record,
                            machine,
                            h: CLOCK.h,
                            attempts: false,
                        };
                        let mut group = large(single(long, &asked));
                        for (i, of_one) in of_each.iter().enumerate() {
                            assert_eq!(&made(&mut group, &spec, 2 + i, 1, &state), of_one, "kernel, {what}, member {i}");
                        }
                    }
                }
                tried += 1;
            }
        }
    }
    assert!(tried > 500, "{tried}");
}

#[test]
fn every_level_makes_the_same_of_a_large_member() {
    for signature in [
        bodies(100, 3, "newton", CONTROLS[3]),
        systems().remove(6),
        signature("chain", &[], &[], &[("stiffness", 301), ("mass", 300)], &[]),
        net(13, 31, 3, &[("stiffness", 0), ("damping", 0), ("gravity", 3), ("drag", 1)], &[]),
        net(17, 24, 2, &[("rest", 0), ("masses", 17 * 24)], CONTROLS[4]),
    ] {
        let parameters = numbers(13 * (signature.parameters() + 9), 7);
        let spec = spec(&signature, &parameters, 13);
        let key = key(&signature, StepKind::Method { name: "rk4".to_owned(), choice: 0 });
        let traced = key.traced().unwrap();
        let state = numbers(13 * (traced.shape.v + traced.shape.y), 8);
        let of_level = |level: Level| {
            let machine = Machine { level, threads: 1 };
            let asked = RatesRequest {
                signature: &signature,
                shape: traced.shape,
                record: &key.record,
                machine,
                h: CLOCK.h,
                attempts: false,
            };
            let rates = single(kernel_of(&signature.system).unwrap(), &asked);
            let schedules = Schedules::of(&key.how, rates.traits(), traced.shape).unwrap();
            made(&mut LargeGroup::new(schedules, rates, traced.shape, traced.recorded, level, &CLOCK), &spec, 3, 1, &state)
        };
        let all: Vec<_> = Level::available().into_iter().map(of_level).collect();
        assert!(all.iter().all(|one| *one == all[0]), "{signature:?}");
    }
}

#[test]
fn attempts_of_a_large_member_are_those_of_its_tape() {
    for (seed, signature) in systems().into_iter().enumerate() {
        if signature.count("masses") > 17 {
            continue;
        }
        let parameters = numbers(13 * (signature.parameters() + 9), seed as u64 + 1);
        let spec = spec(&signature, &parameters, 13);
        for record in RECORDS.iter().filter(|record| record.estimate.is_some() && record.program().series_order() == 0) {
            let key = key(
                &signature,
                StepKind::Attempts { name: record.name.to_owned(), order: 0, acceptance: Acceptance::default(), backward: false },
            );
            let traced = key.traced().unwrap();
            let (level, shape) = (Level::choose().unwrap(), traced.shape);
            if record.program().is_implicit() && shape.v + shape.y > MOST_UNKNOWNS {
                continue;
            }
            let state = numbers(shape.v + shape.y, 98);
            let run = |adaptive: &mut dyn AdaptiveBatch| {
                let mut seen = Vec::new();
                for member in [4, 11] {
                    adaptive.prepare_lane(&spec, 0, member);
                    adaptive.set_state(0, &state);
                    let new = Pace::of([0.0; Pace::<f64>::NUMBERS]);
                    let (t, interval, until) = (0.3, f64::INFINITY, f64::NEG_INFINITY);
                    let (most_step, wall) = (f64::INFINITY, f64::INFINITY);
                    let begun = Pace { t, begin: t, h: 0.2, interval, until, most_step, wall, before: 1.0, most: 5.0, ..new };
                    let begun = Pace { relative: 1e-6, ..begun };
                    adaptive.set_scales(0, &vec![0.25; Acceptance::default().numbers(shape.v, shape.y)]);
                    let lasts = f64::from(u8::from(member == 4));
                    adaptive.set_pace(0, Pace { target: 0.9, lasts, absolute: 1e-9 * (1.0 - lasts), ..begun });
                    // Along the path, and then a step beside it, wherever that has come to.
                    for (attempts, extra) in [(1, 0.0), (1, 0.0), (40, 0.0), (1, 0.01)] {
                        adaptive.set_pace(0, Pace { extra, ..adaptive.pace(0) });
                        adaptive.attempt(attempts);
                        let numbers = [adaptive.state(0), adaptive.pace(0).numbers().to_vec(), adaptive.scales(0)].concat();
                        seen.push(numbers.into_iter().map(f64::to_bits).collect::<Vec<_>>());
                    }
                }
                seen
            };
            let of_tape = run(&mut AdaptiveLanes::new(&traced, &spec, level, 1, 30.0, false).unwrap());
            let clock = Clock { t0: 0.0, h: 1.0 };
            // Tapes of rates are scaled to a step of 1, on which a push depends.
            let mut rates: Vec<Box<dyn Rates>> = Vec::new();
            if !controls::pushes(&signature) {
                rates.push(Box::new(TapeRates::new(RateTapes::of(&key).unwrap(), &spec, level, 1, &clock)));
            }
            let machine = Machine { level, threads: 1 };
            let asked = RatesRequest { signature: &signature, shape, record: &[], machine, h: 1.0, attempts: true };
            rates.extend(kernel_of(&signature.system).map(|long| single(long, &asked)));
            for (kind, rates) in rates.into_iter().enumerate() {
                let rates = with_equations(rates, &key, &spec, shape, level, &clock).unwrap();
                let schedules = Schedules::of(&key.how, rates.traits(), traced.shape).unwrap();
                let mut large = LargeAdaptive::new(schedules, rates, &traced, level, 30.0, false).unwrap();
                assert_eq!(run(&mut large), of_tape, "{} on {signature:?}, rates {kind}", record.name);
            }
        }
    }
}

#[test]
fn the_matrix_form_of_a_large_member_is_its_tape() {
    for (n, inputs, fused) in
        [(1, 0, false), (3, 1, false), (8, 2, false), (33, 1, false), (57, 0, false), (8, 2, true), (57, 1, true)]
    {
        let how = StepKind::Matrix { nodes: [0.0, 0.5, 1.0].map(f64::to_bits).to_vec(), fused };
        let rows =
            [("p", n * n), ("q", 3 * inputs * n), ("inputs[0].amplitude", 1), ("inputs[0].omega", 1), ("inputs[0].phase", 1)];
        let tables: &[&str] = if inputs == 2 { &["inputs[1]"] } else { &[] };
        let mut signature = signature(
            "matrix",
            &[],
            &[("n", n), ("n_v", n / 3), ("inputs", inputs)],
            &rows[..if inputs > 0 { 5 } else { 2 }],
            tables,
        );
        signature.rows.retain(|(_, rows)| !rows.is_empty());
        let parameters = numbers(13 * (signature.parameters() + 9), n as u64);
        let spec = spec(&signature, &parameters, 13);
        let traced = TapeKey {
            signature: signature.into(),
            how: how.clone(),
            record: Vec::new(),
            fused: false,
            precision: Precision::Double,
        }
        .traced()
        .unwrap();
        let (level, state) = (Level::choose().unwrap(), numbers(13 * n, 3));
        let mut tape = Lanes::new(&traced, &spec, level, 1, &CLOCK).unwrap();
        let of_each: Vec<_> = (2..7).map(|member| made(&mut tape, &spec, member, 1, &state)).collect();
        let mut map = Matrix::new(&spec, traced.shape, &how, level, &CLOCK);
        for (i, of_one) in of_each.iter().enumerate() {
            assert_eq!(&made(&mut map, &spec, 2 + i, 1, &state), of_one, "{n} states, member {i}");
        }
    }
}

/// How many rows the arena of a method has, how often it asks for rates and how many passes it makes.
fn schedule(name: &str, traits: RateTraits) -> (usize, usize, usize) {
    let method = method(name).unwrap();
    let program = method.program();
    let schedule = BlockSchedule::new(program, &program.results, Goal::State, traits, Shape { v: 9, y: 9 });
    let passes = schedule.actions.iter().filter(|action| matches!(action, Action::Pass(_))).count();
    (schedule.rows, schedule.actions.len() - passes, passes)
}

#[test]
fn no_row_is_kept_and_no_pass_is_made_that_is_not_needed() {
    let bodies = RateTraits { second_order: true, reads_v: false, stretched: false };
    let any = RateTraits { second_order: false, reads_v: true, stretched: false };
    // v is replaced in its row, and y by way of it.
    assert_eq!(schedule("false_euler", bodies), (3, 1, 1));
    assert_eq!(schedule("false_euler", any), (3, 2, 2));
    assert_eq!(schedule("standard_euler", any), (4, 1, 1));
    assert_eq!(schedule("leapfrog", bodies), (3, 1, 1));
    assert_eq!(schedule("verlet", bodies), (3, 1, 1));
    // Four forces and two places to look from: forces do not depend on v, so two of them can be asked for at a time.
    assert_eq!(schedule("rk4", bodies), (8, 4, 3));
    // Two blocks of increments for each stage and two to look from.
    assert_eq!(schedule("rk4", any), (12, 4, 4));
}

//! Large systems: a method's program over long rows makes the bits that its tape makes, with rates of both kinds.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use stepwell_core::{
    controls,
    error::Error,
    isa::Level,
    large::{
        Asked, Facts, Rates,
        adaptive::LargeAdaptive,
        course::{Act, Course, Goal},
        group::LargeGroup,
        matrix::Matrix,
        single,
        tapes::TapeRates,
    },
    method,
    pace::{Acceptance, Pace},
    real::Precision,
    run::{
        Machine,
        adaptive::{AdaptiveBatch, AdaptiveLanes},
        group::{Group, Lanes},
        stage::Clock,
    },
    spec::{Given, Row, Spec, Table},
    steppers::RECORDS,
    system::{self, Shape},
    trace::{How, Scene},
};

const CLOCK: Clock = Clock { t0: 0.3, h: 0.0123 };

fn given(system: &str, words: &[(&str, &str)], wholes: &[(&str, usize)], rows: &[(&str, usize)], tables: &[&str]) -> Given {
    Given {
        system: system.to_owned(),
        words: words.iter().map(|(name, word)| (name.to_string(), word.to_string())).collect(),
        wholes: wholes.iter().map(|(name, whole)| (name.to_string(), *whole)).collect(),
        lists: Vec::new(),
        rows: rows.iter().map(|(name, count)| (name.to_string(), vec![false; *count])).collect(),
        tables: tables.iter().map(|name| (name.to_string(), false)).collect(),
        equations: None,
        watched: None,
    }
}

const CONTROLS: [&[(&str, &str)]; 5] = [
    &[],
    &[("control", "energy"), ("control.form", "limited")],
    &[("control", "energy"), ("control.form", "printed")],
    &[("control", "projection"), ("control.way", "scaling")],
    &[("control", "projection"), ("control.way", "nacozy")],
];

fn bodies(n: usize, dim: usize, force: &str, control: &[(&str, &str)]) -> Given {
    let mut rows = vec![("masses", n), ("strength", n), ("softening", 1)];
    match control.first() {
        Some((_, "energy")) => rows.extend([("control.gain", 1), ("control.target", 1)]),
        Some(_) => rows.push(("control.target", 1)),
        None => {}
    }
    given("nbody", &[&[("force", force)], control].concat(), &[("dim", dim)], &rows, &[])
}

/// A net in so many dimensions: a lattice of rows of particles side by side, whose springs lie in runs, and some springs across, which do
/// not. The first particle is fixed if there is more than one row.
fn net(rows: usize, columns: usize, dim: usize, numbers: &[(&str, usize)], control: &[(&str, &str)]) -> Given {
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
    Given { lists, ..given("springs", control, &[("n", n), ("dim", dim)], &parameters, &[]) }
}

/// Nets of springs: a pair, and those of every kind; 0 stands for as many numbers as there are springs.
fn nets() -> Vec<Given> {
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

fn systems() -> Vec<Given> {
    let sine = [("x.amplitude", 1), ("x.omega", 1), ("x.phase", 1)];
    let mut all = vec![
        given("oscillator", &[("form", "physical")], &[], &[&[("omega", 1), ("damping", 1)], &sine[..]].concat(), &["a"]),
        given("pendulum", &[], &[], &[("omega", 1)], &[]),
        given("restricted_three_body", &[], &[], &[("mu", 1)], &[]),
        given("linear", &[("kind", "acceleration")], &[("n_v", 3)], &[("rows", 36)], &[]),
        given("linear", &[], &[("n_v", 0)], &[("rows", 25)], &[]),
        given("linear", &[], &[("n_v", 4)], &[("rows", 16)], &[]),
        given("linear", &[], &[("n_v", 7), ("inputs", 2)], &[("rows", 19 * 21), ("inputs[0]", 1)], &["inputs[1]"]),
    ];
    all.extend([1, 2, 19].map(|n| given("chain", &[], &[], &[("stiffness", n + 1), ("mass", n)], &[])));
    for force in ["logarithmic", "newton", "printed"] {
        for (n, dim) in [(1, 2), (2, 3), (9, 2), (17, 3)] {
            all.extend(CONTROLS.map(|control| bodies(n, dim, force, control)));
        }
    }
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

/// Rows of parameters and samples of so many members.
fn spec<'a>(given: &Given, numbers: &'a [f64], members: usize) -> Spec<'a> {
    let rows: Vec<Row> = numbers.chunks(members).map(Row).collect();
    let tables = given.tables.iter().map(|_| Table { samples: rows[..9].to_vec(), start: 0.29, interval: 0.011 }).collect();
    Spec { given: given.clone().into(), rows: rows[..given.parameters()].to_vec(), tables }
}

/// What a group makes of members: states, quantities and sums after some steps, by bits, its lane's first for each row.
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

fn scene(given: &Given, how: How) -> Scene {
    let kind = system::kind(&given.system).unwrap();
    let record = if matches!(how, How::Method { .. }) { (kind.quantities)(given) } else { Vec::new() };
    Scene {
        given: given.clone().into(),
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
    for (seed, given) in systems().into_iter().enumerate() {
        let kind = system::kind(&given.system).unwrap();
        let parameters = numbers(13 * (given.parameters() + 9), seed as u64 + 1);
        let spec = spec(&given, &parameters, 13);
        for record in RECORDS.iter().filter(|record| record.program().series_order() == 0) {
            let ways = record.carry.as_ref().map_or(1, |carry| carry.starts.len().max(1));
            // Of what is long to trace some methods are enough.
            if given.count("masses") > 17 && !["rk4", "verlet", "false_euler"].contains(&record.name) {
                continue;
            }
            for choice in 0..ways {
                let scene = scene(&given, How::Method { name: record.name.to_owned(), choice });
                let traced = match scene.traced() {
                    Err(Error::VelocityDependent { .. }) => continue,
                    traced => traced.unwrap(),
                };
                let Shape { v, y } = traced.shape;
                let state = numbers(13 * (v + y), 99);
                let what = format!("{} {choice} on {given:?}", record.name);
                let level = Level::choose().unwrap();
                let mut tape = Lanes::new(&traced, &spec, level, 1, &CLOCK).unwrap();
                let of_each: Vec<_> = (2..7).map(|member| made(&mut tape, &spec, member, 1, &state)).collect();
                let large = |rates: Box<dyn Rates>| {
                    let courses = traced.courses(rates.facts()).unwrap();
                    LargeGroup::new(courses, rates, traced.shape, traced.recorded, level, &CLOCK)
                };
                for lanes in [8, 1] {
                    let rates = Box::new(TapeRates::new(traced.rated().unwrap(), &spec, level, lanes, &CLOCK));
                    let mut group = large(rates);
                    for (at, of_each) in of_each.chunks(lanes.min(5)).enumerate() {
                        let of_all = made(&mut group, &spec, 2 + lanes * at, of_each.len(), &state);
                        same(&of_all, of_each, &format!("tapes of {lanes} lanes, {what}"));
                    }
                }
                if let Some(long) = kind.long {
                    for threads in [1, 2] {
                        let machine = Machine { level, threads };
                        let asked = Asked {
                            given: &given,
                            shape: traced.shape,
                            record: &scene.record,
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
    for given in [
        bodies(100, 3, "newton", CONTROLS[3]),
        systems().remove(6),
        given("chain", &[], &[], &[("stiffness", 301), ("mass", 300)], &[]),
        net(13, 31, 3, &[("stiffness", 0), ("damping", 0), ("gravity", 3), ("drag", 1)], &[]),
        net(17, 24, 2, &[("rest", 0), ("masses", 17 * 24)], CONTROLS[4]),
    ] {
        let parameters = numbers(13 * (given.parameters() + 9), 7);
        let spec = spec(&given, &parameters, 13);
        let scene = scene(&given, How::Method { name: "rk4".to_owned(), choice: 0 });
        let traced = scene.traced().unwrap();
        let state = numbers(13 * (traced.shape.v + traced.shape.y), 8);
        let of_level = |level: Level| {
            let machine = Machine { level, threads: 1 };
            let asked = Asked { given: &given, shape: traced.shape, record: &scene.record, machine, h: CLOCK.h, attempts: false };
            let rates = single(system::kind(&given.system).unwrap().long.unwrap(), &asked);
            let courses = traced.courses(rates.facts()).unwrap();
            made(&mut LargeGroup::new(courses, rates, traced.shape, traced.recorded, level, &CLOCK), &spec, 3, 1, &state)
        };
        let all: Vec<_> = Level::available().into_iter().map(of_level).collect();
        assert!(all.iter().all(|one| *one == all[0]), "{given:?}");
    }
}

#[test]
fn attempts_of_a_large_member_are_those_of_its_tape() {
    for (seed, given) in systems().into_iter().enumerate() {
        if given.count("masses") > 17 {
            continue;
        }
        let parameters = numbers(13 * (given.parameters() + 9), seed as u64 + 1);
        let spec = spec(&given, &parameters, 13);
        for record in RECORDS.iter().filter(|record| record.estimate.is_some() && record.program().series_order() == 0) {
            let scene = scene(
                &given,
                How::Attempts { name: record.name.to_owned(), order: 0, acceptance: Acceptance::default(), backward: false },
            );
            let traced = scene.traced().unwrap();
            let (level, shape) = (Level::choose().unwrap(), traced.shape);
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
            let of_tape = run(&mut AdaptiveLanes::new(&traced, &spec, level, 1, 30.0).unwrap());
            let clock = Clock { t0: 0.0, h: 1.0 };
            // Tapes of rates are scaled to a step of 1, on which a push depends.
            let mut rates: Vec<Box<dyn Rates>> = Vec::new();
            if !controls::pushes(&given) {
                rates.push(Box::new(TapeRates::new(traced.rated().unwrap(), &spec, level, 1, &clock)));
            }
            let machine = Machine { level, threads: 1 };
            let asked = Asked { given: &given, shape, record: &[], machine, h: 1.0, attempts: true };
            rates.extend(system::kind(&given.system).unwrap().long.map(|long| single(long, &asked)));
            for (kind, rates) in rates.into_iter().enumerate() {
                let courses = traced.courses(rates.facts()).unwrap();
                let mut large = LargeAdaptive::new(courses, rates, &traced, level, 30.0).unwrap();
                assert_eq!(run(&mut large), of_tape, "{} on {given:?}, rates {kind}", record.name);
            }
        }
    }
}

#[test]
fn the_matrix_form_of_a_large_member_is_its_tape() {
    for (n, inputs) in [(1, 0), (3, 1), (8, 2), (33, 1), (57, 0)] {
        let how = How::Matrix { nodes: [0.0, 0.5, 1.0].map(f64::to_bits).to_vec() };
        let rows =
            [("p", n * n), ("q", 3 * inputs * n), ("inputs[0].amplitude", 1), ("inputs[0].omega", 1), ("inputs[0].phase", 1)];
        let tables: &[&str] = if inputs == 2 { &["inputs[1]"] } else { &[] };
        let mut given = given(
            "matrix",
            &[],
            &[("n", n), ("n_v", n / 3), ("inputs", inputs)],
            &rows[..if inputs > 0 { 5 } else { 2 }],
            tables,
        );
        given.rows.retain(|(_, rows)| !rows.is_empty());
        let parameters = numbers(13 * (given.parameters() + 9), n as u64);
        let spec = spec(&given, &parameters, 13);
        let traced =
            Scene { given: given.into(), how: how.clone(), record: Vec::new(), fused: false, precision: Precision::Double }
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
fn course(name: &str, facts: Facts) -> (usize, usize, usize) {
    let program = method::record(name).unwrap().program();
    let course = Course::new(&program, &program.results, Goal::State, facts, Shape { v: 9, y: 9 });
    let passes = course.acts.iter().filter(|act| matches!(act, Act::Pass(_))).count();
    (course.rows, course.acts.len() - passes, passes)
}

#[test]
fn no_row_is_kept_and_no_pass_is_made_that_is_not_needed() {
    let bodies = Facts { second_order: true, reads_v: false, stretched: false };
    let any = Facts { second_order: false, reads_v: true, stretched: false };
    // v is replaced in its row, and y by way of it.
    assert_eq!(course("false_euler", bodies), (3, 1, 1));
    assert_eq!(course("false_euler", any), (3, 2, 2));
    assert_eq!(course("standard_euler", any), (4, 1, 1));
    assert_eq!(course("leapfrog", bodies), (3, 1, 1));
    assert_eq!(course("verlet", bodies), (3, 1, 1));
    // Four forces and two places to look from: forces do not depend on v, so two of them can be asked for at a time.
    assert_eq!(course("rk4", bodies), (8, 4, 3));
    // Two blocks of increments for each stage and two to look from.
    assert_eq!(course("rk4", any), (12, 4, 4));
}
